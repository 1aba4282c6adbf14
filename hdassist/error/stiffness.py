"""Torsional stiffness of a drive without deviations: twist against torque, lost motion, K1, K2, K3.

The twist is that of mesh and rings (the contact model) and of the shell as a tube, in series. Without friction
the curve is the same on the way up and on the way down: there is no hysteresis loop.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter

from hdassist.error.cycle import WITHOUT_EFFECT
from hdassist.errors import UsageError
from hdassist.model.contacts import contact_system, shell_twist_stiffness
from hdassist.model.geometry import Array
from hdassist.preset.fields import Catalogue, Drive
from hdassist.run.kept import Number, kept_answer
from hdassist.run.run import Progress, Run
from hdassist.solve.answers import ARCSEC, N_MM, Certificate
from hdassist.solve.formulation import Formulation, formulate
from hdassist.solve.loadcase import CrossCheck, LoadCase, solve_again, solvers_depend_on
from hdassist.solve.walk import digits_depend_on

LOST_MOTION_SHARE = 0.04  # share of the rated torque, to each side, at which catalogues measure lost motion
# Share of the rated torque that closes the play; its own elastic twist is some thousandths of an arcsec.
NEAR_ZERO = 1e-5
# Catalogues' ends of the first and second segment [N*m] at a pitch diameter of 147.32 mm (size 58, 2.54 mm a size);
# size 65 has 235 and 843, which is the same to 1 % with the cube of the diameter.
_T_58 = (168.0, 598.0)
_D_58 = 147.32
_CURVE_BEYOND = 1.5  # end of the curve by default, as a multiple of T_2
_CURVE_POINTS = 40  # torques to each side by default


@dataclass(frozen=True)
class Segment:
    """A chord of the curve between two torques [N*m] on one side: stiffness [N*m/rad]."""

    start: float
    end: float
    stiffness: float


@dataclass(frozen=True)
class Stiffness:
    """Twist of a drive over torques.

    torque [N*m], shape (points,), ascending, without 0; contact_arcsec and tube_arcsec, the twist of mesh and
    rings and that of the shell, same shape; rated [N*m]; segments: K1, K2, K3 to the positive, then to the
    negative side, those the curve reaches.
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
        """Twist of the output against the fixed wheel, the cam held."""
        return self.contact_arcsec + self.tube_arcsec

    def weaker(self, segment: int) -> float:
        """Return the stiffness [N*m/rad] of a segment (1: K_1) on the side where it is smaller."""
        return min(side[segment - 1].stiffness for side in (self.positive, self.negative))

    def twist_at(self, torque: float) -> float:
        """Return the twist [arcsec] at a torque [N*m] that is one of the curve's."""
        return float(self.twist_arcsec[int(np.argmin(np.abs(self.torque - torque)))])

    @property
    def lost_motion_arcsec(self) -> float:
        """Twist between plus and minus 4 % of the rated torque."""
        return self.twist_at(LOST_MOTION_SHARE * self.rated) - self.twist_at(-LOST_MOTION_SHARE * self.rated)

    @property
    def play_arcsec(self) -> float:
        """Twist between the least torques to both sides: the backlash of the clearances."""
        return self.twist_at(NEAR_ZERO * self.rated) - self.twist_at(-NEAR_ZERO * self.rated)


def catalogue_torques(drive: Drive) -> tuple[float, float]:
    """Return the ends T_1, T_2 [N*m] of the segments, as the drive's catalogue has them.

    Where the preset gives one of them, the other is in the proportion that catalogues have; where it gives none, both
    are those of catalogues at the drive's pitch diameter, by the cube law.
    """
    torques = drive.catalogue.T_1, drive.catalogue.T_2
    # both ends scale with one factor if the catalogue states only one of them
    scales = [T / T_size for T, T_size in zip(torques, _T_58, strict=True) if T is not None]
    scale = scales[0] if scales else (drive.gears.pitch_diameter / _D_58) ** 3
    T_1, T_2 = (scale * T_size if T is None else T for T, T_size in zip(torques, _T_58, strict=True))
    return T_1, T_2


def stiffness_states() -> int:
    """Return the number of states that a stiffness curve solves, about, for a progress bar."""
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
    """Return the twist of a drive without deviations over torques to both sides, at tooth phase 0 and its ball phase.

    Args:
        drive: the drive.
        T_1: end of the first segment [N*m]; as in catalogues for the size by default.
        T_2: end of the second segment [N*m]; as in catalogues for the size by default.
        T_max: end of the curve [N*m]; 1.5 T_2 by default.
        points: number of torques to each side, besides the ends of segments.
        formulation: of the drive's contact system, if it exists already.
        run: its solver for the cross-check solves the smallest and the largest torque to both sides again.

    Raises UsageError for torques that are too small, not finite or in the wrong order, UntrustedError if an answer
    cannot be trusted.
    """
    rated = drive.rated_torque
    ends = _segment_ends(drive, T_1, T_2, T_max)
    # the torques that results are read at are nodes themselves: no interpolation
    side = np.unique([*ends.torques, LOST_MOTION_SHARE * rated, *np.linspace(0, ends.T_max, points + 1)[1:]])
    # rising from one side to the other, so that contacts change step by step
    torque = np.concatenate([-side[::-1], side])
    contact, tube, certificate, cross_check = _kept_twists(drive, torque, ends, formulation, run)
    contact_arcsec = np.array(contact)
    tube_arcsec = np.array(tube)
    # floats are safe as keys: the ends of the segments are among the torques as they are
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
    """Torques that end the segments of a curve, to one side [N*m]."""

    torques: tuple[float, ...]  # the smallest one that closes the play, then the ends of the segments that are reached
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
    """Return the ends of the segments of a curve, with the arguments of `stiffness`.

    Raises UsageError for torques that are too small, not finite or in the wrong order.
    """
    default_1, default_2 = catalogue_torques(drive)
    T_1 = default_1 if T_1 is None else T_1
    T_2 = default_2 if T_2 is None else T_2
    T_max = _CURVE_BEYOND * T_2 if T_max is None else T_max
    # at 0 the contacts are undetermined within the play
    smallest = NEAR_ZERO * drive.rated_torque
    hint = f"use a finite torque above {smallest:g} N*m, 1e-5 of the rated torque"
    # written so that NaN is refused as well
    for name, value in (("T_1", T_1), ("T_2", T_2), ("the end of the curve", T_max)):
        if not smallest < value < np.inf:
            raise UsageError(f"invalid {name}: {value:g} N*m", hint)
    if not T_1 < T_2:
        raise UsageError(
            f"T_1, {T_1:g} N*m, must be below T_2, {T_2:g} N*m",
            f"give both --t1 and --t2; their defaults are {default_1:.4g} and {default_2:.4g} N*m",
        )
    torques = [smallest]
    torques += [T for T in (T_1, T_2) if T_max >= T]  # a segment that the curve ends in does not count
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
        ends: of the segments.
        twist_of: twist by torque [arcsec].
        sign: of the torques on this side.
    """
    # the first segment begins in the middle of the play, where a loop has its centre
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
    """Return the twists of a drive at torques [N*m], from the user's cache if they are there.

    Without a cross-check by a solver that comes with cvxpy they are not kept: such a drive is one of many.
    """

    def twists() -> _Twists:
        contact, tube, certificate = Twist(drive, formulation).at(torque, run.solved)
        cross_check = None
        if run.cross_check:
            # the smallest and the largest torque are the hardest ones for a solver
            is_checked = np.isin(np.abs(torque), (ends.torques[0], ends.torques[-1]))
            arguments = (drive, torque[is_checked], contact[is_checked], run.cross_check)
            cross_check = run.beside(_again, *arguments).result()
        return contact.tolist(), tube.tolist(), certificate, cross_check

    solver_versions = solvers_depend_on(run.cross_check)
    # of an unknown solver nothing is kept
    if not solver_versions:
        return twists()
    sections = drive.model_dump(mode="json", exclude=WITHOUT_EFFECT)
    depends = [sections, torque.tolist(), solver_versions, digits_depend_on()]
    return kept_answer("twists", depends, _twists_of(len(torque)), twists)


_Twists = tuple[list[float], list[float], Certificate, CrossCheck | None]  # of mesh and rings, and of the tube


def _twists_of(torques: int) -> TypeAdapter[_Twists]:
    """Return the type of kept twists at so many torques."""
    twists = Annotated[list[Number], Field(min_length=torques, max_length=torques)]
    return TypeAdapter(tuple[twists, twists, Certificate, CrossCheck | None], config=ConfigDict(allow_inf_nan=False))


def _again(
    drive: Drive,
    torque: Array,
    contact: Array,
    solver: str,
) -> CrossCheck:
    """Return the twist of mesh and rings at torques [N*m] by another solver [arcsec], shape (torques,)."""
    # runs in another process, so it states the programme anew
    formulation = formulate(contact_system(drive))
    gaps = np.repeat(
        formulation.system.delta_p[None],
        len(torque),
        axis=0,
    )
    return solve_again(formulation, torque, gaps, contact, solver, partial(_place, torque))


class Twist:
    """Twist of a drive without deviations, at tooth phase 0 and its ball phase.

    Argument: formulation of its contact system, if it is there already.
    """

    def __init__(self, drive: Drive, formulation: Formulation | None = None) -> None:
        self.case = LoadCase(formulation or formulate(contact_system(drive)), drive.rated_torque)
        self._tube = shell_twist_stiffness(drive, self.case.system.geometry)

    def at(self, torque: Array, progress: Progress | None = None) -> tuple[Array, Array, Certificate]:
        """Return the twist of mesh and rings, and of the shell's tube [arcsec], at torques [N*m], with the certificate.

        Raises UntrustedError if an answer cannot be trusted.
        """
        answers = self.case.over(torque, partial(_place, torque), progress)
        return answers.rotation_arcsec, torque * N_MM / self._tube * ARCSEC, answers.certificate

    def between(self, low: float, high: float) -> float:
        """Return the twist [arcsec] from one torque to another [N*m]."""
        contact, tube, _ = self.at(np.array([low, high]))
        return float(contact[1] + tube[1] - contact[0] - tube[0])


def _place(torques: Array, k: int) -> str:
    return f"M_g = {torques[k]:g} N*m, without deviations"


_STIFFNESSES = ("K_1", "K_2", "K_3")
_CATALOGUE_UNITS = {**dict.fromkeys(_STIFFNESSES, "Nm_per_rad"), "T_1": "Nm", "T_2": "Nm", "lost_motion": "arcsec"}


@dataclass(frozen=True)
class _SegmentBeside:
    """A segment of the model's curve beside the stiffness of the catalogue [N*m/rad], None if it gives none.

    off_percent: how far the model is off; None without a catalogue, or where its segments end at other torques.
    """

    name: str
    segment: Segment
    catalogue: float | None
    off_percent: float | None


def segments_beside(catalogue: Catalogue, side: Sequence[Segment]) -> list[_SegmentBeside]:
    """Return the segments of one side, each beside the catalogue's."""
    # a chord to another torque is another stiffness, and no error of the model
    comparable = not ends_elsewhere(catalogue, side)
    rows = [(name, segment, getattr(catalogue, name)) for name, segment in zip(_STIFFNESSES, side, strict=False)]
    return [_SegmentBeside(*row, off(row[1].stiffness, row[2]) if comparable else None) for row in rows]


def ends_elsewhere(catalogue: Catalogue, side: Sequence[Segment]) -> bool:
    """Return whether segments end at other torques than the catalogue's: chords between them are other stiffnesses."""
    ends = zip(
        side,
        (catalogue.T_1, catalogue.T_2),
        strict=False,
    )
    return any(T is not None and abs(segment.end) != T for segment, T in ends)


def off(ours: float, theirs: float | None) -> float | None:
    """Return how far a value is off that of a catalogue, in per cent of the catalogue's."""
    return None if theirs is None else 100 * (ours / theirs - 1)


def stiffness_object(catalogue: Catalogue, result: Stiffness) -> dict[str, Any] | None:
    """Return the figures of a catalogue and how far the model is off, for JSON; None if it gives none."""
    figures = {f"{name}_{unit}": getattr(catalogue, name) for name, unit in _CATALOGUE_UNITS.items()}
    percents = dict.fromkeys(_STIFFNESSES) | {
        row.name: row.off_percent for row in segments_beside(catalogue, result.positive)
    }
    percents["lost_motion"] = off(result.lost_motion_arcsec, catalogue.lost_motion)
    return {**figures, "off_percent": percents} if any(figures.values()) else None
