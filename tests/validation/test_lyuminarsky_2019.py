"""The paper that vzp160 follows: Lyuminarsky et al. 2019, doi 10.18698/0536-1044-2019-11-3-8."""

from collections.abc import Callable, Iterable
from functools import cache

import numpy as np
import pytest
from scipy.stats import spearmanr

from hdassist import Drive, kinematic_error, load_preset
from hdassist.calibration.quantities import REPORTING, PhaseScan, TargetQuantities
from hdassist.error.cycle import KinematicError
from hdassist.error.self_error import SelfError, self_error
from hdassist.error.trace import trace
from hdassist.model.geometry import Array
from hdassist.run.run import UNCHECKED
from tests.support import changed
from tests.validation.case import Case, Kind, about, parameters
from tests.validation.parameter_sets import TORQUES, F_ior_over_sets, span

TITLE = "Lyuminarsky, Lyuminarsky, Ivanov (2019)"
ABOUT = (
    "The drive of the paper, preset `vzp160`. What the paper does not print was identified from the four values of "
    "its Fig. 3, with coned flanks, within bounds and with the self error as a bound (`docs/vzp160.targets.yaml`): "
    "those rows are no evidence, and the ratio at 800 N·m is greater than nearly all sets within the bounds have. Held "
    "back were Fig. 2, what the text says of one-wave meshing, and the catalogue's stiffnesses below. The paper is a "
    "computation: what agrees with it agrees with another model."
)
FIG_2 = {"starts": (20.0, 100.0, 300.0), "xi_b": 260.0}


@cache
def scan(M_g: float) -> PhaseScan:
    return TargetQuantities(load_preset("vzp160"), REPORTING).scan(M_g)


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


def cleared(by: float) -> Drive:
    """The drive with its clearance changed [um]."""
    drive = load_preset("vzp160")
    return changed(drive, gears__j_n=drive.gears.j_n + by)


@cache
def all_round(M_g: float) -> tuple[KinematicError, ...]:
    """Revolutions from a start every 10 deg."""
    return tuple(revolutions(load_preset("vzp160"), M_g, np.arange(0.0, 360.0, 10.0)))


def together(M_g: float) -> float:
    """Rank correlation of the range at a torque with the one-wave share at 80 N*m, over the starts."""
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


def fig_3(quantity: str, M_g: float, value: float, get: str, miss: str = "") -> Case:
    return Case(
        quantity, "arcsec", "Fig. 3", **about(value, 0.05 * value), why=ROUNDED, kind=Kind.FITTED,
        value=lambda: getattr(scan(M_g), get), digits=".2f", miss=miss, slow=True,
        spread=lambda: span(over_phase(M_g, get)),
    )  # fmt: skip


def fig_2(changes: str, drive: Callable[[], Drive], why: str, miss: str = "") -> Case:
    return Case(
        f"greatest over least range within one cam revolution, 80 N·m{changes}", "", "Fig. 2 and the text below it",
        2, 3, why=why, kind=Kind.PREDICTED, value=lambda: ratio(drive()), digits=".2f", miss=miss,
    )  # fmt: skip


ROUNDED = "printed without decimals and read off a curve: 5 %"
THREE = "'changes 2 to 3 times', three starts"
MISSED = (
    "values that come near Fig. 3 make the three starts of Fig. 2 differ by a twentieth more than the upper end of "
    "what the paper says, and so do all sets that count as equal (3.1 to 3.2); nothing was fitted to it"
)
BLOCKED = (
    "greatest at 80 N·m and greatest at 800 N·m come out 2.7 apart, where the paper has 2.4 (2.6 would be within both "
    "tolerances). Closer flanks, softer balls and a stiffer cam support bring them together. In the set that comes "
    "nearest the flanks have no clearance, the least that is plausible, and the balls are the softest: 32.6, 15.1, "
    "12.1, 2.0 (7 % low); no set within the plausible ranges was found that meets all four. Whole flanks came to "
    "32.53, 14.00, 12.20 and 2.25"
)
HINGES = "as with the preset's own clearance"
UNDECIDED = "as with the preset's own values, and these come about as near to the targets of the fit"
CONTROL = (
    "a control: no one-wave meshing from any start, yet the range depends on the start as at 80 N·m. So the "
    "correlation agrees with the paper's explanation, but does not show that one-wave meshing is the cause"
)
CASES = [
    fig_3("greatest F'_ior over the phase, 80 N·m", 80.0, 31, "greatest"),
    fig_3("least F'_ior over the phase, 80 N·m", 80.0, 15, "least"),
    fig_3("greatest F'_ior over the phase, 800 N·m", 800.0, 13, "greatest", BLOCKED),
    fig_3("least F'_ior over the phase, 800 N·m", 800.0, 2, "least"),
    *(
        Case(
            f"greatest over least F'_ior, {M_g:g} N·m", "", "text below Fig. 3: lowered more than 2 times", 2, np.inf,
            why="follows from fitted values", kind=Kind.FITTED,
            value=lambda M_g=M_g: scan(M_g).greatest / scan(M_g).least, digits=".2f", slow=True,
            spread=lambda M_g=M_g: span(over_phase(M_g, "greatest") / over_phase(M_g, "least")),
        )
        for M_g in (80.0, 800.0)
    ),
    *(
        Case(
            f"self error, {M_g:g} N·m", "arcsec", "list of causes of the error: 0.25 to 2.00", 0.25, 2.00,
            why="the paper's range for such drives", kind=Kind.BOUND,
            value=lambda M_g=M_g: own()[M_g].range_arcsec, digits=".2f", slow=True,
        )
        for M_g in (80.0, 800.0)
    ),
    fig_2("", lambda: load_preset("vzp160"), THREE, MISSED),
    *(fig_2(f", j_n {by:+g} µm", lambda by=by: cleared(by), THREE, HINGES) for by in (-1.0, 1.0)),
    *(
        fig_2(
            f", alternative {number} of the preset", lambda values=values: load_preset("vzp160").with_values(values),
            THREE, UNDECIDED,
        )
        for number, values in enumerate(load_preset("vzp160").alternatives, 1)
    ),
    Case(
        "rank correlation of range and one-wave share, revolutions from 36 starts, 80 N·m", "",
        "Fig. 2 and the text below it: the range is larger from starts where one-wave meshing lasts longer", 0.9, 1,
        why="both rise and fall once over the start: 0.9 says that they do so less than about 25° apart, which two "
        "unrelated ones would do in one case of seven",
        kind=Kind.PREDICTED, value=lambda: together(80.0), digits=".3f",
    ),
    Case(
        "greatest one-wave share from these starts, 240 N·m", "", "the model alone", 0, 0.01,
        why=CONTROL, kind=Kind.MODEL, value=lambda: max(error.one_wave_share for error in all_round(240.0)),
        digits=".2f",
    ),
    Case(
        "rank correlation of the range at 240 N·m with the one-wave share at 80 N·m, from these starts", "",
        "the model alone", 0.9, 1, why=CONTROL, kind=Kind.MODEL, value=lambda: together(240.0), digits=".3f",
    ),
    Case(
        "one-wave share at the worst phase less that at the best, 80 N·m", "",
        "text below Fig. 2: one-wave meshing raises the error considerably", 0.05, 1,
        why="more of it where the error is greater, by a twentieth of the cycle at least", kind=Kind.PREDICTED,
        value=lambda: cycle(80.0, scan(80.0).worst_deg).one_wave_share
        - cycle(80.0, scan(80.0).best_deg).one_wave_share,
        digits=".2f", slow=True,
    ),
    Case(
        "one-wave share at 800 N·m, worst phase", "", "Fig. 3: the error is less at 800 N·m", 0, 0.05,
        why="both zones carry when the load has taken up the deviations", kind=Kind.PREDICTED,
        value=lambda: cycle(800.0, scan(800.0).worst_deg).one_wave_share, digits=".2f", slow=True,
    ),
    *(
        Case(
            f"angle between best and worst phase, {M_g:g} N·m", "deg", "the model alone", 120, 180,
            why="deviation and cam offset help or oppose each other: about opposite", kind=Kind.MODEL,
            value=lambda M_g=M_g: apart(M_g), digits=".0f", slow=True,
        )
        for M_g in (80.0, 800.0)
    ),
]  # fmt: skip


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case):
    case.check()
