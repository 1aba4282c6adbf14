"""The paper that vzp160 follows: Lyuminarsky et al. 2019, doi 10.18698/0536-1044-2019-11-3-8."""

from collections.abc import Iterable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import spearmanr

from hdassist import Drive, kinematic_error, load_preset
from hdassist.drive.error.cycle import KinematicError, SelfError, self_error
from hdassist.drive.error.waves import trace
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.text import read_yaml
from hdassist.features.calibration import PhaseScan, phase_scan
from hdassist.run.run import UNCHECKED
from tests.helpers.support import changed
from tests.validation.case import Case, Kind, about, parameters
from tests.validation.parameter_sets import TORQUES, F_ior_over_sets, span

TITLE = "Lyuminarsky, Lyuminarsky, Ivanov (2019)"
ABOUT = (
    "The preset `vzp160` describes the drive of this paper (doi 10.18698/0536-1044-2019-11-3-8). The paper prints the "
    "dimensions and tolerances of the drive, but not its stiffnesses and clearances. These values were fitted to two "
    "figures of the paper. Fig. 3 shows F'_ior as a function of the mounting phase of the circular spline. Fig. 2 "
    "shows the range of the error within one input revolution, for three starting angles. The self error was a bound "
    "of the fit (`docs/vzp160.targets.yaml`; `python -m benchmarks.identify`). The alternatives 1 to 3 are other sets "
    "of values, which were fitted to Fig. 3 alone. For the alternatives, Fig. 2 is therefore an independent "
    "comparison. The statements of the paper about single-zone meshing, and the catalogue stiffnesses of the next "
    "section, were not used in any fit.\n\nThe two figures together do not determine all fitted values. The "
    "undetermined values are given as samples in the `fit` section of the preset. As a check, the search for these "
    "values was repeated, starting from 568 drives spread over all bounds (effective sample size 130). The "
    "Kolmogorov-Smirnov test finds no significant difference between the two resulting distributions for any of the "
    "twelve values. The largest distance between the distributions is 0.16. By chance, a distance above 0.21 occurs "
    "in one of twenty cases. In the repeated search, F'_ior in hole 0 is 27.6″ (5th to 95th percentile 25.8 to 29.8″) "
    "at 80 N·m and 7.8″ at 800 N·m. In hole 8, F'_ior is 16.5″ (15.3 to 17.5″) at 80 N·m and 4.3″ at 800 N·m. Every "
    "set of values that agrees with Fig. 3 gives K1 of at least 72·10⁴ N·m/rad.\n\nSingle-zone meshing occurs if one "
    "of the two mesh zones carries less than 1 % of the torque. The single-zone share is the share of such mesh "
    "positions in an input revolution or in the mesh cycle.\n\nThe results of the paper are computed, so agreement "
    "with them is agreement with another model, not with a measurement."
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
        f"{NAMES[get]} F'_ior over the mounting phase, {M_g:g} N·m{words(number)}",
        "arcsec",
        "Fig. 3",
        **about(value, 0.05 * value),
        why=ROUNDED,
        kind=Kind.FITTED,
        value=lambda: getattr(scan(M_g, number), get),
        digits=".2f",
        slow=True,
        spread=None if number else lambda: span(over_phase(M_g, get)),
    )


def words(number: int) -> str:
    """What a row of an alternative is called after."""
    return f", alternative {number}" if number else ""


NAMES = {"greatest": "largest", "least": "smallest"}
ROUNDED = "The expected value was read from a curve. The paper states such values without decimals"
SAID = "The paper states that the range 'changes 2 to 3 times'. Fig. 2 shows three starting angles"
MISSED = "If the values are fitted to Fig. 3 alone, the ratio of the ranges is larger than the paper states"
AT_THE_EDGE = "The fit meets all five values of both figures, but each value is near the limit of its tolerance"
BARS = ((80.0, "greatest", 31), (80.0, "least", 15), (800.0, "greatest", 13), (800.0, "least", 2))
NEAREST = len(ALTERNATIVES)
CONTROL = (
    "These rows are a control for the predicted rank correlation. At 240 N·m there is no single-zone meshing, but the "
    "range still depends on the starting angle in the same way. Single-zone meshing is therefore not necessarily the "
    "cause of this dependence"
)
CASES = [
    *(fig_3(*bar) for bar in BARS),
    *(fig_3(*bar, NEAREST) for bar in BARS),
    Case(
        "ratio of the largest to the smallest range within one input revolution",
        "",
        "Fig. 2",
        2,
        3,
        why=f"{SAID}. {AT_THE_EDGE}",
        kind=Kind.FITTED,
        value=lambda: ratio(alternative(0)),
        digits=".2f",
    ),
    *(
        Case(
            f"self error, {M_g:g} N·m",
            "arcsec",
            "paper, list of causes of error",
            0.25,
            2.00,
            why="The paper states this range for drives of this kind",
            kind=Kind.BOUND,
            value=lambda M_g=M_g: own()[M_g].range_arcsec,
            digits=".2f",
            slow=True,
        )
        for M_g in (80.0, 800.0)
    ),
    *(
        Case(
            f"ratio of the largest to the smallest range within one input revolution{words(number)}",
            "",
            "Fig. 2",
            2,
            3,
            why=SAID,
            kind=Kind.PREDICTED,
            value=lambda number=number: ratio(alternative(number)),
            digits=".2f",
            miss=MISSED,
        )
        for number in range(1, NEAREST + 1)
    ),
    Case(
        "rank correlation between the range of the error and the single-zone share",
        "",
        "Fig. 2 and its description in the paper",
        0.9,
        1,
        why="Two independent quantities reach such a correlation by chance in one of seven cases",
        kind=Kind.PREDICTED,
        value=lambda: together(80.0),
        digits=".3f",
    ),
    Case(
        "largest single-zone share, 240 N·m",
        "",
        "no external source",
        0,
        0.01,
        why=CONTROL,
        kind=Kind.MODEL,
        value=lambda: max(error.one_wave_share for error in all_round(240.0)),
        digits=".2f",
    ),
    Case(
        "rank correlation between the range at 240 N·m and the single-zone share at 80 N·m",
        "",
        "no external source",
        0.9,
        1,
        why=CONTROL,
        kind=Kind.MODEL,
        value=lambda: together(240.0),
        digits=".3f",
    ),
    Case(
        "single-zone share in the worst mounting phase, minus that in the best phase",
        "",
        "text of the paper below Fig. 2",
        0.05,
        np.inf,
        why="The paper states that single-zone meshing increases the error. The row requires a difference of at "
        "least a twentieth of the mesh positions",
        kind=Kind.PREDICTED,
        value=lambda: (
            cycle(80.0, scan(80.0).worst_deg).one_wave_share - cycle(80.0, scan(80.0).best_deg).one_wave_share
        ),
        digits=".2f",
        slow=True,
    ),
    Case(
        "single-zone share in the worst mounting phase, 800 N·m",
        "",
        "Fig. 3",
        0,
        0.05,
        why="At this torque the elastic deflection exceeds the deviations, so both mesh zones carry load",
        kind=Kind.PREDICTED,
        value=lambda: cycle(800.0, scan(800.0).worst_deg).one_wave_share,
        digits=".2f",
        slow=True,
    ),
    *(
        Case(
            f"angle from the worst to the best mounting phase, {M_g:g} N·m",
            "deg",
            "no external source",
            120,
            180,
            why="The effects of the wheel deviation and of the eccentricity add up in the worst phase and partly "
            "cancel in the best phase, so the two phases are nearly opposite",
            kind=Kind.MODEL,
            value=lambda M_g=M_g: apart(M_g),
            digits=".0f",
            slow=True,
        )
        for M_g in (80.0, 800.0)
    ),
]


@pytest.mark.thorough
@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case):
    case.check()
