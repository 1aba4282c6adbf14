"""Parts of JSON answers that several commands have."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from operator import attrgetter
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hdassist.belief.influence import Influence, MeasurementGain
    from hdassist.belief.samples import Samples
    from hdassist.model.deviations import MeasuredTeeth, MeasuredWheel
    from hdassist.model.unknown import Unknown
    from hdassist.solve.through_cvxpy import CrossCheck

Json = dict[str, Any]
_SCHEMA_NUMBERS = {
    "accept": 2,
    "accept-replay": 2,
    "mount": 3,
    "tolerance": 2,
}  # of JSON whose keys have changed; all other has 1


def as_json(value: Any) -> Any:
    """A value as JSON has it: results as objects of their fields, arrays and tuples as lists, enumerations as text."""
    if is_dataclass(value):
        return {each.name: as_json(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return {key: as_json(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(each) for each in value]
    if isinstance(value, Enum):
        return str(value)
    return value.tolist() if hasattr(value, "tolist") else value  # arrays and numbers of numpy


def attributes(thing: object, *names: str, **paths: str) -> Json:
    """Some attributes of a result under their names, and others, by their dotted paths, under names of their own."""
    return {name: attrgetter(path)(thing) for name, path in (dict(zip(names, names, strict=True)) | paths).items()}


def objects(things: Iterable[object], *names: str, **paths: str) -> list[Json]:
    """The same of each of several results."""
    return [attributes(thing, *names, **paths) for thing in things]


def schema_of(command: str) -> str:
    """Schema of the JSON of a command."""
    return f"hdassist.{command}/{_SCHEMA_NUMBERS.get(command, 1)}"


def certificate_object(found: object, cross_checks: Iterable[CrossCheck | None] = ()) -> Json:
    """Certificate, cross-check and engine as JSON, the worst of all torques; of kept states their residual alone.

    found: certificate of states, or a kept one; the engine is that of states that no --solver was asked for.
    """
    from hdassist.solve.answers import Certificate
    from hdassist.solve.walk import walk_library

    proof = {**attributes(found, "states", "max_residual"), "engine": walk_library()[1]}
    if not isinstance(found, Certificate):
        return proof
    crosses = [cross for cross in cross_checks if cross]
    return proof | {
        "fallbacks": found.fallbacks,
        "residuals": attributes(found, "negative_force", "negative_gap", "complementarity", "equilibrium"),
        "cross_check": {
            "solver": crosses[0].solver,
            "states": sum(cross.states for cross in crosses),
            "max_difference_arcsec": max(cross.max_difference_arcsec for cross in crosses),
        }
        if crosses
        else None,
    }


def unknown_objects(unknown: Iterable[Unknown]) -> list[Json]:
    """Deviations that are not known: each with the range that it may have, in the unit of its field."""
    return [{"field": u.path, "range": [u.low, u.high], "reason": u.reason} for u in unknown]


def samples_object(samples: Samples | None) -> dict[str, Any] | None:
    """Number of samples, draws (those of ranges too) and refused draws, and the seed; None where none were drawn."""
    if samples is None:
        return None
    refused = [{"reason": reason, "draws": count} for reason, count in samples.refused.items()]
    counts = attributes(samples, "effective", "draws", "seed", draws_of_ranges="of_ranges.draws")
    return {**counts, "refused": refused}


def influence_objects(found: Sequence[Influence]) -> list[dict[str, Any]]:
    """Influences for JSON, the largest first."""
    return objects(found, "share", field="group")


def measure_objects(found: Sequence[MeasurementGain]) -> list[dict[str, Any]]:
    """Measurements for JSON, the largest gain first."""
    return objects(found, "gain", what="measured")


def pitch_object(measured: MeasuredTeeth | None) -> dict[str, Any]:
    """The measured wheels as a JSON object, by wheel; null where a wheel has its first harmonic."""
    return {name: _wheel(getattr(measured, name, None)) for name in ("b", "g")}


def _wheel(wheel: MeasuredWheel | None) -> dict[str, Any] | None:
    if wheel is None:
        return None
    pitch = wheel.pitch
    return {
        **attributes(pitch, "file", "sha256", "flank", "notes", mark_tooth="mark"),
        "mark_deg": wheel.mark_deg,
        "range_um": float(pitch.deviation.max() - pitch.deviation.min()),
    }
