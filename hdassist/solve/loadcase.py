"""A drive's contact system under a torque, which solves its states and proves each answer."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from hdassist.model.contacts import StateGaps, contact_system
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.run.run import Progress
from hdassist.solve.answers import N_MM, STATES_AT_A_TIME, Answers, proven_answers
from hdassist.solve.engine import Engine
from hdassist.solve.formulation import Formulation, formulate
from hdassist.solve.sums import StateSums

LOOKED_AT_FIRST = 64  # states of a load case: in too narrow a window of flanks it is they that mostly say so


class LoadCase:
    """A contact system under a torque, ready to solve many states.

    Arguments: formulation, the programme of the system; M_g, torque on the flexspline [N*m]; like, the load case of a
    system that is the same or differs a little, from whose compiled programme and contacts this one starts; many,
    whether many states will come, in batches however small; solver, a name that cvxpy knows, to send each state through
    cvxpy instead of the engine.
    """

    def __init__(
        self,
        formulation: Formulation,
        M_g: float,
        *,
        like: LoadCase | None = None,
        many: bool = False,
        solver: str | None = None,
    ) -> None:
        self.formulation, self.system, self._torque = formulation, formulation.system, M_g * N_MM
        self._first = LOOKED_AT_FIRST
        near = like._engine if like else None
        self._engine: Engine = Engine(formulation, self._torque, near, many=many, solver=solver)

    @classmethod
    def of(cls, drive: Drive, M_g: float) -> LoadCase:
        """Load case of a drive at a torque M_g [N*m], at tooth phase 0 and the preset's ball phase."""
        return cls(formulate(contact_system(drive)), M_g)

    def load(self, M_g: float) -> None:
        """Go on with another torque [N*m]; what was factored stays."""
        self._torque = M_g * N_MM
        self._engine.load(self._torque)

    def solve(
        self,
        gaps: StateGaps,
        place: Callable[[int], str],
        progress: Progress | None = None,
        *,
        pull: bool = False,
        chunk: int = STATES_AT_A_TIME,
    ) -> Answers:
        """Solve states and prove each answer.

        Arguments: gaps of the states; place, words for where state k is, for errors; progress, told how many states
        were solved since the last call; pull, whether forces along the deviation scalars are asked for; chunk, states
        between two reports of progress. Raises UntrustedError where a state is not solved, or its answer is outside
        the limits of the linear model.
        """
        first, self._first = min(self._first, chunk), chunk
        ends = pairwise(dict.fromkeys([0, *range(first, len(gaps), chunk), len(gaps)]))
        chunks = (self._engine.solve(gaps[begin:end], pull=pull) for begin, end in ends)
        return proven_answers(self.system, self._torque, chunks, place, progress, pull=pull)

    def over(self, torques: Array, place: Callable[[int], str], progress: Progress | None = None) -> Answers:
        """Solve the state without deviations at torques M_g [N*m], each from the contacts of the one before.

        Arguments and errors as those of solve.
        """
        found, delta_p = [], self.system.delta_p[None]
        for M_g in torques.tolist():
            self.load(M_g)
            found.append(self._engine.forces(delta_p))
        forces, free, given_up = zip(*found, strict=True)
        solved = np.repeat(delta_p, len(torques), axis=0), torques * N_MM, np.concatenate(forces), np.concatenate(free)
        return proven_answers(
            self.system, solved[1], [StateSums.of(self.system, *solved, sum(given_up))], place, progress
        )
