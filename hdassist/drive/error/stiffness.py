"""Torsional stiffness of a drive without deviations: twist against torque, lost motion, K1, K2 and K3.

The twist is the sum of two parts in series: mesh and rings (the contact model), and the shell as a tube. Without
friction the curves for increasing and decreasing torque coincide, so there is no hysteresis loop.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter

from hdassist.drive.error.cycle import WITHOUT_EFFECT
from hdassist.drive.model.contacts import contact_system, shell_twist_stiffness
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Catalogue, Drive
from hdassist.drive.solve.answers import ARCSEC, N_MM, Certificate
from hdassist.drive.solve.formulation import Formulation, formulate
from hdassist.drive.solve.loadcase import CrossCheck, LoadCase, solve_again, solvers_depend_on
from hdassist.drive.solve.walk import digits_depend_on
from hdassist.run.errors import UsageError
from hdassist.run.kept import Number, kept_answer
from hdassist.run.run import Progress, Run

LOST_MOTION_SHARE = 0.04  # share of the rated torque, to each side, at which catalogues measure lost motion
# share of the rated torque that closes the backlash; its elastic twist is only some thousandths of an arcsec
NEAR_ZERO = 1e-5
# Catalogue ends of the first and second segment [N*m] at a pitch diameter of 147.32 mm (size 58, 2.54 mm per unit of
# size). Size 65 has 235 and 843, which agrees with the cube of the diameter to 1 %.
_T_58 = (168.0, 598.0)
_D_58 = 147.32
_CURVE_BEYOND = 1.5  # default end of the curve, as a multiple of T_2
_CURVE_POINTS = 40  # default number of torques to each side


@dataclass(frozen=True)
class Segment:
    """Chord of the curve between two torques [N*m] on one side, with its stiffness [N*m/rad]."""

    start: float
    end: float
    stiffness: float


@dataclass(frozen=True)
class Stiffness:
    """Twist of a drive over torques.

    torque: torques [N*m], shape (points,), ascending, without 0.
    contact_arcsec: twist of mesh and rings [arcsec], shape (points,).
    tube_arcsec: twist of the shell [arcsec], shape (points,).
    rated: rated torque [N*m].
    positive, negative: segments K1, K2, K3 on each side, as far as the curve reaches them.
    """

    torque: Array
    contact_arcsec: Array
    tube_arcsec: Array
    rated: float
    positive: tuple[Segment, ...]
    negative: tuple[Segment, ...]
    certificate: Certificate
    cross_check: CrossCheck | None

    @property
    def twist_arcsec(self) -> Array:
        """Twist of the output relative to the fixed wheel with the wave generator locked [arcsec]."""
        return self.contact_arcsec + self.tube_arcsec

    def weaker(self, segment: int) -> float:
        """Return the stiffness of a segment [N*m/rad] on the side where it is smaller.

        segment: number of the segment, 1 for K_1.
        """
        return min(side[segment - 1].stiffness for side in (self.positive, self.negative))

    def twist_at(self, torque: float) -> float:
        """Return the twist [arcsec] at one of the torques of the curve [N*m]."""
        return float(self.twist_arcsec[int(np.argmin(np.abs(self.torque - torque)))])

    @property
    def lost_motion_arcsec(self) -> float:
        """Twist between plus and minus 4 % of the rated torque [arcsec]."""
        return self.twist_at(LOST_MOTION_SHARE * self.rated) - self.twist_at(-LOST_MOTION_SHARE * self.rated)

    @property
    def play_arcsec(self) -> float:
        """Twist between the smallest torques on both sides [arcsec], which is the backlash due to clearances."""
        return self.twist_at(NEAR_ZERO * self.rated) - self.twist_at(-NEAR_ZERO * self.rated)


def catalogue_torques(drive: Drive) -> tuple[float, float]:
    """Return the ends T_1 and T_2 of the segments [N*m] according to the catalogue.

    If the preset gives only one of them, the other follows from the ratio that catalogues have. If it gives neither,
    both follow from catalogue values by the cube of the drive's pitch diameter.
    """
    torques = drive.catalogue.T_1, drive.catalogue.T_2
    # both ends have the same scale factor if the catalogue states only one of them
    scales = [T / T_size for T, T_size in zip(torques, _T_58, strict=True) if T is not None]
    scale = scales[0] if scales else (drive.gears.pitch_diameter / _D_58) ** 3
    T_1, T_2 = (scale * T_size if T is None else T for T, T_size in zip(torques, _T_58, strict=True))
    return T_1, T_2


def stiffness_states() -> int:
    """Return the approximate number of states solved for a stiffness curve, for the progress bar."""
    return 2 * _CURVE_POINTS + 10


def stiffness(
    drive: Drive,
    *,
    T_1: float | None = None,
    T_2: float | None = None,
    T_max: float | None = None,
    points: int = _CURVE_POINTS,
    formulation: Formulation | None = None,
    run: Run = Run(),
) -> Stiffness:
    """Return the twist of a drive without deviations over torques to both sides.

    The tooth phase is 0 and the ball phase that of the preset.

    Args:
        drive: the drive.
        T_1: end of the first segment [N*m]; by default the catalogue value for the size.
        T_2: end of the second segment [N*m]; by default the catalogue value for the size.
        T_max: end of the curve [N*m]; 1.5 T_2 by default.
        points: number of torques to each side, in addition to the ends of segments.
        formulation: programme of the contact system, if it already exists.
        run: its cross-check solves the smallest and the largest torque on both sides again.

    Raises UsageError for torques that are too small, not finite or in the wrong order, UntrustedError if a result
    cannot be trusted.
    """
    rated = drive.rated_torque
    ends = _segment_ends(drive, T_1, T_2, T_max)
    # all torques of the results are nodes of the curve, so none is interpolated
    side = np.unique([*ends.torques, LOST_MOTION_SHARE * rated, *np.linspace(0, ends.T_max, points + 1)[1:]])
    # ascending from one side to the other, so that contacts change step by step
    torque = np.concatenate([-side[::-1], side])
    contact, tube, certificate, cross_check = _kept_twists(drive, torque, ends, formulation, run)
    contact_arcsec = np.array(contact)
    tube_arcsec = np.array(tube)
    # floats are safe as keys, because the ends of the segments are taken from the same array
    twist_of = dict(
        zip(
            torque.tolist(),
            (contact_arcsec + tube_arcsec).tolist(),
            strict=True,
        )
    )
    return Stiffness(
        torque=torque,
        contact_arcsec=contact_arcsec,
        tube_arcsec=tube_arcsec,
        rated=rated,
        positive=_segments(ends, twist_of, +1),
        negative=_segments(ends, twist_of, -1),
        certificate=certificate,
        cross_check=cross_check,
    )


@dataclass(frozen=True)
class _SegmentEnds:
    """Torques that end the segments of a curve on one side [N*m]."""

    # smallest torque, which closes the backlash, then the ends of the segments within the curve
    torques: tuple[float, ...]
    T_max: float  # end of the curve

    @property
    def smallest(self) -> float:
        """Smallest torque [N*m]."""
        return self.torques[0]


def _segment_ends(
    drive: Drive,
    T_1: float | None,
    T_2: float | None,
    T_max: float | None,
) -> _SegmentEnds:
    """Return the ends of the segments of a curve; the arguments are those of `stiffness`.

    Raises UsageError for torques that are too small, not finite or in the wrong order.
    """
    default_1, default_2 = catalogue_torques(drive)
    T_1 = default_1 if T_1 is None else T_1
    T_2 = default_2 if T_2 is None else T_2
    T_max = _CURVE_BEYOND * T_2 if T_max is None else T_max
    # at 0 N*m the contacts are undetermined within the backlash
    smallest = NEAR_ZERO * drive.rated_torque
    hint = f"use a finite torque above {smallest:g} N*m, 1e-5 of the rated torque"
    # the comparison also rejects NaN
    for name, value in (("T_1", T_1), ("T_2", T_2), ("the end of the curve", T_max)):
        if not smallest < value < np.inf:
            raise UsageError(f"invalid {name}: {value:g} N*m", hint)
    if not T_1 < T_2:
        raise UsageError(
            f"T_1 ({T_1:g} N*m) must be below T_2 ({T_2:g} N*m)",
            f"state both --t1 and --t2; their defaults are {default_1:.4g} and {default_2:.4g} N*m",
        )
    torques = [smallest]
    torques += [T for T in (T_1, T_2) if T_max >= T]  # the segment in which the curve ends does not count
    if T_max > T_2:
        torques.append(T_max)
    return _SegmentEnds(torques=tuple(torques), T_max=T_max)


def _segments(
    ends: _SegmentEnds,
    twist_of: Mapping[float, float],
    sign: int,
) -> tuple[Segment, ...]:
    """Return the segments of one side.

    Args:
        ends: ends of the segments.
        twist_of: twist by torque [arcsec].
        sign: sign of the torques on this side.
    """
    # the first segment begins in the middle of the backlash, which is the centre of a loop
    centre = (twist_of[ends.smallest] + twist_of[-ends.smallest]) / 2
    segments = []
    for start, end in pairwise([0.0, *(sign * T for T in ends.torques[1:])]):
        # a chord, as catalogues define K_1 to K_3
        twist = twist_of[end] - twist_of.get(start, centre)
        segments.append(
            Segment(
                start=start,
                end=end,
                stiffness=(end - start) / twist * ARCSEC,
            )
        )
    return tuple(segments)


def _kept_twists(
    drive: Drive,
    torque: Array,
    ends: _SegmentEnds,
    formulation: Formulation | None,
    run: Run,
) -> _Twists:
    """Return the twists of a drive at torques [N*m], from the user's cache if they are stored there.

    Only results with a cross-check by a solver that comes with cvxpy are stored. Without a cross-check the drive is one
    of many.
    """

    def twists() -> _Twists:
        contact, tube, certificate = Twist(drive, formulation).at(torque, run.solved)
        cross_check = None
        if run.cross_check:
            # the smallest and the largest torque are the most difficult for a solver
            is_checked = np.isin(np.abs(torque), (ends.torques[0], ends.torques[-1]))
            arguments = (drive, torque[is_checked], contact[is_checked], run.cross_check)
            cross_check = run.beside(_again, *arguments).result()
        return contact.tolist(), tube.tolist(), certificate, cross_check

    solver_versions = solvers_depend_on(run.cross_check)
    # nothing is stored without a cross-check or without a known version of its solver
    if not solver_versions:
        return twists()
    sections = drive.model_dump(mode="json", exclude=WITHOUT_EFFECT)
    depends = [sections, torque.tolist(), solver_versions, digits_depend_on()]
    return kept_answer("twists", depends, _twists_of(len(torque)), twists)


_Twists = tuple[list[float], list[float], Certificate, CrossCheck | None]  # twists of mesh and rings, and of the tube


def _twists_of(torques: int) -> TypeAdapter[_Twists]:
    """Return the type of cached twists.

    torques: number of torques.
    """
    twists = Annotated[list[Number], Field(min_length=torques, max_length=torques)]
    return TypeAdapter(tuple[twists, twists, Certificate, CrossCheck | None], config=ConfigDict(allow_inf_nan=False))


def _again(
    drive: Drive,
    torque: Array,
    contact: Array,
    solver: str,
) -> CrossCheck:
    """Return the cross-check of the twist of mesh and rings by another solver.

    torque: torques [N*m], shape (torques,).
    contact: twist to compare with [arcsec], shape (torques,).
    """
    # this runs in another process, so it states the programme again
    formulation = formulate(contact_system(drive))
    gaps = np.repeat(
        formulation.system.delta_p[None],
        len(torque),
        axis=0,
    )
    return solve_again(formulation, torque, gaps, contact, solver, partial(_place, torque))


class Twist:
    """Twist of a drive without deviations, at tooth phase 0 and the ball phase of the preset.

    formulation: programme of its contact system, if it already exists.
    """

    def __init__(self, drive: Drive, formulation: Formulation | None = None) -> None:
        self.case = LoadCase(formulation or formulate(contact_system(drive)), drive.rated_torque)
        self._tube = shell_twist_stiffness(drive, self.case.system.geometry)

    def at(self, torque: Array, progress: Progress | None = None) -> tuple[Array, Array, Certificate]:
        """Return the twist of mesh and rings and of the shell's tube at torques [N*m], [arcsec], with the certificate.

        Raises UntrustedError if a result cannot be trusted.
        """
        answers = self.case.over(torque, partial(_place, torque), progress)
        return answers.rotation_arcsec, torque * N_MM / self._tube * ARCSEC, answers.certificate

    def between(self, low: float, high: float) -> float:
        """Return the twist from one torque to another [arcsec].

        low, high: the torques [N*m].
        """
        contact, tube, _ = self.at(np.array([low, high]))
        return float(contact[1] + tube[1] - contact[0] - tube[0])


def _place(torques: Array, k: int) -> str:
    return f"M_g = {torques[k]:g} N*m, without deviations"


_STIFFNESSES = ("K_1", "K_2", "K_3")
_CATALOGUE_UNITS = {**dict.fromkeys(_STIFFNESSES, "Nm_per_rad"), "T_1": "Nm", "T_2": "Nm", "lost_motion": "arcsec"}


@dataclass(frozen=True)
class _SegmentBeside:
    """A segment of the model's curve with the catalogue stiffness.

    catalogue: stiffness in the catalogue [N*m/rad]; None if it gives none.
    off_percent: deviation of the model; None without a catalogue value, or if the catalogue segments end at other
        torques.
    """

    name: str
    segment: Segment
    catalogue: float | None
    off_percent: float | None


def segments_beside(catalogue: Catalogue, side: Sequence[Segment]) -> list[_SegmentBeside]:
    """Return the segments of one side, each with its catalogue stiffness."""
    # a chord to another torque has another stiffness, which is not an error of the model
    comparable = not ends_elsewhere(catalogue, side)
    rows = [(name, segment, getattr(catalogue, name)) for name, segment in zip(_STIFFNESSES, side, strict=False)]
    return [_SegmentBeside(*row, off(row[1].stiffness, row[2]) if comparable else None) for row in rows]


def ends_elsewhere(catalogue: Catalogue, side: Sequence[Segment]) -> bool:
    """Return whether the segments end at other torques than those of the catalogue, which makes them incomparable."""
    ends = zip(
        side,
        (catalogue.T_1, catalogue.T_2),
        strict=False,
    )
    return any(T is not None and abs(segment.end) != T for segment, T in ends)


def off(ours: float, theirs: float | None) -> float | None:
    """Return the deviation of a value from that of a catalogue, in per cent of the catalogue value."""
    return None if theirs is None else 100 * (ours / theirs - 1)


def stiffness_object(catalogue: Catalogue, result: Stiffness) -> dict[str, Any] | None:
    """Return the catalogue figures and the deviations of the model, for JSON; None without any figures."""
    figures = {f"{name}_{unit}": getattr(catalogue, name) for name, unit in _CATALOGUE_UNITS.items()}
    percents = dict.fromkeys(_STIFFNESSES) | {
        row.name: row.off_percent for row in segments_beside(catalogue, result.positive)
    }
    percents["lost_motion"] = off(result.lost_motion_arcsec, catalogue.lost_motion)
    return {**figures, "off_percent": percents} if any(figures.values()) else None
