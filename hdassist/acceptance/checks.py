"""The named checks of an acceptance, and the remarks beside them, as checks.toml declares them.

Names of limits, columns of lots, reports, `hdassist explain`, the docs and the tests read these declarations.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import TYPE_CHECKING, Literal

from hdassist.preset.fields import Acceptance
from hdassist.preset.kinds import FieldKind, kind_of, unit_of

if TYPE_CHECKING:  # heavy, and `hdassist explain` needs none of it
    from hdassist.acceptance.predictions import PredictedQuantities
    from hdassist.measuring.measure import SweepResult

Need = Literal["cycle", "self error", "stiffness"]
Extent = Literal["whole", "at least", "part", "not known"]
PredictedValue = Callable[["PredictedQuantities", float, float], float]
MeasuredValue = Callable[["SweepResult", float], tuple[float, float, float] | None]


@dataclass(frozen=True, kw_only=True)
class Explained:
    """An entry with a code: its name, its test, the fault, and its remedy."""

    code: str
    words: str
    tests: str
    wrong: str
    change: str


@dataclass(frozen=True, kw_only=True)
class Check(Explained):
    """A value held against a limit of the preset.

    field: of the preset's section acceptance, which has the limit; its kind says whom the limit is for. needs: which
    figures of the drive the value is predicted from. predicted: the value by quantities, torque [N*m] and order per cam
    turn (0 where the limit is for none). measured: the value, its standard uncertainty, and by how much lines off the
    orders may make it greater in another cycle, by one direction of a trace and the order, None where that does not
    tell it; no function where no trace tells it. of_part: what such a value says where the record visited a part of the
    cycle. Without predicted only a stated value counts. upper: whether the limit is the greatest value allowed, not
    the least.
    """

    field: str
    needs: Sequence[Need] = ()
    predicted: PredictedValue | None = None
    measured: MeasuredValue | None = None
    of_part: Extent = "at least"
    upper: bool = True

    @property
    def kind(self) -> FieldKind:
        """Kind of its limits: "limits", one for each torque; "orders", at every torque; "number", the drive."""
        return kind_of(Acceptance.model_fields[self.field])

    @property
    def unit(self) -> str:
        """Unit of its value and limit, as JSON has it."""
        return unit_of(Acceptance.model_fields[self.field])


def _amplitude(found: SweepResult, order: float) -> tuple[float, float, float] | None:
    near = [o for o in found.orders if abs(o.per_cam_rev - order) <= 0.5 / found.bins.span]
    best = min(near, key=lambda o: abs(o.per_cam_rev - order), default=None)
    return (best.amplitude_arcsec, best.uncertainty_arcsec, 0.0) if best else None


_TABLE = tomllib.loads(files("hdassist.acceptance").joinpath("checks.toml").read_text("utf-8"))
PREDICTED: dict[str, PredictedValue] = {
    "F_IOR": lambda of, M_g, _: of.F_ior(M_g),
    "TURN_RANGE": lambda of, M_g, _: of.errors[M_g].turn_range_arcsec,
    "SELF_ERROR": lambda of, M_g, _: of.self_errors[M_g].range_arcsec,
    "ORDER": lambda of, M_g, order: of.amplitude(M_g, order),
    "LOST_MOTION": lambda of, *_: of.stiffness[0].lost_motion_arcsec,
    **{f"K_{k}": lambda of, *_, k=k: of.stiffness[0].weaker(k) for k in (1, 2, 3)},
}
MEASURED: dict[str, MeasuredValue] = {
    "F_IOR": lambda found, _: (found.range.value, found.uncertainty_arcsec, found.range.rise),
    "TURN_RANGE": lambda of, _: (of.revolution.value, of.revolution.uncertainty, of.revolution.rise),
    "ORDER": _amplitude,
}
CHECKS = tuple(
    Check(code=code, predicted=PREDICTED.get(code), measured=MEASURED.get(code), **declared)
    for code, declared in _TABLE["checks"].items()
)
CODES: dict[str, Explained] = {check.code: check for check in CHECKS} | {
    code: Explained(code=code, **words) for code, words in _TABLE["remarks"].items()
}
F_IOR, ORDER_CHECK = (next(check for check in CHECKS if check.code == code) for code in ("F_IOR", "ORDER"))
