"""One draw: its answers in the holes of its seat, and where draws are kept for the next command on the same drive.

They are found by all that they depend on: values of the drive and ranges of its prior, torques, turns, evidence, seed,
the source of the code that computes them and the machine's instructions, on which the last digits depend. A file whose
checksum or types do not hold is drawn anew.
"""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass, field
from functools import cached_property
from hashlib import sha256
from typing import Annotated

import numpy as np
from pydantic import Field, TypeAdapter

from hdassist.belief.evidence import Evidence
from hdassist.belief.prior import DrivePrior
from hdassist.error.error_map import Batch, ErrorMap
from hdassist.error.extremes import DRAWN_GRIDS, many_extremes
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.run.cache import cached, keep, keeps_answers, program
from hdassist.run.kept import ClosedRecord, Count, Magnitude, Number
from hdassist.solve.answers import EMPTY, Certificate, Residual
from hdassist.solve.walk import walk_library


def errors_by_turn(
    maps: Sequence[ErrorMap],
    drive: Drive,
    torques: Sequence[float],
    rotations_deg: Sequence[float],
    measured: Sequence[tuple[float, float]] = (),
) -> tuple[Array, Array, Array, Certificate]:
    """F'_ior [arcsec] of a drive at torques [N*m], and with its fixed wheel turned, and the proof of both.

    Results of shape (torques,), (torques, rotations) and (measured,). Arguments: maps of its error at all torques;
    measured, single torques [N*m] with a turn each [deg]. Raises UntrustedError where an answer cannot be trusted.
    """
    proof, now, turned, there = EMPTY, dict[float, float](), dict[float, Array](), dict[tuple[float, float], float]()
    for error_map in maps:
        found = many_extremes(error_map, Batch.of(drive), DRAWN_GRIDS)
        M_g, now[error_map.M_g] = error_map.M_g, found.first
        turned[M_g], of_turned = _at_turns(error_map, drive, found.first, rotations_deg)
        # by themselves, so that their digits are the same whatever else is searched
        alone = [at for at in measured if at[0] == M_g]
        F_ior, of_measured = _at_turns(error_map, drive, found.first, [turn for _, turn in alone])
        there |= zip(alone, F_ior.tolist(), strict=True)
        proof += found.certificate + of_turned + of_measured
    of_turns = np.array([turned[M_g] for M_g in torques]).reshape(len(torques), len(rotations_deg))
    return np.array([now[M_g] for M_g in torques]), of_turns, np.array([there[at] for at in measured]), proof


def _at_turns(error_map: ErrorMap, drive: Drive, now: float, turns: Sequence[float]) -> tuple[Array, Certificate]:
    """F'_ior [arcsec] of a drive with its fixed wheel turned [deg], shape (turns,), and the proof of it.

    Argument: now, F'_ior as it stands.
    """
    F_ior, away = np.full(len(turns), now), np.flatnonzero(np.array(turns) % 360)
    if not len(away):
        return F_ior, EMPTY
    there = many_extremes(error_map, Batch.turned(drive, np.array(turns)[away]), DRAWN_GRIDS)
    F_ior[away] = there.F_ior_arcsec
    return F_ior, there.certificate


KEPT_SAMPLES = "samples"
ShareOfOne = Annotated[float, Field(strict=True, ge=0, le=1)]
# of a preset, the parts that no draw depends on: words, limits; the prior stands in the key by itself
WITHOUT_EFFECT = {"name", "description", "acceptance", "cost", "source", "uncertainty", "fit"}


@dataclass(frozen=True)
class Draw(ClosedRecord):
    """One draw: why it is no drive, or its predictions, F'_ior [arcsec] (None where weeded), weight and proof.

    F_ior_arcsec, at each torque; turned_arcsec, at each torque with each turn; shares: of each field's probability;
    proof: states, residuals, fallbacks; follows: values of fields that follow from others, by path.
    """

    refused: str = ""
    figures: Mapping[str, Number] = field(default_factory=dict)
    F_ior_arcsec: tuple[Magnitude, ...] | None = None
    turned_arcsec: tuple[tuple[Magnitude, ...], ...] | None = None
    weight: Magnitude = 0.0
    shares: tuple[ShareOfOne, ...] = ()
    proof: tuple[Count, Residual, Residual, Residual, Residual, Count] = astuple(EMPTY)
    follows: Mapping[str, Number] = field(default_factory=dict)

    @property
    def certificate(self) -> Certificate:
        """Proof of the states behind it."""
        return Certificate(*self.proof)


_DRAWS = TypeAdapter(list[Draw])


@dataclass(frozen=True)
class KeptDraws:
    """Where the draws of samples are kept, by all that they depend on.

    torques [N*m]; rotations_deg; evidence; further: the figures beside F'_ior that they have, in words; seed.
    """

    prior: DrivePrior
    torques: tuple[float, ...]
    rotations_deg: tuple[float, ...]
    evidence: tuple[Evidence, ...]
    further: str
    seed: int

    def read(self) -> list[Draw]:
        """The draws that are kept, from the first on; none where not all of them are draws."""
        data = cached(KEPT_SAMPLES, self._key) if keeps_answers() else None
        with suppress(ValueError, RecursionError):
            return _DRAWS.validate_python(json.loads(data or b"[]"))
        return []

    def keep(self, draws: Sequence[Draw]) -> None:
        """Keep draws, from the first on."""
        if keeps_answers():
            with suppress(ValueError):  # a number that is none
                keep(KEPT_SAMPLES, self._key, json.dumps(_DRAWS.dump_python(list(draws)), allow_nan=False).encode())

    @cached_property
    def _key(self) -> str:
        depends = {
            "drive": self.prior.drive.model_dump(mode="json", exclude=WITHOUT_EFFECT),
            "fields": [[each.path, each.distribution, each.low, each.high, each.draws] for each in self.prior.fields],
            "torques": self.torques,
            "rotations": self.rotations_deg,
            "evidence": [astuple(each) for each in self.evidence],
            "further": self.further,
            "seed": self.seed,
            "program": [*program("daqp", "pydantic"), walk_library()[1], platform.platform()],
        }
        return sha256(json.dumps(depends, sort_keys=True).encode()).hexdigest()
