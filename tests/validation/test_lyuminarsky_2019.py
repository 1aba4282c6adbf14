"""The paper that vzp160 follows: Lyuminarsky et al. 2019, doi 10.18698/0536-1044-2019-11-3-8."""

from collections.abc import Iterable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import spearmanr

from hdassist import Drive, kinematic_error, load_preset
from hdassist.calibration import PhaseScan, phase_scan
from hdassist.error.cycle import KinematicError, SelfError, self_error
from hdassist.error.waves import trace
from hdassist.model.geometry import Array
from hdassist.preset.text import read_yaml
from hdassist.run.run import UNCHECKED
from tests.helpers.support import changed
from tests.validation.case import Case, Kind, about, parameters
from tests.validation.parameter_sets import TORQUES, F_ior_over_sets, span

TITLE = "Lyuminarsky, Lyuminarsky, Ivanov (2019)"
ABOUT = (
    "`vzp160` is the drive of the paper. Values that the paper does not print were identified from Fig. 3 (F'_ior "
    "over the mounting phase) and from the range of Fig. 2 in three input revolutions, within bounds that include "
    "the self error (`docs/vzp160.targets.yaml`; `python -m benchmarks.identify`). "
    "The statements of the text about single-zone meshing (80 N·m, 36 starts of an input revolution) and "
    "the catalogue stiffnesses were not used in the fit. The alternatives were fitted to Fig. 3 alone, so "
    "Fig. 2 was not used for them."
    "\n\n"
    "The values that both figures leave undetermined (`fit` of the preset) were searched again from drives spread "
    "over all bounds (568 drives, 130 effective). None of the twelve values has another distribution (Kolmogorov "
    "and Smirnov: maximum distance 0.16, and 0.21 would be one in twenty). Hole 0 has 27.6″ (25.8 to 29.8) and "
    "7.8″, and hole 8 has 16.5″ (15.3 to 17.5) and 4.3″. "
    "Every set of values that agrees with Fig. 3 has a K1 of at least 72."
    " The paper is a "
    "computation, so the agreement is with another model."
)
ALTERNATIVES = read_yaml(Path(__file__).with_name("vzp160_alternatives.yaml").read_bytes(), "alternatives").data
FIG_2 = {"starts": (20.0, 100.0, 300.0), "xi_b": 260.0}


@cache
def alternative(number: int) -> Drive:
    """The preset, or one of its alternatives, from 1."""
    drive = load_preset("vzp160")
    return drive.with_values(ALTERNATIVES[number - 1]) if number else drive


@cache
def scan(M_g: float, number: int = 0) -> PhaseScan:
    return phase_scan(alternative(number), M_g)


@cache
def own() -> dict[float, SelfError]:
    drive = load_preset("vzp160")
    return dict(zip(drive.operation.M_g, self_error(drive, drive.operation.M_g), strict=True))


@cache
def cycle(M_g: float, phase: float) -> KinematicError:
    return kinematic_error(changed(load_preset("vzp160"), phases__xi_b=phase), M_g, run=UNCHECKED)


def revolutions(drive: Drive, M_g: float, starts: Iterable[float]) -> list[KinematicError]:
    """One cam revolution from each of some starts, at the phase of Fig. 2."""
    drive = changed(drive, phases__xi_b=FIG_2["xi_b"])
    return [trace(drive, M_g, start_deg=start, run=UNCHECKED).error for start in starts]


def ratio(drive: Drive) -> float:
    """Greatest over least range within one cam revolution from the three starts of Fig. 2."""
    ranges = [error.range_arcsec for error in revolutions(drive, 80.0, FIG_2["starts"])]
    return max(ranges) / min(ranges)


@cache
def all_round(M_g: float) -> tuple[KinematicError, ...]:
    """Revolutions from a start every 10 deg."""
    return tuple(revolutions(load_preset("vzp160"), M_g, np.arange(0.0, 360.0, 10.0)))


def together(M_g: float) -> float:
    """Rank correlation of the range at a torque with the single-zone share at 80 N*m, over the starts."""
    ranges = [error.range_arcsec for error in all_round(M_g)]
    return float(spearmanr(ranges, [error.one_wave_share for error in all_round(80.0)]).statistic)


def apart(M_g: float) -> float:
    """Angle from the worst to the best phase [deg]."""
    found = scan(M_g)
    return abs((found.best_deg - found.worst_deg + 180) % 360 - 180)


def over_phase(M_g: float, get: str) -> Array:
    """Greatest or least F'_ior [arcsec] over the phase of each parameter set."""
    at = F_ior_over_sets()[:, TORQUES.index(M_g)]
    return np.asarray(at.max(axis=1) if get == "greatest" else at.min(axis=1))


def fig_3(M_g: float, get: str, value: float, number: int = 0) -> Case:
    return Case(
        f"{get} F'_ior, {M_g:g} N·m{words(number)}", "arcsec", "Fig. 3", **about(value, 0.05 * value),
        why=ROUNDED, kind=Kind.FITTED, value=lambda: getattr(scan(M_g, number), get), digits=".2f",
        slow=True, spread=None if number else lambda: span(over_phase(M_g, get)),
    )  # fmt: skip


def words(number: int) -> str:
    """What a row of an alternative is called after."""
    return f", alternative {number}" if number else ""


ROUNDED = "printed without decimals; read from a curve"
SAID = "'changes 2 to 3 times', three starts"
MISSED = "with Fig. 3 alone as a target Fig. 2 is larger than the paper's"
AT_THE_EDGE = "all five values of both figures are met, each near the end of its tolerance"
BARS = ((80.0, "greatest", 31), (80.0, "least", 15), (800.0, "greatest", 13), (800.0, "least", 2))
NEAREST = len(ALTERNATIVES)
CONTROL = (
    "a control: the range also depends on the start without single-zone meshing, so single-zone meshing "
    "may not be the cause"
)
CASES = [
    *(fig_3(*bar) for bar in BARS),
    *(fig_3(*bar, NEAREST) for bar in BARS),
    Case(
        "largest over smallest range in a revolution", "", "Fig. 2", 2, 3, why=f"{SAID}; {AT_THE_EDGE}",
        kind=Kind.FITTED, value=lambda: ratio(alternative(0)), digits=".2f",
    ),
    *(
        Case(
            f"self error, {M_g:g} N·m", "arcsec", "list of causes", 0.25, 2.00,
            why="the paper's range for such drives", kind=Kind.BOUND,
            value=lambda M_g=M_g: own()[M_g].range_arcsec, digits=".2f", slow=True,
        )
        for M_g in (80.0, 800.0)
    ),
    *(
        Case(
            f"largest over smallest range in a revolution{words(number)}", "", "Fig. 2", 2, 3, why=SAID,
            kind=Kind.PREDICTED, value=lambda number=number: ratio(alternative(number)), digits=".2f", miss=MISSED,
        )
        for number in range(1, NEAREST + 1)
    ),
    Case(
        "rank correlation of range and single-zone share", "",
        "Fig. 2 and its text", 0.9, 1, why="two unrelated quantities agree to this degree in one case of seven",
        kind=Kind.PREDICTED, value=lambda: together(80.0), digits=".3f",
    ),
    Case(
        "largest single-zone share, 240 N·m", "", "the model alone", 0, 0.01,
        why=CONTROL, kind=Kind.MODEL, value=lambda: max(error.one_wave_share for error in all_round(240.0)),
        digits=".2f",
    ),
    Case(
        "the same correlation, range at 240 N·m", "",
        "the model alone", 0.9, 1, why=CONTROL, kind=Kind.MODEL, value=lambda: together(240.0), digits=".3f",
    ),
    Case(
        "single-zone share, worst minus best phase", "",
        "text below Fig. 2", 0.05, np.inf,
        why="single-zone meshing increases the error: at least a twentieth of the cycle", kind=Kind.PREDICTED,
        value=lambda: cycle(80.0, scan(80.0).worst_deg).one_wave_share
        - cycle(80.0, scan(80.0).best_deg).one_wave_share,
        digits=".2f", slow=True,
    ),
    Case(
        "single-zone share, worst phase, 800 N·m", "", "Fig. 3", 0, 0.05,
        why="the load has taken up the deviations", kind=Kind.PREDICTED,
        value=lambda: cycle(800.0, scan(800.0).worst_deg).one_wave_share, digits=".2f", slow=True,
    ),
    *(
        Case(
            f"best from worst phase, {M_g:g} N·m", "deg", "the model alone", 120, 180,
            why="deviation and eccentricity add up or cancel, so the two phases are about opposite", kind=Kind.MODEL,
            value=lambda M_g=M_g: apart(M_g), digits=".0f", slow=True,
        )
        for M_g in (80.0, 800.0)
    ),
]  # fmt: skip


@pytest.mark.thorough
@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case):
    case.check()
