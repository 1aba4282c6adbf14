"""How the work of a command is carried out: one object, which whatever works is given."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any, TypeVar

ResultT = TypeVar("ResultT")
Progress = Callable[[int], None]
CROSS_SOLVER = "HIGHS"  # the solver by which some states are solved again


@dataclass(frozen=True)
class Run:
    """How work is carried out: where, watched by whom, from which seed, and checked by which solver.

    executor: spreads the work (any of concurrent.futures; no number depends on it), None for this process; progress:
    called with numbers of states that were solved; seed of samples; cross_check: the solver, of those that cvxpy knows,
    by which extremes and a sample of states are solved again, None for none.
    """

    executor: Executor | None = None
    progress: Progress | None = None
    seed: int = 0
    cross_check: str | None = CROSS_SOLVER

    def map(self, function: Callable[..., ResultT], *columns: Iterable[Any]) -> Iterator[ResultT]:
        """Results of a function over rows of arguments, in their order."""
        return iter((self.executor.map if self.executor else map)(function, *columns))

    def solved(self, states: int) -> None:
        """Report to the progress that so many states more were solved."""
        if self.progress:
            self.progress(states)

    @property
    def of_task(self) -> Run:
        """The run of one task: in a process of its own, which reports once it is done, or in this one."""
        return replace(self, executor=None, progress=None if self.executor else self.progress)

    def finished(self, states: int) -> None:
        """Report the states of a task to the progress, where it could not do so itself."""
        if self.executor:
            self.solved(states)


UNCHECKED = Run(cross_check=None)  # in this process, no state solved again
