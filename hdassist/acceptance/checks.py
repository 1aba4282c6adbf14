"""The named checks of an acceptance, and the remarks beside them, declared once.

Names of limits, columns of lots, reports, `hdassist explain`, the docs and the tests read these declarations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from hdassist.preset.fields import Acceptance
from hdassist.preset.kinds import FieldKind, kind_of, unit_of

if TYPE_CHECKING:  # heavy, and `hdassist explain` needs none of it
    from hdassist.acceptance.predictions import PredictedQuantities
    from hdassist.measuring.measure import SweepResult

Need = Literal["cycle", "self error", "stiffness"]
Extent = Literal["whole", "at least", "part", "not known"]


@dataclass(frozen=True)
class Explained:
    """An entry with a code: its name, its test, the fault, and its remedy."""

    code: str
    words: str
    tests: str
    wrong: str
    change: str


@dataclass(frozen=True)
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
    needs: tuple[Need, ...]
    predicted: Callable[[PredictedQuantities, float, float], float] | None = None
    measured: Callable[[SweepResult, float], tuple[float, float, float] | None] | None = None
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


F_IOR = Check(
    "F_IOR",
    "F'_ior",
    "The greatest minus the least error of the output angle over the full cycle, at constant torque, turning one way; "
    "predicted with the self error on top.",
    "The output is not where the cam says: the catalogue's transmission accuracy is missed. Pitch deviations of both "
    "wheels and the offsets of the cam stand unluckily to each other, or are too large for this wave and clearance.",
    "Turn the fixed wheel (hdassist mount): it costs nothing. Then the tolerance that moves F'_ior most "
    "(hdassist compare tells which deviation explains a measured one), the clearance j_n, the wave W_0.",
    "F_ior",
    ("cycle", "self error"),
    lambda of, M_g, _: of.errors[M_g].F_ior_arcsec + of.self_errors[M_g].range_arcsec,
    lambda found, _: (found.range.value, found.uncertainty_arcsec, found.rise_arcsec),
)
TURN_RANGE = Check(
    "TURN_RANGE",
    "range in one cam turn",
    "The greatest range of the error within any one turn of the cam: what a drive shows that moves little.",
    "Offsets of the cam and second orders of the pitch deviations make the output swing in each turn of the cam.",
    "Less offset of the cam (seat, bearing, bore), more evenly worn or better centred wheels, more teeth in mesh.",
    "turn_range",
    ("cycle",),
    lambda of, M_g, _: of.turn_range(M_g),
    lambda of, _: (of.revolution.value, of.revolution_uncertainty_arcsec, of.revolution_rise_arcsec),
)
ORDER_CHECK = Check(
    "ORDER",
    "amplitude of an order",
    "The amplitude of one order of the error per turn of the cam, over the whole cycle.",
    "One cause stands out: order 2 of the cam excites the drive at twice its speed, low orders are the wheels'.",
    "hdassist trace names the cause of each order; change the deviation it names.",
    "order_amplitude",
    ("cycle",),
    lambda of, M_g, order: of.amplitude(M_g, order),
    _amplitude,
    of_part="part",
)
SELF_ERROR = Check(
    "SELF_ERROR",
    "self error",
    "The error that the drive would have without any deviation, over tooth and ball phase.",
    "The teeth and balls carry the load unevenly by design: no tolerance and no mounting angle makes it less.",
    "The design: number of balls, ring stiffness, wave, tooth height, so that more teeth share the load.",
    "self_error",
    ("self error",),
    lambda of, M_g, _: of.self_errors[M_g].range_arcsec,
)
LOST_MOTION_CHECK = Check(
    "LOST_MOTION",
    "lost motion",
    "The twist between plus and minus 4 % of the rated torque.",
    "The output is loose around zero torque: clearance of flanks and bearing is taken up before the teeth carry.",
    "Less clearance j_n or g_b, a larger wave W_0, a stiffer ring.",
    "lost_motion",
    ("stiffness",),
    lambda of, *_: of.twist.lost_motion_arcsec,
)
STIFFNESSES = K1, K2, K3 = tuple(
    Check(
        f"K_{k}",
        f"torsional stiffness K_{k}",
        f"The stiffness of the {which} segment of the twist over torque, the shell's tube included.",
        "The output yields more under load than the axis allows: resonances fall, positions wander with torque.",
        "A stiffer shell or ring, more teeth in mesh (wave, clearance), larger balls or more of them.",
        f"K_{k}",
        ("stiffness",),
        lambda of, *_, k=k: of.twist.weaker(k),  # the limit is the least
        upper=False,
    )
    for k, which in ((1, "first"), (2, "second"), (3, "third"))
)
SECOND_HAND = (
    "As makers put it, second hand: conformity to no standard is claimed. hdassist measure has it of a file of "
)
STATED_CHECKS = tuple(  # of figures that makers state
    Check(code, words, tests, wrong, change, code.lower(), (), upper=code != "RATCHET_TORQUE")
    for code, words, tests, wrong, change in (
        (
            "POSITIONING",
            "positioning one way",
            "The greatest less the least mean deviation of positions that are approached from one side; 12 "
            "positions 30° apart are usual and see a part of F'_ior only (hdassist plan). "
            + SECOND_HAND
            + "approached positions.",
            "The output stands off the commanded angle, by another amount at each position.",
            "What makes F'_ior less: hdassist mount, the pitch deviations, the cam's offsets.",
        ),
        (
            "REPEATABILITY",
            "repeatability",
            "Plus and minus half the spread of the deviation at one position, approached again from the same side, "
            "7 times as is usual; the greatest of all positions. " + SECOND_HAND + "approached positions.",
            "The same command ends at another angle each time: friction, temperature, the control.",
            "Lubrication and warming up; the approach slower; the motor's encoder and its control.",
        ),
        (
            "BIDIRECTIONAL",
            "repeatability from both sides",
            "Plus and minus half the spread of the deviation at one position, approached from either side; the "
            "greatest of all positions. " + SECOND_HAND + "positions approached from both sides.",
            "Where the output stops hangs on the way it came: hysteresis and friction.",
            "Always approach from one side; less friction, less clearance.",
        ),
        (
            "HYSTERESIS_LOSS",
            "hysteresis loss",
            "The twist that is left at no torque between the branches of a loop from -T_0 to T_0 and back, the cam "
            "held, T_0 the rated torque; the greatest of all places. " + SECOND_HAND + "torque loops.",
            "The output does not come back after a load: friction in mesh, bearing and seats.",
            "Lubrication, the preload of mesh and bearing, bolted joints that do not slip.",
        ),
        (
            "STARTING_TORQUE",
            "starting torque",
            "The torque at the cam that sets the unloaded drive going, as a maker states it: a value to be given.",
            "Friction at rest: small moves stick and slip, and the motor heats.",
            "Lubrication, clearance, temperature.",
        ),
        (
            "BACKDRIVE_TORQUE",
            "back-driving torque",
            "The torque at the output that turns the cam, as a maker states it: a value to be given.",
            "The axis cannot be moved from the output, or moves where it should hold.",
            "Lubrication, clearance, temperature; a brake where it has to hold.",
        ),
        (
            "RATCHET_TORQUE",
            "ratcheting torque",
            "The torque at the output at which teeth jump over, as a maker states it: a value to be given.",
            "Teeth that have jumped leave the mesh off its centre, and it wears out.",
            "A stiffer housing and rim, more wave; less shock.",
        ),
    )
)
CHECKS = (F_IOR, TURN_RANGE, SELF_ERROR, ORDER_CHECK, LOST_MOTION_CHECK, *STATED_CHECKS, *STIFFNESSES)

# remarks that a verdict should not be read without
COVERAGE = Explained(
    "COVERAGE",
    "part of the cycle only",
    "Whether the record visited the full cycle of cam and output.",
    "A part of the cycle bounds F'_ior from below: it can fail a drive, never pass it.",
    "Record the full cycle in one direction: one turn of the output, two where the flexspline has an odd number of "
    "teeth.",
)
UNCERTAINTY = Explained(
    "UNCERTAINTY",
    "uncertain beside its limit",
    "Whether the expanded uncertainty of a measured value is at most a quarter of its limit.",
    "Guard bands eat the tolerance: good drives come out INCONCLUSIVE, and a simple rule passes bad ones.",
    "A longer or quieter record, repeated runs; less uncertainty of encoder and coupling.",
)
BUDGET = Explained(
    "BUDGET",
    "uncertainty not stated",
    "Whether every source of uncertainty that a record cannot tell has been stated.",
    "Encoder, coupling, reseating or temperature may be as large as the error that is decided on.",
    "State them: --budget encoder=0.3 and so on, 0 where a source is known to be nothing; the guard rule "
    "passes nothing without.",
)
LINES_CHECK = Explained(
    "LINES",
    "lines off the orders",
    "Whether the record has lines that are none of the declared orders: a ball pass, a cage, the rig.",
    "They are in the value as the record has them; in another cycle they stand otherwise to the drive's own error and "
    "may make it greater, for which the guard rule keeps room.",
    "Find what turns at that order and mend it; --orders takes it in where it belongs to the cam or the teeth.",
)
RECORD = Explained(
    "RECORD",
    "the record is not clean",
    "Whether the record drifts, or has error beyond the declared orders.",
    "What is left in adds to the uncertainty, or to the value itself.",
    "--drift linear, or more --orders; hdassist measure shows both.",
)
RATED = Explained(
    "RATED",
    "above the rated torque",
    "Whether the torque of a check is within the rated torque.",
    "The model is compared with tests up to the rated torque only; teeth may ratchet beyond.",
    "Test at or below operation.rated.",
)
UNKNOWN_REMARK = Explained(
    "UNKNOWN",
    "deviations that are not known",
    "Whether the preset gives every deviation, phase and harmonic that a prediction depends on.",
    "What is not given may be anything up to what its part may have: it is drawn, and a prediction passes where it "
    "keeps the limit with 95 % probability, and fails where with 5 % at most.",
    "Give it in the preset, 0 where it is known to be none; or measure the drive.",
)
NOT_TESTED = Explained(
    "NOT_TESTED",
    "limits not tested",
    "Whether each limit of the preset was decided on.",
    "The verdict says nothing of limits that were left out.",
    "Measure them too, or leave out --measured-only: then the model predicts them.",
)
REMARKS = (COVERAGE, UNCERTAINTY, BUDGET, LINES_CHECK, RECORD, RATED, UNKNOWN_REMARK, NOT_TESTED)
CODES: dict[str, Explained] = {item.code: item for item in (*CHECKS, *REMARKS)}
