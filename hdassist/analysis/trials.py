"""Trials: F'_ior measured in a few positions of the fixed wheel tells the cam offset, and so the best position.

Bayes over what is not known (offset_prior.py): each world, size and direction of the offset weighs as much as it
explains the measured values, within their noise, the seat's error and the table's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from hdassist.analysis.mounting import FREE_STEP, hole_of
from hdassist.analysis.offset_prior import OffsetPrior
from hdassist.analysis.robust import Criterion
from hdassist.errors import UntrustedError, UsageError
from hdassist.model.geometry import Array

LISTED = 0.2  # of the probability: directions that hold more are named
UNLIKELY = 1e-3  # of a chance that the best explanation misses the trials so far: then there is none
KEPT = 1 - 1e-6  # of the probability; what is less likely is left out of sums
OUTCOMES = 64  # of a next trial that are looked at
SURPRISE = 0.975  # quantile of the prediction above which an outcome is a surprise


@dataclass(frozen=True)
class Trial:
    """F'_ior measured [arcsec] with the fixed wheel turned by rotation_deg from where it stood at 0."""

    rotation_deg: float
    F_ior_arcsec: float


@dataclass(frozen=True)
class Rig:
    """How trials are measured: at a torque [N*m], with noise of a value [arcsec] and an error of the seat [um].

    Both are standard deviations; reseat_um is that of the wheel's centre along any direction.
    """

    M_g: float
    noise_arcsec: float = 1.0
    reseat_um: float = 0.0


@dataclass(frozen=True)
class Direction:
    """A direction of the offset that the trials leave open: its share of the probability, and what goes with it.

    direction_deg and size_um are means; recommended_deg is the rotation that is best if this is the direction.
    """

    share: float
    direction_deg: float
    size_um: float
    recommended_deg: float


@dataclass(frozen=True)
class NextTrial:
    """The position whose measurement teaches most: loss is what is expected of the choice after it."""

    rotation_deg: float
    loss: float


@dataclass(frozen=True)
class Posterior:
    """What is known after some trials.

    rotations_deg, the positions that may be chosen, shape (positions,); weight, shape (nodes,), of the likeliest
    nodes (world, size, direction), sums to 1; F_ior_arcsec, shape (torques, nodes, positions); spread_arcsec, the
    standard deviation of one measured value there, of noise, seat and table, shape (nodes, positions), at the rig's
    torque; now_arcsec, at rotation 0, shape (torques, nodes); predicted_arcsec and its spread, of each trial, mean and
    standard deviation, shape (trials,).
    """

    prior: OffsetPrior
    rig: Rig
    trials: tuple[Trial, ...]
    criterion: Criterion
    weights: tuple[float, ...] | None
    rotations_deg: tuple[float, ...]
    nodes: NDArray[np.int64]
    weight: Array
    F_ior_arcsec: Array
    spread_arcsec: Array
    now_arcsec: Array
    predicted_arcsec: Array
    predicted_spread_arcsec: Array

    @cached_property
    def merits(self) -> Array:
        """Greatest over the torques of F'_ior against that at rotation 0, by weights, shape (nodes, positions)."""
        share = np.ones(len(self.now_arcsec)) if self.weights is None else np.array(self.weights) / max(self.weights)
        return np.asarray(np.max(self.F_ior_arcsec / self.now_arcsec[:, :, None] * share[:, None, None], axis=0))

    @cached_property
    def losses(self) -> Array:
        """What each position loses against the best one, as a share of the error there, shape (nodes, positions)."""
        return np.asarray(self.merits / self.merits.min(axis=1, keepdims=True) - 1)

    @cached_property
    def expected_loss(self) -> Array:
        """Mean of the losses, shape (positions,)."""
        return np.asarray(self.weight @ self.losses)

    @cached_property
    def value(self) -> Array:
        """What the criterion makes of the losses, shape (positions,)."""
        if self.criterion.name == "expected":
            return self.expected_loss
        level = 1.0 if self.criterion.quantile is None else self.criterion.quantile
        return np.array([quantile(column, self.weight, level) for column in self.losses.T])

    @property
    def best(self) -> int:
        """Which of the positions is the choice."""
        return int(np.argmin(self.value))

    @cached_property
    def probability_best(self) -> Array:
        """Probability of each position to be the best one, shape (positions,)."""
        return np.bincount(self.merits.argmin(axis=1), self.weight, minlength=len(self.rotations_deg))

    def expected_F_ior(self, level: float | None = None) -> Array:
        """Mean of F'_ior [arcsec], or a quantile of it, shape (torques, positions)."""
        if level is None:
            return np.asarray(np.einsum("n,tnp->tp", self.weight, self.F_ior_arcsec))
        return np.array([[quantile(column, self.weight, level) for column in F_ior.T] for F_ior in self.F_ior_arcsec])

    @property
    def offset_um(self) -> tuple[float, float]:
        """Mean and standard deviation of the offset's size."""
        size = self.prior.size_um[np.unravel_index(self.nodes, self.prior.weight.shape)[1]]
        mean = float(self.weight @ size)
        return mean, float(np.sqrt(self.weight @ (size - mean) ** 2))

    @property
    def model_share(self) -> Array:
        """Probability of each set of stiffnesses, the preset's own first, shape (sets,)."""
        world = np.unravel_index(self.nodes, self.prior.weight.shape)[0]
        return np.bincount(self.prior.model[world], self.weight, minlength=int(self.prior.model[-1]) + 1)

    def directions(self) -> list[Direction]:
        """Every direction of the offset that holds more than LISTED of the probability, likeliest first."""
        _, size, direction = np.unravel_index(self.nodes, self.prior.weight.shape)
        marginal = np.bincount(direction, self.weight, minlength=len(self.prior.direction_deg))
        found = []
        for part in hills(marginal):
            chosen = np.isin(direction, part)
            share = float(self.weight[chosen].sum())
            if share <= LISTED:
                continue
            weight = self.weight[chosen] / share
            turn = np.exp(1j * np.radians(self.prior.direction_deg[direction[chosen]]))
            found.append(
                Direction(
                    share=share,
                    direction_deg=float(np.degrees(np.angle(weight @ turn)) % 360),
                    size_um=float(weight @ self.prior.size_um[size[chosen]]),
                    recommended_deg=self.rotations_deg[int(np.argmin(weight @ self.losses[chosen]))],
                )
            )
        return sorted(found, key=lambda d: -d.share)

    def next_trial(self, seed: int = 0) -> NextTrial:
        """The position to try next: after it the choice is expected to lose least."""
        rng = np.random.default_rng(seed)
        truth = np.searchsorted(np.cumsum(self.weight), (np.arange(OUTCOMES) + 0.5) / OUTCOMES)
        truth = np.minimum(truth, len(self.weight) - 1)
        off = norm.ppf((rng.permutation(OUTCOMES) + 0.5) / OUTCOMES)
        place = self.prior.torques.index(self.rig.M_g)
        lost = []
        for position in range(len(self.rotations_deg)):
            F_ior, spread = self.F_ior_arcsec[place, :, position], self.spread_arcsec[:, position]
            outcome = F_ior[truth] + off * spread[truth]
            density = norm.pdf(outcome[:, None], F_ior, spread) * self.weight
            lost.append(float(np.mean(((density @ self.losses) / density.sum(axis=1, keepdims=True)).min(axis=1))))
        return NextTrial(self.rotations_deg[int(np.argmin(lost))], min(lost))


@dataclass(frozen=True)
class Verification:
    """A measured outcome against its prediction: mean and 2.5 % and 97.5 % quantiles [arcsec] of one value.

    best_tried, the trial with the least value; keep: whether to keep the position, or to go back to that trial's.
    """

    trial: Trial
    expected_arcsec: float
    low_arcsec: float
    high_arcsec: float
    best_tried: Trial

    @property
    def as_predicted(self) -> bool:
        """Whether the outcome lies between the quantiles."""
        return self.low_arcsec <= self.trial.F_ior_arcsec <= self.high_arcsec

    @property
    def keep(self) -> bool:
        """Whether nothing better was tried."""
        return self.trial.F_ior_arcsec <= self.best_tried.F_ior_arcsec


def posterior(
    prior: OffsetPrior,
    trials: Sequence[Trial],
    rig: Rig,
    rotations_deg: Sequence[float],
    *,
    criterion: str = "expected",
    weights: Sequence[float] | None = None,
) -> Posterior:
    """What trials teach.

    Arguments: prior, at torques with the rig's among them; rotations_deg, the positions that may be chosen; criterion
    over the losses; weights of the torques, as in mounting_curve. Raises UsageError for no trials, values that are
    no errors, weights that are not one positive number a torque, or an unknown criterion; UntrustedError where no
    offset explains the trials.
    """
    how = Criterion.of(criterion)
    if not trials or not all(np.isfinite(t.F_ior_arcsec) and t.F_ior_arcsec > 0 for t in trials):
        raise UsageError("a trial needs a measured F'_ior above zero", "--trial 0:28.1 --trial h4:17.3")
    if not (rig.noise_arcsec > 0 and rig.reseat_um >= 0):
        raise UsageError("the noise of a trial must be above zero and the seat's error not below", "--noise 1")
    if weights is not None and (len(weights) != len(prior.torques) or not all(0 < w < np.inf for w in weights)):
        raise UsageError(f"weights must be {len(prior.torques)} positive numbers, one for each torque")
    place = prior.torques.index(rig.M_g)
    fits = [_predicted(prior, rig, place, trial.rotation_deg) for trial in trials]
    off = [(trial.F_ior_arcsec - F_ior) / spread for trial, (F_ior, spread) in zip(trials, fits, strict=True)]
    squares = np.sum(np.square(off), axis=0)
    possible = np.where(prior.weight > 0, squares, np.inf)
    _require_explained(prior, trials, fits, possible)
    log = -squares / 2 - np.sum([np.log(np.broadcast_to(spread, squares.shape)) for _, spread in fits], axis=0)
    weight = prior.weight * np.exp(log - log[prior.weight > 0].max())
    nodes, weight = _likeliest(weight.ravel())
    now = prior.at(0.0).reshape(len(prior.torques), -1)[:, nodes]
    at = [prior.at(rotation).reshape(len(prior.torques), -1)[:, nodes] for rotation in rotations_deg]
    spread = [np.broadcast_to(_spread(prior, rig, place, r), squares.shape).ravel()[nodes] for r in rotations_deg]
    told = np.array([F_ior.ravel()[nodes] for F_ior, _ in fits])
    mean = told @ weight
    return Posterior(
        prior=prior,
        rig=rig,
        trials=tuple(trials),
        criterion=how,
        weights=None if weights is None else tuple(weights),
        rotations_deg=tuple(rotations_deg),
        nodes=nodes,
        weight=weight,
        F_ior_arcsec=np.stack(at, axis=-1),
        spread_arcsec=np.stack(spread, axis=-1),
        now_arcsec=now,
        predicted_arcsec=mean,
        predicted_spread_arcsec=np.sqrt(np.square(told - mean[:, None]) @ weight),
    )


def verify(known: Posterior, outcome: Trial) -> Verification:
    """Compare a measured outcome with what the trials before it predict."""
    there = posterior(known.prior, known.trials, known.rig, [outcome.rotation_deg])
    place = known.prior.torques.index(known.rig.M_g)
    F_ior, spread = there.F_ior_arcsec[place, :, 0], there.spread_arcsec[:, 0]
    grid = np.linspace((F_ior - 4 * spread).min(), (F_ior + 4 * spread).max(), 2000)
    below = norm.cdf(grid[:, None], F_ior, spread) @ there.weight
    low, high = np.interp((1 - SURPRISE, SURPRISE), below, grid)
    best = min(known.trials, key=lambda t: t.F_ior_arcsec)
    return Verification(outcome, float(there.weight @ F_ior), float(low), float(high), best)


def trial_positions(holes: int, allowed: Sequence[int] | str) -> list[float]:
    """Positions that may be chosen [deg]: the usable holes, or 5 degree steps where the angle is free."""
    if not holes:
        return [FREE_STEP * k for k in range(round(360 / FREE_STEP))]
    return [360 * k / holes for k in range(holes) if allowed == "all" or k in allowed]


def read_trial(text: str, holes: int) -> Trial:
    """Read 120:17.3 (degrees) or h4:17.3 (holes). Raises UsageError for anything else."""
    where, _, value = text.partition(":")
    hint = "like 120:17.3 (degrees) or h4:17.3 (holes), then the measured F'_ior in arcsec"
    try:
        F_ior = float(value)
        rotation = float(where.removeprefix("h"))
    except ValueError:
        raise UsageError(f"{text!r} is no trial", hint) from None
    if not (0 < F_ior < np.inf and np.isfinite(rotation)):
        raise UsageError(f"{text!r} is no trial", hint)
    if where.startswith("h"):
        if not holes:
            raise UsageError(f"{text!r} names a hole of a seat that has none", "mounting.holes says how many")
        if rotation not in range(holes):
            raise UsageError(f"{text!r}: the seat's holes are h0 to h{holes - 1}", hint)
        rotation *= 360 / holes
    return Trial(rotation % 360, F_ior)


def quantile(values: Array, weight: Array, level: float) -> float:
    """Least of the values that holds at least so much of the weight with those below it."""
    order = np.argsort(values)
    place = np.searchsorted(np.cumsum(weight[order]), min(level, KEPT) * weight.sum())
    return float(values[order[min(int(place), len(order) - 1)]])


def hills(marginal: Array) -> list[NDArray[np.int64]]:
    """Parts of a circle around each peak of a density, from valley to valley; valleys less than half deep join."""
    count = len(marginal)
    smooth = np.mean([np.roll(marginal, k) for k in (-1, 0, 1)], axis=0)
    start = int(np.argmin(smooth))
    line = np.roll(smooth, -start)
    parts: list[list[int]] = [[0]]
    for k in range(1, count):
        here = line[parts[-1]]
        peak_before = here.max()
        valley = here[here.argmax() :].min()
        if line[k] > 2 * valley and peak_before > 2 * valley and line[k] > line[k - 1]:
            # up again out of a deep valley: what lies behind its bottom belongs to the next peak
            bottom = here.argmax() + int(here[here.argmax() :].argmin())
            parts.append(parts[-1][bottom + 1 :])
            parts[-2] = parts[-2][: bottom + 1]
        parts[-1].append(k)
    return [(np.array(part, dtype=np.int64) + start) % count for part in parts]


def hole_words(rotation_deg: float, holes: int) -> str:
    """A position in words: hole 4 (120 deg), or the angle alone."""
    hole = hole_of(rotation_deg, holes)
    return f"{rotation_deg:g} deg" if hole is None else f"hole {hole} ({rotation_deg:g} deg)"


def _spread(prior: OffsetPrior, rig: Rig, place: int, rotation_deg: float) -> Array:
    seat = prior.seat_error(rotation_deg, rig.reseat_um)
    seat = seat[place] if rig.reseat_um else seat
    return np.sqrt(rig.noise_arcsec**2 + prior.standard_error_arcsec[place] ** 2 + seat**2)


def _predicted(prior: OffsetPrior, rig: Rig, place: int, rotation_deg: float) -> tuple[Array, Array]:
    """F'_ior of a trial and the spread of its measured value, shape (worlds, sizes, directions) or less."""
    return prior.at(rotation_deg)[place], _spread(prior, rig, place, rotation_deg)


def _require_explained(
    prior: OffsetPrior, trials: Sequence[Trial], fits: Sequence[tuple[Array, Array]], squares: Array
) -> None:
    nearest = np.unravel_index(int(np.argmin(squares)), squares.shape)
    if chi2.sf(squares[nearest], len(trials)) >= UNLIKELY:
        return
    told = ", ".join(
        f"{hole_words(t.rotation_deg, prior.drive.mounting.holes)}: measured {t.F_ior_arcsec:g}, at best {F[nearest]:.1f}"
        for t, (F, _) in zip(trials, fits, strict=True)
    )
    raise UntrustedError(
        f"no cam offset up to {prior.size_um[-1]:g} um explains the trials ({told} arcsec)",
        "check the measured values and their torque; a larger --noise, a larger offset in the preset, or values of the "
        "preset found by hdassist calibrate may fit",
    )


def _likeliest(weight: Array) -> tuple[NDArray[np.int64], Array]:
    """The likeliest nodes that hold KEPT of the weight, and their weight."""
    order = np.argsort(-weight, kind="stable")
    enough = int(np.searchsorted(np.cumsum(weight[order]), KEPT * weight.sum())) + 1
    nodes = np.sort(order[:enough])
    return nodes, weight[nodes] / weight[nodes].sum()


def again(known: Posterior, trial: Trial) -> Posterior:
    """What is known with one more trial."""
    trials = (*known.trials, trial)
    return replace(
        posterior(
            known.prior,
            trials,
            known.rig,
            known.rotations_deg,
            criterion=known.criterion.name,
            weights=known.weights,
        )
    )
