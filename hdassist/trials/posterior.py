"""What trials teach: a few measured F'_ior tell the cam offset, and so the best position of the fixed wheel.

Bayes over what is not known (offset_prior.py): each world, size and direction of the offset weighs as much as it
explains the measured values, within their noise, the seat's error and the table's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from hdassist.errors import UntrustedError, UsageError
from hdassist.model.geometry import Array
from hdassist.mounting.positions import hole_words
from hdassist.mounting.robust import Criterion
from hdassist.trials.prior import OffsetPrior
from hdassist.trials.traced_worlds import UNLIKELY
from hdassist.trials.trial import Rig, Trial
from hdassist.trials.weighted import hills, picked, quantile

SETTLED = 0.9  # of the probability, from which on one direction is meant
OPEN = 75.0  # deg: a direction that is known no better is open
LISTED = 0.2  # of the probability: directions that hold more are named
MOST = 50_000  # nodes that are looked at; more are stood for by draws
NEGLIGIBLE = 1e-9  # of the likeliest node
KEPT = 1 - 1e-5  # of the probability; what is less likely is left out of sums
OUTCOMES = 64  # of a next trial that are looked at
ENOUGH = 4000  # nodes for that


@dataclass(frozen=True)
class Direction:
    """A direction of the offset that the trials leave open: its share of the probability, and what goes with it.

    direction_deg and size_um are means, spread_deg is the direction's standard deviation; recommended_deg is the
    rotation that is best if this is the direction.
    """

    share: float
    direction_deg: float
    spread_deg: float
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
    nodes (world, size, direction), sums to 1; F_ior_arcsec, shape (torques, nodes, positions), and now_arcsec, at
    rotation 0, shape (torques, nodes), at the prior's torques, the first so many of which are deciding; spread_arcsec,
    the standard deviation of one measured value of the rig, of noise, seat and table, shape (nodes, positions);
    predicted_arcsec and its spread, of each trial, mean and standard deviation, shape (trials,).
    """

    prior: OffsetPrior
    rig: Rig
    trials: tuple[Trial, ...]
    criterion: Criterion
    deciding: int
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
        """Greatest over the torques of F'_ior against the least over the positions, by weights.

        Shape (nodes, positions). Where the wheel stood at first plays no part: that is chance.
        """
        return self._merit(self.F_ior_arcsec)

    @cached_property
    def now_merits(self) -> Array:
        """The merit of rotation 0, shape (nodes,)."""
        return self._merit(self.now_arcsec[:, :, None])[:, 0]

    def _merit(self, F_ior: Array) -> Array:
        share = np.ones(self.deciding) if self.weights is None else np.array(self.weights) / max(self.weights)
        least = self.F_ior_arcsec[: self.deciding].min(axis=2, keepdims=True)
        return np.asarray(np.max(F_ior[: self.deciding] / least * share[:, None, None], axis=0))

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
        best = self.merits.argmin(axis=1)
        return np.asarray(np.bincount(best, self.weight, len(self.rotations_deg)), dtype=float)

    def expected_F_ior(self, level: float | None = None) -> Array:
        """Mean of F'_ior [arcsec], or a quantile of it, shape (torques, positions)."""
        if level is None:
            return np.asarray(np.einsum("n,tnp->tp", self.weight, self.F_ior_arcsec))
        return np.array([[quantile(column, self.weight, level) for column in F_ior.T] for F_ior in self.F_ior_arcsec])

    @property
    def offset_um(self) -> tuple[float, float]:
        """Mean and standard deviation of the offset's size."""
        return self._spread_of(self.prior.size_um[np.unravel_index(self.nodes, self.prior.weight.shape)[1]])

    @property
    def scale(self) -> tuple[float, float]:
        """Mean and standard deviation of the drive's F'_ior over the model's."""
        return self._spread_of(self.prior.scale[np.unravel_index(self.nodes, self.prior.weight.shape)[0]])

    def _spread_of(self, values: Array) -> tuple[float, float]:
        mean = float(self.weight @ values)
        return mean, float(np.sqrt(self.weight @ (values - mean) ** 2))

    @property
    def model_share(self) -> Array:
        """Probability of each set of stiffnesses, the preset's own first, shape (sets,)."""
        world = np.unravel_index(self.nodes, self.prior.weight.shape)[0]
        return np.asarray(np.bincount(self.prior.model[world], self.weight), dtype=float)

    @property
    def likeliest_deg(self) -> float:
        """The likeliest direction of the offset: that of the direction that holds most, else the likeliest point."""
        if found := self.directions():
            return found[0].direction_deg
        direction = np.unravel_index(self.nodes, self.prior.weight.shape)[2]
        return float(self.prior.direction_deg[np.bincount(direction, self.weight).argmax()])

    @property
    def pointed(self) -> bool:
        """Whether one direction is all but known."""
        found = self.directions()
        return bool(found) and found[0].share > SETTLED and found[0].spread_deg < OPEN

    def directions(self) -> list[Direction]:
        """Every direction of the offset that holds more than LISTED of the probability, likeliest first."""
        _, size, direction = np.unravel_index(self.nodes, self.prior.weight.shape)
        marginal = np.bincount(direction, self.weight, len(self.prior.direction_deg))
        found = []
        for part in hills(np.asarray(marginal, dtype=float)):
            chosen = np.isin(direction, part)
            share = float(self.weight[chosen].sum())
            if share <= LISTED:
                continue
            weight = self.weight[chosen] / share
            turn = complex(weight @ np.exp(1j * np.radians(self.prior.direction_deg[direction[chosen]])))
            found.append(
                Direction(
                    share=share,
                    direction_deg=float(np.degrees(np.angle(turn)) % 360),
                    spread_deg=float(np.degrees(np.sqrt(-2 * np.log(np.clip(abs(turn), 1e-12, 1))))),
                    size_um=float(weight @ self.prior.size_um[size[chosen]]),
                    recommended_deg=self.rotations_deg[int(np.argmin(weight @ self.losses[chosen]))],
                )
            )
        return sorted(found, key=lambda d: -d.share)

    def next_trial(self, seed: int = 0) -> NextTrial:
        """The position to try next: after it the choice is expected to lose least."""
        rng = np.random.default_rng(seed)
        some = picked(self.weight, ENOUGH) if len(self.weight) > ENOUGH else np.arange(len(self.weight))
        weight = self.weight[some] if len(self.weight) <= ENOUGH else np.full(ENOUGH, 1 / ENOUGH)
        truth = picked(weight, OUTCOMES)
        off = norm.ppf((rng.permutation(OUTCOMES) + 0.5) / OUTCOMES)
        place = self.prior.torques.index(self.rig.M_g)
        losses, lost = self.losses[some], []
        for position in range(len(self.rotations_deg)):
            F_ior, spread = self.F_ior_arcsec[place, some, position], self.spread_arcsec[some, position]
            outcome = F_ior[truth] + off * spread[truth]
            density = norm.pdf(outcome[:, None], F_ior, spread) * weight
            lost.append(float(np.mean(((density @ losses) / density.sum(axis=1, keepdims=True)).min(axis=1))))
        return NextTrial(self.rotations_deg[int(np.argmin(lost))], min(lost))


def posterior(
    prior: OffsetPrior,
    trials: Sequence[Trial],
    rig: Rig,
    rotations_deg: Sequence[float],
    *,
    criterion: str = "expected",
    deciding: int | None = None,
    weights: Sequence[float] | None = None,
) -> Posterior:
    """What trials teach.

    Arguments: prior, at torques with the rig's among them; rotations_deg, the positions that may be chosen; criterion
    over the losses; deciding, how many of the prior's torques decide, all without it; weights of those, as in
    mounting_curve. Raises UsageError for no trials, values that are
    no errors, weights that are not one positive number a torque, or an unknown criterion; UntrustedError where no
    offset explains the trials.
    """
    how = Criterion.of(criterion)
    if not trials or not all(np.isfinite(t.F_ior_arcsec) and t.F_ior_arcsec > 0 for t in trials):
        raise UsageError("a trial needs a measured F'_ior above zero", "like h0:28.1 h4:17.3")
    if {id(trial.trace) for trial in trials if trial.trace} != {id(trial.trace) for trial in prior.traced}:
        raise UsageError("the traces of the trials must be those of the prior")
    rig.require_sound()
    deciding = len(prior.torques) if deciding is None else deciding
    require_weights(weights, deciding)
    place = prior.torques.index(rig.M_g)
    fits = [_predicted(prior, rig, place, trial.rotation_deg) for trial in trials]
    # traces were taken in by the prior
    numbers = [(trial, *fit) for trial, fit in zip(trials, fits, strict=True) if not trial.trace]
    squares, log = np.zeros((2, *prior.weight.shape))
    for trial, F_ior, apart in numbers:
        squares += np.square((trial.F_ior_arcsec - F_ior) / apart)
        log -= np.log(apart)
    log -= squares / 2
    possible = np.where(prior.weight > 0, squares, np.inf)
    _require_explained(prior, numbers, possible)
    weight = prior.weight * np.exp(log - log[prior.weight > 0].max())
    nodes, weight = _likeliest(weight.ravel())
    now = prior.at_nodes(0.0, nodes)
    at = [prior.at_nodes(rotation, nodes) for rotation in rotations_deg]
    if rig.reseat_um:
        spread = [_spread(prior, rig, place, rotation).ravel()[nodes] for rotation in rotations_deg]
    else:
        spread = [np.full(len(nodes), float(_spread(prior, rig, place, 0.0)[0]))] * len(rotations_deg)
    told = np.array([F_ior.ravel()[nodes] for F_ior, _ in fits])
    mean = told @ weight
    return Posterior(
        prior=prior,
        rig=rig,
        trials=tuple(trials),
        criterion=how,
        deciding=deciding,
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


def require_weights(weights: Sequence[float] | None, count: int) -> None:
    """Raise UsageError unless weights of torques are so many positive numbers, or none are given."""
    if weights is not None and (len(weights) != count or not all(0 < w < np.inf for w in weights)):
        raise UsageError(f"weights must be {count} positive numbers, one for each torque")


def _spread(prior: OffsetPrior, rig: Rig, place: int, rotation_deg: float) -> Array:
    seat = prior.seat_error(rotation_deg, rig.reseat_um)
    seat = seat[place] if rig.reseat_um else seat
    return np.asarray(np.sqrt(rig.noise_arcsec**2 + prior.standard_error_arcsec[place] ** 2 + seat**2))


def _predicted(prior: OffsetPrior, rig: Rig, place: int, rotation_deg: float) -> tuple[Array, Array]:
    """F'_ior of a trial and the spread of its measured value, shape (worlds, sizes, directions) or less."""
    return prior.at(rotation_deg)[place], _spread(prior, rig, place, rotation_deg)


def _require_explained(prior: OffsetPrior, numbers: Sequence[tuple[Trial, Array, Array]], squares: Array) -> None:
    nearest = np.unravel_index(int(np.argmin(squares)), squares.shape)
    if not numbers or chi2.sf(squares[nearest], len(numbers)) >= UNLIKELY:
        return
    holes = prior.drive.mounting.holes
    told = ", ".join(
        f"{hole_words(trial.rotation_deg, holes)}: measured {trial.F_ior_arcsec:g}, at best {F_ior[nearest]:.1f}"
        for trial, F_ior, _ in numbers
    )
    traces = " beside the traces" if prior.traced else ""
    raise UntrustedError(
        f"no cam offset up to {prior.size_um[-1]:g} um explains the trials{traces} ({told} arcsec)",
        "check the measured values and their torque; a larger --noise, a larger offset in the preset, or values of the "
        "preset found by hdassist calibrate may fit",
    )


def _likeliest(weight: Array) -> tuple[NDArray[np.int64], Array]:
    """The likeliest nodes that hold KEPT of the weight, and their weight."""
    some = np.flatnonzero(weight > weight.max() * NEGLIGIBLE)  # quicker to sort
    order = some[np.argsort(-weight[some], kind="stable")]
    enough = int(np.searchsorted(np.cumsum(weight[order]), KEPT * weight[some].sum())) + 1
    nodes = np.sort(order[:enough])
    weight = weight[nodes] / weight[nodes].sum()
    if len(nodes) <= MOST:
        return nodes, weight
    drawn, count = np.unique(picked(weight, MOST), return_counts=True)
    return nodes[drawn], count / MOST
