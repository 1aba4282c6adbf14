"""Knowledge of strain wave drives in general: laws of growth, plausible bounds, proportions, greatest deviations.

Lengths grow with the pitch diameter d, the module is d over the teeth, the wave and the clearance of the teeth keep
their size in modules, stiffnesses grow with d and compliances with 1/d (one modulus of elasticity), torques with d^3.
Tolerances do not scale like that: they follow ISO 1328-1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import pi, sqrt

from hdassist.preset.fields import Drive

REFERENCE = 160.0  # mm, pitch diameter at which the ranges below are stated
REFERENCE_MODULE = 0.8  # mm, of the bounds that are in modules
# N*m/rad at the reference: K3 of catalogue sizes 20 to 65, ratio 80 and more, by d^3, is this to 3 %; of 17 and
# 14 it is 10 and 28 % less
CATALOGUE_K3 = 9.0e5
# N*m/mm^3, rated torque over d^3 of catalogue sizes 14 to 65, ratio 100: from size 14 of the standard series (7.8 N*m)
# to size 20 of the high-torque series (52 N*m); d = 2.54 mm a size
TORQUE_DENSITY = (1.7e-4, 4.0e-4)
PAPER = "Lyuminarsky et al. (2019)"
BOUND_ROUNDING = 1e-9  # of a bound
WAVE = (1.0, 1.27)  # modules, cam.W_0
# Greatest deviations where a preset does not give them. F'_i: F_p of this class of ISO 1328-1:2013, the coarsest teeth
# that a drive is taken to have; those of the paper are there
COARSEST_CLASS = 9
# um for each mm of the pitch diameter, cam offsets: 80 and 30 um at 160 mm in the paper; a wheel's centre: assumed,
# 10 um at 160 mm
STANDING_OFFSET, TURNING_OFFSET, CENTRE_OFFSET = 0.5, 0.2, 0.06
# of half of F'_i, amplitudes of order 2 and of orders 3 and 4; assumed: twice as much breaks the accuracy that
# catalogues promise of size 20, half as much makes the one recorded drive one in a hundred (docs/validation.md)
SECOND_ORDER, HIGHER_ORDERS = 0.08, 0.04
# by cam.coupling: stiffness of the cam's support and its plausible range [N/mm] at the reference diameter, with which
# they grow, and why
CAM_SUPPORTS = {
    "unknown": (1e4, 1e3, 1e5, "the middle of a range from a compliant to a solid hub"),
    "solid": (4.5e4, 2e4, 1e5, "a solid hub on a stiff shaft; by judgement"),
    # the cam's 8 N*m at 15 mm press the slides by 530 N: friction of 0.08 of that over an offset of 80 um is 500 N/mm
    "oldham": (0.0, 0.0, 500.0, "self-aligning; what friction of its slides adds is a guess"),
}
# N/mm for each mm of its bore: radial stiffness of the bearing of a shaft with an overhung cam, and its range; a guess
SHAFT_BEARING = (5e3, 2e3, 1e4)


def F_p(d: float, m: float, accuracy: int) -> float:
    """Total cumulative pitch deviation [um] by ISO 1328-1:2013, of a pitch diameter and module [mm] and a class."""
    return float((0.002 * d + 0.55 * d**0.5 + 0.7 * m + 12) * 2 ** ((accuracy - 5) / 2))


def growth(by: str, d: float, m: float) -> float:
    """Factor on a field by its law where the pitch diameter is d times, and the module m times as large."""
    return {"same": 1.0, "d": d, "1/d": 1 / d, "sqrt d": sqrt(d), "m": m}[by]


@dataclass(frozen=True)
class Law:
    """Law by which a field grows with the drive, and its plausible bounds.

    by: "same", "d" (length or stiffness), "1/d" (compliance), "sqrt d", "m" (in modules); bounds: in the unit of the
    field at a pitch diameter of 160 mm and a module of 0.8 mm, or, with of_value, as shares of the value; why, the
    reason of the bounds; least: value of the upper one at least; assumed: whether the default of a preset that leaves
    the field out has these bounds too.
    """

    by: str
    bounds: tuple[float, float] | None = None
    why: str = ""
    of_value: bool = False
    least: float = 0.0
    assumed: bool = False

    def range_at(self, d: float, m: float, value: float) -> tuple[float, float] | None:
        """Plausible range of a field, which includes its value, at a pitch diameter d and a module m [mm]."""
        if self.bounds is None:
            return None
        scale = value if self.of_value else growth(self.by, d / REFERENCE, m / REFERENCE_MODULE)
        return min(self.bounds[0] * scale, value), max(self.bounds[1] * scale, self.least, value)


JUDGED = "range by judgement"
LAWS: dict[str, Law] = {
    "gears.alpha": Law("same"),
    "gears.h_a": Law("same", (0.5, 0.7), "tips of short teeth come free", assumed=True),
    "gears.h_f": Law("same", (1.25, 1.35), "usual basic racks", assumed=True),
    "gears.j_n": Law("m", (0.0, 20.0), "tooth thinning, no drawing says it", least=10.0, assumed=True),
    "material.E": Law("same", (2.0e5, 2.12e5), f"steel; {JUDGED}"),
    "material.nu": Law("same", (0.27, 0.31), f"steel; {JUDGED}"),
    "material.alpha_T": Law("same"),
    "flexspline.h_1": Law("d", (0.8, 1.25), JUDGED, of_value=True),
    "flexspline.h_3": Law("d", (0.6, 1.1), JUDGED, of_value=True),
    "flexspline.b_w": Law("d", (0.6, 1.1), JUDGED, of_value=True),
    "flexspline.l": Law("d", (0.45, 1.05), f"short cups are half as long; {JUDGED}", of_value=True),
    "flexspline.k_t": Law("same", (1.0, 1.8), "teeth stiffen the rim; no source found", assumed=True),
    "bearing.N": Law("same"),
    "bearing.ring_b": Law("d", (20.0, 28.0), f"no table found; {JUDGED}"),
    "bearing.ring_h": Law("d", (3.8, 5.0), "no table found; thinner rings have a larger self error"),
    "bearing.d_ball": Law("d", (12.5, 16.0), f"used with rolling balls only; {JUDGED}"),
    "bearing.g_b": Law("sqrt d", (0.0, 20.0), JUDGED, assumed=True),
    "bearing.ball_motion": Law("same"),
    "bearing.beta": Law("same", (0.0, 1.0), "any ball phase"),
    "cam.W_0": Law(
        "m", (WAVE[0] * REFERENCE_MODULE, WAVE[1] * REFERENCE_MODULE), "1.00 to 1.27 modules; no catalogue prints it"
    ),
    "cam.coupling": Law("same"),
    "cam.shaft_d": Law("d"),
    "cam.overhang": Law("d"),
    "supports.C_1": Law("d", (2e5, 2e7), "seat in the housing"),
    "supports.C_2": Law("d", (5e3, 1e5), "shell in series with its output support"),
    "supports.C_3": Law("d", (1e3, 1e5), "cam on its shaft"),
    "contact.c_t": Law("1/d", (0.3e-5, 6e-5), "the face width works near one edge only", assumed=True),
    "contact.k_face": Law("same", (6.8, 10.0), "of a tooth pair, by width", assumed=True),
    "contact.c_ball": Law(
        "1/d", (1.25e-5, 2.857e-5), "ISO/TS 16281 ball, tangent at 100-1000 N at 160 mm", assumed=True
    ),
    "contact.c_bore": Law("1/d", (2e-8, 5e-7), f"conformal seat; {JUDGED}"),
    "operation.dT": Law(
        "same", (-5.0, 15.0), f"the cam and flexspline of a running drive are warm; {JUDGED}", assumed=True
    ),
}


@dataclass(frozen=True)
class Proportion:
    """Usual proportion of a field to another measure of the drive.

    path of the field; base: the measure; low, high: usual share of it; words: the proportion in words, of value, base
    and share; usual: the usual shares in words, of low and high, with their source.
    """

    path: str
    base: Callable[[Drive], float]
    low: float
    high: float
    words: str
    usual: str


def _balls_around(drive: Drive) -> float:
    """Number of balls that fill the circle of their centres; 0 where their diameter is not given."""
    ball = drive.bearing.d_ball or 0.0
    radius = drive.gears.root_radius - drive.flexspline.h_1 - drive.bearing.ring_h - ball / 2
    return max(2 * pi * radius, 0.0) / ball if ball else 0.0


PROPORTIONS = (
    Proportion(
        "flexspline.h_3", lambda drive: drive.flexspline.h_1, 0.25, 1.5,
        "a shell of {value:g} mm behind a rim of {base:g} mm, {share:.3g} times its thickness",
        f"{{low:.3g}} to {{high:.3g}} times, by judgement; 1.0 in {PAPER}",
    ),
    Proportion(
        "flexspline.h_1", lambda drive: drive.gears.pitch_diameter, 0.004, 0.02,
        "a rim of {value:g} mm on a pitch diameter of {base:.4g} mm, {share:.2%} of it",
        f"{{low:.1%}} to {{high:.1%}}, by judgement; 0.9% in {PAPER}",
    ),
    Proportion(
        "cam.W_0", lambda drive: drive.gears.m, *WAVE, "a wave of {value:g} mm is {share:.3g} modules",
        f"{{low:.3g}} to {{high:.3g}}, half the difference of teeth being 1; 1.2 in {PAPER}",
    ),
    Proportion(
        "bearing.d_ball", lambda drive: drive.gears.pitch_diameter, 0.04, 0.15,
        "balls of {value:g} mm on a pitch diameter of {base:.4g} mm, {share:.1%} of it",
        f"{{low:.0%}} to {{high:.0%}}, by judgement; 9% fits the 24 balls of {PAPER}",
    ),
    Proportion(
        "bearing.N", _balls_around, 0.5, 1.2, "{value} balls of {ball:g} mm fill {share:.0%} of the way round",
        "{low:.0%} and more, by judgement",
    ),
)  # fmt: skip


def implausible(drive: Drive) -> Iterator[tuple[str, str, str]]:
    """Valid fields of a drive that are far from usual: path, message with the number, usual range."""
    for each in PROPORTIONS:
        value, base = drive.value(each.path), each.base(drive)
        share = value / base if value and base else None
        if share is not None and not each.low * (1 - BOUND_ROUNDING) <= share <= each.high * (1 + BOUND_ROUNDING):
            words = each.words.format(value=value, base=base, share=share, ball=drive.bearing.d_ball)
            yield each.path, words, f"usual: {each.usual.format(low=each.low, high=each.high)}"
    yield from _implausible_torques(drive)


def _implausible_torques(drive: Drive) -> Iterator[tuple[str, str, str]]:
    """Torques beyond those of a drive of this size."""
    most, rated, d = max(map(abs, drive.operation.M_g)), drive.operation.rated, drive.gears.pitch_diameter
    limit = TORQUE_DENSITY[1] * d**3
    usual = f"{limit:.3g} N*m, the highest of catalogues at {d:.4g} mm: 52 N*m for size 20, ratio 100, by d^3"
    beyond = "times what drives of this size are rated for"
    if rated is None and most > limit:
        words = f"{most:g} N*m is {most / limit:.3g} {beyond}"
        yield "operation.M_g", words, f"{usual}; give operation.rated where it is another"
    if rated is not None and most > rated * (1 + BOUND_ROUNDING):
        words = f"{most:g} N*m is {most / rated:.3g} times the rated torque"
        yield "operation.M_g", words, f"operation.rated: {rated:g} N*m"
    if rated is not None and rated > limit * 1.01:
        yield "operation.rated", f"{rated:g} N*m is {rated / limit:.3g} {beyond}", usual
