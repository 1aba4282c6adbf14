"""What can be computed and is hardly meant: proportions that no drive has. Remarks, each with its number and source.

Each is a function whose arguments are named after the fields it needs, as in `rules`; lengths in mm, torques in N*m.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import pi

from hdassist.preset.fields import Drive, field_table

PAPER = "Lyuminarsky et al. (2019)"
SHELL = (0.25, 1.5)  # of the rim, thickness of the shell; by judgement around the paper's 1.0
RIM = (0.004, 0.02)  # of the pitch diameter, thickness of the rim; by judgement around the paper's 0.00875
WAVE = (1.0, 1.27)  # modules; half the difference of teeth is 1, and x_b - x_g = 0.2 more makes the paper's 1.2
FILLING = 0.5  # of the way round at the middle of the balls, least; vzp160 has 0.79
BALL = (0.04, 0.15)  # of the pitch diameter; vzp160 has 0.089
# N*m/mm^3, rated torque over d^3 of catalogue sizes 14 to 65, ratio 100: from size 14 of the standard series (7.8 N*m)
# to size 20 of the high-torque series (52 N*m); d = 2.54 mm a size
TORQUE_DENSITY = (1.7e-4, 4.0e-4)
SLACK = 1e-9  # of a bound: what rounding may take


@dataclass(frozen=True)
class Remark:
    """A proportion that is hardly meant: path of the field to look at, message with its number, what is usual."""

    path: str
    message: str
    usual: str


def remarks(drive: Drive) -> Iterator[Remark]:
    """What is hardly meant in a drive."""
    paths = {path.split(".")[1]: path for path in field_table()}
    for rule in RULES:
        values = [drive.value(paths[name]) for name in inspect.signature(rule).parameters]
        yield from rule(*values)


def shell_and_rim(h_1: float, h_3: float) -> Iterator[Remark]:
    """The shell is about as thick as the rim, or thinner."""
    if _outside(h_3 / h_1, SHELL):
        yield Remark(
            "flexspline.h_3", f"a shell of {h_3:g} mm behind a rim of {h_1:g} mm, {h_3 / h_1:.3g} times its thickness",
            f"usual: {_range(SHELL)} times, by judgement; 1.0 in {PAPER}",
        )  # fmt: skip


def rim_and_diameter(h_1: float, m: float, z_g: int) -> Iterator[Remark]:
    """The rim is thin against the wheel."""
    share = h_1 / (m * z_g)
    if _outside(share, RIM):
        yield Remark(
            "flexspline.h_1", f"a rim of {h_1:g} mm on a pitch diameter of {m * z_g:.4g} mm, {share:.2%} of it",
            f"usual: {RIM[0]:.1%} to {RIM[1]:.1%}, by judgement; 0.9% in {PAPER}",
        )  # fmt: skip


def wave_in_modules(W_0: float, m: float) -> Iterator[Remark]:
    """The wave takes the flexspline about one module out: half the difference of teeth, and somewhat more."""
    if _outside(W_0 / m, WAVE):
        yield Remark(
            "cam.W_0", f"a wave of {W_0:g} mm is {W_0 / m:.3g} modules",
            f"usual: {_range(WAVE)}, half the difference of teeth being 1; 1.2 in {PAPER}",
        )  # fmt: skip


def balls_and_race(d_ball: float | None, N: int, m: float, z_g: int, x_g: float, h_f: float, h_1: float, ring_h: float)\
        -> Iterator[Remark]:  # fmt: skip
    """The balls fill most of the bearing, and are neither beads nor rollers."""
    if d_ball is None:
        return
    d = m * z_g
    middle = m * (z_g + 2 * x_g - 2 * h_f) / 2 - h_1 - ring_h - d_ball / 2
    filling = N * d_ball / (2 * pi * middle) if middle > 0 else 1.0
    if _outside(d_ball / d, BALL):
        yield Remark(
            "bearing.d_ball", f"balls of {d_ball:g} mm on a pitch diameter of {d:.4g} mm, {d_ball / d:.1%} of it",
            f"usual: {BALL[0]:.0%} to {BALL[1]:.0%}, by judgement; 9% fits the 24 balls of {PAPER}",
        )  # fmt: skip
    elif filling < FILLING * (1 - SLACK):
        yield Remark(
            "bearing.N", f"{N} balls of {d_ball:g} mm fill {filling:.0%} of the way round",
            f"usual: {FILLING:.0%} and more, by judgement",
        )  # fmt: skip


def torque_and_size(M_g: Sequence[float], rated: float | None, m: float, z_g: int) -> Iterator[Remark]:
    """The torques are those of a drive of this size."""
    most, limit = max(map(abs, M_g)), TORQUE_DENSITY[1] * (m * z_g) ** 3
    whose = f"the highest of catalogues at {m * z_g:.4g} mm: 52 N*m for size 20, ratio 100, by d^3"
    if rated is not None and most > rated * (1 + SLACK):
        yield Remark(
            "operation.M_g", f"{most:g} N*m is {most / rated:.3g} times the rated torque",
            f"operation.rated: {rated:g} N*m",
        )  # fmt: skip
    elif rated is None and most > limit:
        yield Remark(
            "operation.M_g", f"{most:g} N*m is {most / limit:.3g} times what drives of this size are rated for",
            f"{limit:.3g} N*m, {whose}; give operation.rated where it is another",
        )  # fmt: skip
    if rated is not None and rated > limit * 1.01:
        yield Remark(
            "operation.rated", f"{rated:g} N*m is {rated / limit:.3g} times what drives of this size are rated for",
            f"{limit:.3g} N*m, {whose}",
        )  # fmt: skip


RULES: tuple[Callable[..., Iterator[Remark]], ...] = (
    shell_and_rim,
    rim_and_diameter,
    wave_in_modules,
    balls_and_race,
    torque_and_size,
)


def _outside(value: float, bounds: tuple[float, float]) -> bool:
    return not bounds[0] * (1 - SLACK) <= value <= bounds[1] * (1 + SLACK)


def _range(bounds: tuple[float, float]) -> str:
    return f"{bounds[0]:.3g} to {bounds[1]:.3g}"
