"""What an answer rests on: how far F'_ior moves over the plausible range of what is assumed of a drive."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import pairwise

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
STEPS = (1.0, 0.5, 0.25)  # of the way to the end of a range: as far as the drive can be computed


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
    return np.asarray(np.ptp(together, axis=1) / at)


def rests_on(
    drive: Drive,
    torques: Sequence[float],
    *,
    most: int = MOST,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> tuple[Effect, ...]:
    """The assumptions that move F'_ior of a drive most, the greatest first.

    A few states tell which these are; what they do is searched. Empty where nothing is assumed, or the cycle cannot be
    searched (rolling balls). Arguments: torques [N*m]; most, how many assumptions; executor, to spread the work over;
    progress, told how many states were solved.
    """
    if not searchable(drive) or not (assumed := assumptions(drive)):
        return ()
    run = executor.map if executor else map
    ends = [(drive, a.path, end, tuple(torques)) for a in assumed for end in (a.low, a.high)]
    here, *screened = run(_screened, [(drive, "", 0.0, tuple(torques)), *ends])
    pairs = list(zip(screened[::2], screened[1::2], strict=True))
    weights = [float(spans(np.column_stack([low[1], high[1]]), here[1]).max()) for low, high in pairs]
    chosen = sorted(range(len(assumed)), key=lambda k: -weights[k])[:most]
    reached = [(drive, assumed[k].path, pairs[k][side][0], tuple(torques)) for k in chosen for side in (0, 1)]
    found = list(run(_searched, [(drive, "", 0.0, tuple(torques)), *reached]))
    if progress:
        progress(sum(part[2].states for part in (here, *screened, *found)))
    effects = []
    for k, (low, high) in zip(chosen, list(pairwise(found[1:]))[::2], strict=True):
        values = np.column_stack([low[1], high[1]])
        effects.append(Effect(assumed[k], (low[0], high[0]), values, found[0][1], low[2] + high[2]))
    return tuple(sorted(effects, key=lambda effect: -effect.share))


_End = tuple[Drive, str, float, tuple[float, ...]]
_Found = tuple[float, Array, Certificate]


def _screened(task: _End) -> _Found:
    """Value that was reached on the way to an end, and the range of the error in a few states [arcsec], (torques,)."""
    drive, path, end, torques = task
    angles = 2 * np.pi * np.arange(TURNS) / TURNS
    alpha_g, alpha_b = (angle.ravel() for angle in np.meshgrid(angles, angles))
    value = drive.number(path) if path else end
    for step in STEPS if path else STEPS[:1]:
        there = value + step * (end - value)
        moved = drive.with_values({path: there}) if path else drive
        if path and any(conflicts({each: moved.value(each) for each in field_table()})):
            continue
        try:
            ranges, proof = [], EMPTY
            for M_g in torques:
                case = LoadCase.of(moved, M_g)
                scalars = deviation_scalars(moved, alpha_g, alpha_b)
                answers = case.solve(case.system.gaps(scalars), lambda k: f"state {k}")
                ranges.append(np.ptp(answers.rotation_arcsec))
                proof += answers.certificate
        except HdassistError:
            continue
        return there, np.array(ranges), proof
    return _screened((drive, "", value, torques))  # no way from here: it moves nothing


def _searched(task: _End) -> _Found:
    """Value of a field, and F'_ior there [arcsec], shape (torques,)."""
    drive, path, value, torques = task
    there = drive.with_values({path: value}) if path else drive
    found = [CycleSearch(there, M_g).extremes(there) for M_g in torques]
    return value, np.array([each.F_ior_arcsec for each in found]), sum((each.certificate for each in found), EMPTY)
