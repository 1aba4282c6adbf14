"""The cheapest tolerances that reach a yield: found on a table of the error, corrected by drives that were proven.

A cost law is share (now/tolerance)^k. The tolerances are sought with the yield read off a table, for the same random
drives with sizes scaled; proven drives say how far that is off, until they agree.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import minimize

from hdassist.error.many import F_ior_of_many
from hdassist.model.deviations import carried
from hdassist.model.geometry import Array
from hdassist.model.unknown import pitch_deviation
from hdassist.preset.fields import CostLaw, Drive
from hdassist.tolerance.production import Production, RandomDrive
from hdassist.tolerance.scatter import DISTRIBUTIONS, Draws
from hdassist.tolerance.tally import Share

LOOSER = 2.0  # times the preset's tolerance, at most
TIGHTER = 0.1  # times it at least, where the preset does not say what can be made
MODEL_DRIVES = 256  # drives that the search for tolerances looks at
DRIVES = 200  # proven ones that say how far off it is, and as many that say what comes of it
RADII = (0.7, 0.5, 0.25, 0.12)  # of the logarithms of tolerances, in which the model is taken as linear
STEP = 0.1  # of them, over which slopes are taken: drives that come and go are smoothed
ROUNDS = 4  # of both, at most
AIM = 0.98  # of the limit, so that what is left over lies on the good side
AGREES = 0.04  # of the limit: what may be left over
CLASSES = range(1, 12)  # of ISO 1328-1:2013


@dataclass(frozen=True)
class Tolerance:
    """A tolerance that may be chosen, by path: its value in the preset, what it may be, and what it costs.

    assumed_law: whether the preset does not say what it costs.
    """

    path: str
    now: float
    least: float
    most: float
    law: CostLaw
    assumed_law: bool

    def cost(self, value: float) -> float:
        """Cost at a value, in the unit of the law's share."""
        return float(self.law.share * (self.now / value) ** self.law.k)


def tolerances(drive: Drive, draws: Draws) -> tuple[Tolerance, ...]:
    """Tolerances of a drive that may be chosen: sizes that the preset gives, and that are drawn up to them."""
    found = []
    for scatter in draws.scatters:
        if scatter.kind in DISTRIBUTIONS and not scatter.assumed:
            law, now = drive.cost.get(scatter.path), scatter.high
            least = law.least if law and law.least is not None else TIGHTER * now
            found.append(Tolerance(scatter.path, now, least, max(LOOSER * now, least), law or CostLaw(), law is None))
    return tuple(found)


@dataclass(frozen=True)
class Allocation:
    """Tolerances, by path in the field's unit, what they cost, and what random drives with them come to.

    turned: whether each wheel is turned to its best position; tried: how many of some drives pass, proven ones and
    other ones than those it was sought on; fits: whether that may be the yield that is wanted; classes: accuracy
    classes of ISO 1328-1 that they stand for.
    """

    turned: bool
    fits: bool
    values: Mapping[str, float]
    cost: float
    tried: Share
    classes: Mapping[str, int] = field(default_factory=dict)


class Allocator:
    """Search for the cheapest tolerances of a drive.

    Arguments: production, with tables that span the loosest tolerances (`loosest`); rooms [arcsec] that the limits
    leave for F'_ior at each torque; wanted, the yield as a share; records, which gives so many proven drives of a
    production; drives, how many of them; executor, to spread the rest over.
    """

    def __init__(
        self,
        production: Production,
        rooms: Sequence[float],
        wanted: float,
        records: Callable[[Production, int], list[RandomDrive]],
        drives: int = DRIVES,
        executor: Executor | None = None,
    ) -> None:
        self._production, self._rooms, self._wanted = production, np.array(rooms), wanted
        self._records, self._drives, self._executor = records, drives, executor
        self.choices = tolerances(production.drive, production.draws)

    def cheapest(self, turned: bool, fixed: Mapping[str, float] | None = None) -> Allocation:
        """The cheapest tolerances, the wheel being turned to its best position or not; fixed, those that are given."""
        fixed = dict(fixed or {})
        open_ = [choice for choice in self.choices if choice.path not in fixed]
        production = self._production if turned else replace(self._production, rotations=(0.0,))
        values = {choice.path: choice.now for choice in open_} | fixed
        if not open_:
            return self._proven(production, values, turned)
        correction = self._below(production, values) / self._model(production, values)
        for _ in range(ROUNDS):
            values = self._sought(production, open_, fixed, correction)
            below = self._below(production, values)
            at_least = all(values[choice.path] <= choice.least * (1 + AGREES) for choice in open_)
            at_most = all(values[choice.path] >= choice.most * (1 - AGREES) for choice in open_)
            if 1 - AGREES < below <= 1 or (at_least and below > 1) or (at_most and below < 1):
                break
            correction = below / self._model(production, values)
        else:
            # about proportional to the sizes: what is too much, or too little, is taken off each of them
            values |= {c.path: float(np.clip(values[c.path] * AIM / below, c.least, c.most)) for c in open_}
        return self._proven(production, values, turned)

    def in_classes(self, found: Allocation) -> Allocation:
        """The cheapest tolerances near those found with F'_i1 and F'_i2 of whole accuracy classes."""
        wheels = [choice for choice in self.choices if choice.path in ("tolerances.F_i1", "tolerances.F_i2")]
        if not wheels:
            return found
        drive, grades = self._production.drive, {}
        for choice in wheels:
            sizes = {grade: pitch_deviation(drive, grade) for grade in CLASSES}
            finer = [
                grade for grade, size in sizes.items() if choice.least <= size <= found.values[choice.path] * 1.0001
            ]
            grades[choice.path] = max(finer, default=min(CLASSES))
        tries = [grades, *({**grades, path: grade + 1} for path, grade in grades.items() if grade + 1 in CLASSES)]
        answers = []
        for chosen in tries:
            fixed = {path: pitch_deviation(drive, grade) for path, grade in chosen.items()}
            if all(fixed[choice.path] <= choice.most for choice in wheels):
                answers.append(replace(self.cheapest(found.turned, fixed), classes=chosen))
        return min(answers, key=lambda answer: (not answer.fits, answer.cost), default=found)

    def _sought(
        self, production: Production, open_: Sequence[Tolerance], fixed: Mapping[str, float], correction: float
    ) -> dict[str, float]:
        """The cheapest open tolerances for which the model, corrected, reaches the yield.

        In logarithms what drives stay below is nearly linear in the tolerances: it is taken so within a radius, the
        cheapest tolerances there are found, and again about them with half the radius.
        """
        low, high, now = (np.log([getattr(choice, of) for choice in open_]) for of in ("least", "most", "now"))

        def model(at: Array) -> float:
            values = {choice.path: float(v) for choice, v in zip(open_, np.exp(at), strict=True)} | dict(fixed)
            return float(np.log(correction * self._model(production, values) / AIM))

        at = np.clip(now, low, high)
        for radius in RADII:
            here = model(at)
            step = np.where(at + STEP <= high, STEP, -STEP)
            slopes = np.array([(model(at + step * one) - here) / (step @ one) for one in np.eye(len(at))])
            bounds = list(zip(np.maximum(low, at - radius), np.minimum(high, at + radius), strict=True))
            at = _cheapest(open_, at, here, slopes, bounds)
        return {choice.path: float(v) for choice, v in zip(open_, np.exp(at), strict=True)} | dict(fixed)

    def _model(self, production: Production, values: Mapping[str, float]) -> float:
        """What a share of drives as wanted stay below: F'_ior over its room at the worst torque, by the table."""
        drawn = self._draws(values).values(0, MODEL_DRIVES)
        turns = np.array(production.rotations)
        columns = {path: np.repeat(column, len(turns)) for path, column in drawn.items()}
        for path in carried(production.drive):
            columns[path] = columns.get(path, production.drive.number(path)) + np.tile(turns, MODEL_DRIVES)
        F_ior = [
            F_ior_of_many(production.drive, table, columns, executor=self._executor) for table in production.tables
        ]
        worst = np.max(np.array(F_ior) / self._rooms[:, None], axis=0).reshape(MODEL_DRIVES, -1)
        return float(np.quantile(worst.min(axis=1), self._wanted))

    def _below(self, production: Production, values: Mapping[str, float]) -> float:
        """What a share of proven drives as wanted stay below: F'_ior over its room at the worst torque."""
        worst = [self._worst(record) for record in self._records(production.drawing(self._draws(values)), self._drives)]
        return float(np.quantile(worst, self._wanted))

    def _proven(self, production: Production, values: Mapping[str, float], turned: bool) -> Allocation:
        """The allocation, tried on drives of another seed."""
        draws = replace(self._draws(values), seed=self._production.draws.seed + 1)
        records = self._records(production.drawing(draws), self._drives)
        tried = Share(sum(self._worst(record) <= 1 for record in records), len(records))
        cost = sum(choice.cost(values[choice.path]) for choice in self.choices)
        return Allocation(turned, tried.bounds[1] >= self._wanted, dict(values), cost, tried)

    def _worst(self, record: RandomDrive) -> float:
        """F'_ior of a drive in its best position over its room, at the worst torque; endless where there is none."""
        if record.refused is not None:
            return np.inf
        return float(np.max(np.array(record.best_F_ior_arcsec) / self._rooms))

    def _draws(self, values: Mapping[str, float]) -> Draws:
        now = {choice.path: choice.now for choice in self.choices}
        return self._production.draws.scaled({path: value / now[path] for path, value in values.items()})


def _cheapest(
    choices: Sequence[Tolerance], at: Array, here: float, slopes: Array, bounds: Sequence[tuple[float, float]]
) -> Array:
    """Logarithms of the cheapest tolerances within bounds where here + slopes (x - at), linear, is at most 0.

    Where that is nowhere so, those where it is least.
    """
    share, k = np.array([(choice.law.share, choice.law.k) for choice in choices]).T
    now = np.log([choice.now for choice in choices])
    furthest = np.where(slopes > 0, *np.array(bounds).T)
    if here + slopes @ (furthest - at) > 0:
        return np.asarray(furthest)
    found = minimize(
        lambda x: float(np.sum(share * np.exp(k * (now - x)))),
        np.where(np.isfinite(furthest), furthest, at),
        jac=lambda x: -share * k * np.exp(k * (now - x)),
        bounds=bounds,
        constraints={"type": "ineq", "fun": lambda x: -here - slopes @ (x - at), "jac": lambda _: -slopes},
        method="SLSQP",
    )
    return np.asarray(np.clip(found.x, *np.array(bounds).T))


def loosest(drive: Drive, draws: Draws) -> Draws:
    """Draws whose tolerances are as great as an allocation may make them: what its tables have to span."""
    return draws.scaled({choice.path: choice.most / choice.now for choice in tolerances(drive, draws)})
