"""What an answer rests on: how far F'_ior moves over the plausible range of what is assumed of a drive."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from hdassist.error.search import CycleSearch, searchable
from hdassist.errors import HdassistError
from hdassist.model.assumed import Assumption, assumptions
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.rules import conflicts
from hdassist.solve.answers import EMPTY, Certificate, Progress
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
    ends = [(drive, each.path, end, asked) for each in assumed for end in (each.low, each.high)]
    run = executor.map if executor else map
    (_, (here, _)), *found = run(_screened, [(drive, "", 0.0, asked), *ends])
    if progress:
        progress(sum(proof.states for _, (_, proof) in found))
    reached_, errors = [end for end, _ in found], [error for _, (error, _) in found]
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
    where they were solved before; executor and progress as in weighed. Raises what that does.
    """
    known = known or weighed(drive, torques, executor=executor, progress=progress)
    if known is None:
        return ()
    asked, chosen = tuple(torques), known.heaviest(most)
    goals = [(drive, known.assumed[k].path, float(end), asked) for k in chosen for end in known.ends[k]]
    (_, (at, _)), *found = (executor.map if executor else map)(_searched, [(drive, "", 0.0, asked), *goals])
    effects = []
    for k, (low, down), (high, up) in zip(chosen, found[::2], found[1::2], strict=True):
        values = np.column_stack([down[0], up[0]])
        effects.append(Effect(known.assumed[k], (low, high), values, at, down[1] + up[1]))
        if progress:
            progress(effects[-1].certificate.states)
    return tuple(sorted(effects, key=lambda effect: -effect.share))


_End = tuple[Drive, str, float, tuple[float, ...]]  # drive, field or none, value of it, torques
_Found = tuple[float, tuple[Array, Certificate]]


def reached(drive: Drive, path: str, end: float, solve: Callable[[Drive], T]) -> tuple[float, T]:
    """What a drive comes to with a field changed, and the value of it: as far on the way to an end as there is one.

    Arguments: drive; path of the field; end, the value to go to; solve, what to compute, which may raise HdassistError.
    Raises it where nothing comes of the drive as it is.
    """
    value = drive.number(path)
    for step in STEPS:
        there = value + step * (end - value)
        moved = drive.with_values({path: there})
        if not any(conflicts({each: moved.value(each) for each in field_table()})):
            with suppress(HdassistError):
                return there, solve(moved)
    return value, solve(drive)


def _screened(task: _End) -> _Found:
    """Range of the error in a few states [arcsec], shape (torques,), as far on the way to a value as there is one."""
    drive, path, end, torques = task
    solve = partial(_at, torques, _in_few_states)
    return reached(drive, path, end, solve) if path else (end, solve(drive))


def _searched(task: _End) -> _Found:
    """F'_ior [arcsec], shape (torques,), as far on the way to a value as there is one."""
    drive, path, end, torques = task
    solve = partial(_at, torques, _full_cycle)
    return reached(drive, path, end, solve) if path else (end, solve(drive))


def _at(
    torques: Sequence[float], solve: Callable[[Drive, float], tuple[float, Certificate]], drive: Drive
) -> tuple[Array, Certificate]:
    found = [solve(drive, M_g) for M_g in torques]
    return np.array([value for value, _ in found]), sum((proof for _, proof in found), EMPTY)


def _in_few_states(drive: Drive, M_g: float) -> tuple[float, Certificate]:
    angles = 2 * np.pi * np.arange(TURNS) / TURNS
    alpha_g, alpha_b = (angle.ravel() for angle in np.meshgrid(angles, angles))
    case = LoadCase.of(drive, M_g)
    answers = case.solve(case.system.gaps(deviation_scalars(drive, alpha_g, alpha_b)), lambda k: f"state {k}")
    return float(np.ptp(answers.rotation_arcsec)), answers.certificate


def _full_cycle(drive: Drive, M_g: float) -> tuple[float, Certificate]:
    found = CycleSearch(drive, M_g).extremes(drive)
    return found.F_ior_arcsec, found.certificate
