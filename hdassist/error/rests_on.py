"""What an answer rests on: how far F'_ior moves over the plausible range of what is assumed of a drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from hdassist.error.error_map import extremes_of, searchable
from hdassist.errors import HdassistError
from hdassist.model.assumed import Assumption, assumptions
from hdassist.model.contacts import StateGaps, contact_system
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate, Progress
from hdassist.solve.formulation import formulate
from hdassist.solve.loadcase import LoadCase

MOST = 3  # assumptions that are told
TURNS = 12  # positions of each wheel that tell which assumptions weigh most
LEAST = 1e-3  # arcsec: a share of less says nothing
STEPS = (1.0, 0.5, 0.25)  # of the way to the end of a range: as far as the drive can be computed

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Effect:
    """What an assumption does: F'_ior [arcsec] at both ends of its range, as far as these can be computed.

    ends: of the range that was computed, in the field's unit; F_ior_arcsec, shape (torques, 2); at, F'_ior as the
    drive is given, shape (torques,).
    """

    assumption: Assumption
    ends: tuple[float, float]
    F_ior_arcsec: Array
    at: Array
    certificate: Certificate

    @property
    def share(self) -> float:
        """Width of the range of F'_ior over the value itself, at the torque where it is greatest."""
        return float(np.max(spans(self.F_ior_arcsec, self.at)))


def spans(ends: Array, at: Array) -> Array:
    """Width of a range [arcsec] as a share of the value, shape (torques,): both ends and the value are in it."""
    together = np.column_stack([ends, at])
    return np.asarray(np.ptp(together, axis=1) / np.maximum(at, LEAST))


@dataclass(frozen=True, eq=False)
class Weighed:
    """Assumptions of a drive, and what a few states of the cycle say of them.

    here: range of the error as the drive is given [arcsec], shape (torques,); ends: of the range of each assumption, as
    far as they can be computed, in its unit, shape (assumptions, 2); there: range of the error at these [arcsec], shape
    (assumptions, 2, torques).
    """

    assumed: tuple[Assumption, ...]
    here: Array
    ends: Array
    there: Array

    def heaviest(self, most: int = MOST) -> list[int]:
        """Places of the assumptions that move the error most, the greatest first."""
        weights = [float(spans(there.T, self.here).max()) for there in self.there]
        return sorted(range(len(weights)), key=lambda k: -weights[k])[:most]

    @property
    def spread(self) -> float:
        """Standard deviation of ln F'_ior over all that is assumed, at the torque where it is greatest.

        Each assumption alone is taken evenly over its range, ln F'_ior straight between its ends, and the variances are
        added.
        """
        here = np.broadcast_to(self.here, (len(self.there), 1, len(self.here)))
        together = np.maximum(np.concatenate([self.there, here], axis=1), LEAST)
        variance = np.sum(np.ptp(np.log(together), axis=1) ** 2 / 12, axis=0)
        return float(np.sqrt(variance.max()))


def weighed(
    drive: Drive, torques: Sequence[float], *, executor: Executor | None = None, progress: Progress | None = None
) -> Weighed | None:
    """What a few states say of the assumptions of a drive at torques [N*m].

    None where nothing is assumed, or the cycle cannot be searched (rolling balls). Arguments: executor, to spread the
    work over; progress, told how many states were solved. Raises UntrustedError where an answer cannot be trusted.
    """
    if not searchable(drive) or not (assumed := assumptions(drive)):
        return None
    asked = tuple(torques)
    run = executor.map if executor else map
    ((_, here, proof),), *found = run(partial(_screened, drive, asked), [None, *assumed])
    ends = [end for both in found for end in both]
    if progress:
        progress(sum((end[2] for end in ends), proof).states)
    reached_, errors = [end[0] for end in ends], [end[1] for end in ends]
    return Weighed(assumed, here, np.reshape(reached_, (-1, 2)), np.reshape(errors, (-1, 2, len(asked))))


def rests_on(
    drive: Drive,
    torques: Sequence[float],
    *,
    most: int = MOST,
    known: Weighed | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> tuple[Effect, ...]:
    """The assumptions that move F'_ior of a drive most, the greatest first.

    A few states tell which these are; what they do is searched. Empty where nothing is assumed, or the cycle cannot be
    searched (rolling balls). Arguments: torques [N*m]; most, how many assumptions; known, what the few states say,
    where they were solved before; executor and progress as in weighed. Raises what
    that does.
    """
    known = known or weighed(drive, torques, executor=executor, progress=progress)
    if known is None:
        return ()
    asked = tuple(torques)
    at, _ = _searched(asked, drive)
    chosen = known.heaviest(most)
    goals = [(known.assumed[k].path, float(end)) for k in chosen for end in known.ends[k]]
    found = list((executor.map if executor else map)(partial(_at_end, drive, asked), goals))
    effects = []
    for k, (low, (down, proof)), (high, (up, other)) in zip(chosen, found[::2], found[1::2], strict=True):
        states = proof + other
        effects.append(Effect(known.assumed[k], (low, high), np.column_stack([down, up]), at, states))
        if progress:
            progress(states.states)
    return tuple(sorted(effects, key=lambda effect: -effect.share))


def reached(drive: Drive, path: str, end: float, solve: Callable[[Drive], T]) -> tuple[float, T]:
    """What a drive comes to with a field changed, and the value of it: as far on the way to an end as there is one.

    Arguments: drive; path of the field; end, the value to go to; solve, what to compute, which may raise HdassistError.
    Raises it where nothing comes of the drive as it is.
    """
    value = drive.number(path)
    for step in STEPS:
        there = value + step * (end - value)
        moved = drive.with_values({path: there})
        if first_conflict(moved) is None:
            with suppress(HdassistError):
                return there, solve(moved)
    return value, solve(drive)


def _screened(
    drive: Drive, torques: Sequence[float], assumption: Assumption | None
) -> list[tuple[float, Array, Certificate]]:
    """Values at the ends of a range, as far as there is a drive, each with the range of the error in a few states.

    The range [arcsec], shape (torques,), and the proof of it; without an assumption, of the drive as it is.
    """
    here = LoadCase.of(drive, torques[0])
    solve = partial(_in_few_states, torques, here)
    if not assumption:
        return [(0.0, *solve(drive))]
    found = [reached(drive, assumption.path, end, solve) for end in (assumption.low, assumption.high)]
    return [(end, *solved) for end, solved in found]


def _in_few_states(torques: Sequence[float], like: LoadCase, drive: Drive) -> tuple[Array, Certificate]:
    angles = 2 * np.pi * np.arange(TURNS) / TURNS
    alpha_g, alpha_b = (angle.ravel() for angle in np.meshgrid(angles, angles))
    formulation = formulate(contact_system(drive))
    gaps = StateGaps(deviation_scalars(drive, alpha_g, alpha_b))
    cases = [LoadCase(formulation, M_g, like=like) for M_g in torques]
    found = [case.solve(gaps, lambda k: f"state {k}") for case in cases]
    ranges = np.array([np.ptp(answers.rotation_arcsec) for answers in found])
    return ranges, sum((answers.certificate for answers in found), EMPTY)


def _at_end(drive: Drive, torques: Sequence[float], end: tuple[str, float]) -> tuple[float, tuple[Array, Certificate]]:
    """F'_ior [arcsec], shape (torques,), as far on the way to a value of a field, by path, as there is a drive."""
    return reached(drive, *end, partial(_searched, torques))


def _searched(torques: Sequence[float], drive: Drive) -> tuple[Array, Certificate]:
    found = extremes_of(drive, torques)
    return np.array([each.first for each in found]), sum((each.certificate for each in found), EMPTY)
