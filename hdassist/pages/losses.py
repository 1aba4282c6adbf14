"""Positions over samples of F'_ior, as a table, whiskers and JSON: of the belief, and after trials."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict

from hdassist.belief.statistics import Probability
from hdassist.error.self_error import limits_left
from hdassist.json_parts import Json
from hdassist.mounting.losses import PositionStatistics
from hdassist.mounting.positions import hole_words
from hdassist.preset.fields import Drive
from hdassist.report import Table
from hdassist.terminal.words import probability_words
from hdassist.verdict import SURE

LEVELS = {"expected": 0.5, "low": 0.05, "high": 0.95}  # quantiles
SHARES = ("probability_good", "expected_loss")  # of a position


def losses_table(
    found: PositionStatistics, holes: int, torques: Sequence[float], title: str, places: Iterable[int]
) -> Table:
    """Some of the positions, by their places: how sure each is good, its F'_ior at each torque, its loss."""
    heads = ("position", "good, %", "median", "5 %", "95 %", "loss, %")
    rows = []
    for place in places:
        spread = [beside(found.quantile(level, place), ".1f") for level in LEVELS.values()]
        good, loss = f"{100 * found.probability_good[place]:.0f}", f"{100 * found.expected_loss[place]:.1f}"
        rows.append((hole_words(found.rotations_deg[place], holes), good, *spread, loss))
    return Table(title, heads, tuple(rows), notes=(f"F'_ior in ″ at {beside(torques, 'g')} N·m",))


def whiskers_of(
    found: PositionStatistics | None, torque: int, per_deg: float
) -> tuple[tuple[float, float, float], ...]:
    """Of each position its place, in turns of per_deg, and 5th and 95th percentile of F'_ior [arcsec] at a torque."""
    if not found:
        return ()
    ends = (
        (found.quantile(LEVELS["low"], place)[torque], found.quantile(LEVELS["high"], place)[torque])
        for place in range(len(found.rotations_deg))
    )
    return tuple((at / per_deg, *end) for at, end in zip(found.rotations_deg, ends, strict=True))


def kept_line(
    rotation_deg: float,
    drive: Drive,
    torques: Sequence[float],
    kept: Callable[[int, float], Probability],
    sure: float = SURE,
) -> str:
    """How surely F'_ior with the self error keeps the preset's limits in a position, at each torque [N*m] that has one.

    Arguments: kept, probability that F'_ior there, at a torque by its place, is at most a room [arcsec]; sure, that
    which PASS needs.
    """
    where, words = hole_words(rotation_deg, drive.mounting.holes), []
    for k, (M_g, room) in enumerate(zip(torques, limits_left(drive, torques), strict=True)):
        if room is not None:
            held = f"{where} at {M_g:g} N·m: F'_ior + self error ≤ {drive.limit(M_g):g}″"
            words.append(f"{held}: {probability_words(kept(k, room), sure)}")
    return "; ".join(words)


def position_object(found: PositionStatistics, drive: Drive, cam_deg: float, place: int | None) -> Json:
    """A position, None: rotation 0, with F'_ior at each torque and how probably it is good or best.

    Argument: cam_deg, where the offset points that stands with the fixed wheel.
    """
    F_ior = {name: found.quantile(level, place) for name, level in LEVELS.items()}
    shares = {} if place is None else {name: getattr(found, name)[place] for name in SHARES}
    return {**asdict(found.position(drive, cam_deg, place)), "F_ior_arcsec": F_ior, **shares}


def positions_object(found: PositionStatistics, drive: Drive, cam_deg: float) -> Json:
    """The positions in their order, and how much worse the worst is than the best."""
    return {
        "positions": [position_object(found, drive, cam_deg, place) for place in range(len(found.rotations_deg))],
        "worst_over_best": [found.range_of(each)[::2] for each in found.ratios],
    }


def beside(values: Iterable[float], digits: str = ".2f") -> str:
    """Values at the torques that decide, side by side."""
    return " / ".join(format(value, digits) for value in values)
