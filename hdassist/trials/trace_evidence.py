"""What traces of trials tell of a drive.

The cam's own offset and all else that is not known shape a curve far more than they shape an F'_ior: of draws made
before the trace hardly one would explain it. So they are drawn after it: particles that go from what is known before
to what the traces leave, by steps in which the traces count more and more (sequential Monte Carlo with tempering,
moves by differences of particles). How likely each size and direction of the offset is beside such a draw is then
computed on the prior's grid.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import logsumexp

from hdassist.error.table import TURNS, ErrorTable
from hdassist.model.deviations import carried, scalars_of
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive
from hdassist.trials.trial_traces import CELLS, TrialTrace

PARTICLES = 1200
MOVES = 10  # of each particle at each step
KEPT = 0.5  # of the particles that a step may leave, counted by weight
JUMP = 0.1  # share of moves by a whole difference: from one peak to another
JITTER = 1e-3  # of the range of an unknown
Single = NDArray[np.float32]
FAR = 60.0  # of -2 log likelihood beyond which a coarse node's neighbours are not looked at


@dataclass(frozen=True, eq=False)
class Evidence:
    """Traces of one rotation each, with what whitens them: at a torque, for drives like the first.

    rotations_deg of the fixed wheel; matrices and targets as TrialTrace.whitened gives them.
    """

    traces: tuple[TrialTrace, ...]
    rotations_deg: tuple[float, ...]
    matrices: tuple[Array, ...]
    targets: tuple[Array, ...]

    @classmethod
    def of(cls, traces: Sequence[TrialTrace], rotations_deg: Sequence[float], slow_arcsec: float) -> Evidence:
        """Evidence of traces whose slow errors have a standard deviation."""
        both = [trace.whitened(slow_arcsec) for trace in traces]
        return cls(tuple(traces), tuple(rotations_deg), tuple(m for m, _ in both), tuple(t for _, t in both))

    @property
    def reversed(self) -> Evidence:
        """The same with the other sign of the errors."""
        return replace(self, targets=tuple(-target for target in self.targets))

    @property
    def known(self) -> int:
        """Means that the traces have."""
        return sum(trace.known for trace in self.traces)


@dataclass(frozen=True)
class Particles:
    """Draws of what is not known, all alike likely, shape (particles, unknowns), as shares; log of the evidence.

    squares: of what the best of them is off by, whitened.
    """

    shares: Array
    log_evidence: float
    squares: float


def tempered(
    squares_of: Callable[[Array], Array],
    circular: NDArray[np.bool_],
    seed: Sequence[int],
    particles: int = PARTICLES,
) -> Particles:
    """Draw what is not known, shares that are uniform before, as exp(-squares/2) makes it likely.

    Arguments: squares_of shares, shape (particles, unknowns); circular, which unknowns begin again after 1;
    seed; particles, how many.
    """
    rng = np.random.default_rng(seed)
    unknowns = len(circular)
    x = rng.random((particles, unknowns))
    log = -squares_of(x) / 2
    best, evidence, power = float(-2 * log.max()), 0.0, 0.0
    while power < 1:
        step = _step(log, 1 - power)
        power = min(power + step, 1.0) if step < 1 - power else 1.0
        evidence += float(logsumexp(step * log)) - np.log(particles)
        weight = np.exp(step * log - logsumexp(step * log))
        chosen = np.searchsorted(np.cumsum(weight), (np.arange(particles) + rng.random()) / particles)
        chosen = rng.permutation(np.minimum(chosen, particles - 1))
        x, log = x[chosen], log[chosen]
        for _ in range(MOVES):
            half = particles // 2
            for moved, still in ((slice(0, half), slice(half, None)), (slice(half, None), slice(0, half))):
                proposed, inside = _proposed(x[moved], x[still], circular, rng)
                value = -squares_of(proposed) / 2
                go = inside & (np.log(rng.random(len(value))) < power * (value - log[moved]))
                x[moved] = np.where(go[:, None], proposed, x[moved])
                log[moved] = np.where(go, value, log[moved])
        best = min(best, float(-2 * log.max()))
    return Particles(x, evidence, best)


def _step(log: Array, most: float) -> float:
    """Step of the power that leaves KEPT of the particles."""

    def left(step: float) -> float:
        weight = np.exp(step * (log - log.max()))
        return float(weight.sum() ** 2 / np.square(weight).sum() / len(log) - KEPT)

    return most if left(most) >= 0 else float(brentq(left, 0.0, most, xtol=1e-12, rtol=1e-6))


def _proposed(
    x: Array, others: Array, circular: NDArray[np.bool_], rng: np.random.Generator
) -> tuple[Array, NDArray[np.bool_]]:
    """Particles moved by differences of others, and whether they stay inside."""
    one, other = rng.integers(len(others), size=(2, len(x)))
    apart = others[one] - others[other]
    apart = np.where(circular, (apart + 0.5) % 1 - 0.5, apart)
    size = np.where(rng.random(len(x)) < JUMP, 1.0, rng.uniform(0.3, 1.0, len(x)) * 2.38 / np.sqrt(2 * x.shape[1]))
    moved = x + size[:, None] * apart + JITTER * rng.standard_normal(x.shape)
    moved = np.where(circular, moved % 1, moved)
    inside = np.all((moved >= 0) & (moved <= 1), axis=1)
    return np.clip(moved, 0, 1), inside


def squares(
    drive: Drive,
    response: ErrorTable,
    evidence: Evidence,
    values: Mapping[str, Array],
    scale: Array,
    starts: Array,
) -> Array:
    """Whitened squares of what traces are off by from the curves of many drives, shape (drives,).

    Arguments: drive, what they have in common; values by field, shape (drives,); scale of the error; starts [rad],
    angle of the moving wheel at phi_h = 0, shape (drives, traces).
    """
    kinematics = Kinematics.of(drive)
    turned = carried(drive)
    total = np.zeros(len(scale))
    for k, (trace, rotation) in enumerate(zip(evidence.traces, evidence.rotations_deg, strict=True)):
        there = {**values, **{path: _value(drive, values, path) + rotation for path in turned}}
        still = np.broadcast_to(-trace.phi_h, (1, len(trace.travel), CELLS))
        moving = starts[:, k, None, None] + (trace.travel / kinematics.u)[:, None] + still
        alpha_g, alpha_b = (moving, still) if kinematics.fixed == "rigid" else (still, moving)
        curves = kinematics.error_sign * response.rotation(_scalars(drive, there, alpha_g, alpha_b))
        curves *= scale[:, None, None]
        off = np.einsum("sij,dsj->dsi", evidence.matrices[k], curves, optimize=True) - evidence.targets[k]
        total += np.square(off).sum(axis=(1, 2))
    return total


def _value(drive: Drive, values: Mapping[str, Array], path: str) -> Array:
    return np.asarray(values[path] if path in values else drive.number(path))


def _scalars(drive: Drive, values: Mapping[str, Array], alpha_g: Array, alpha_b: Array) -> Array:
    def column(path: str) -> Array:
        return np.reshape(_value(drive, values, path), (-1, 1, 1))

    return scalars_of(column, drive.mounting.mark_kind, *np.broadcast_arrays(alpha_g, alpha_b))


def curves_of(rotation: Array, kinematics: Kinematics) -> Array:
    """Error [arcsec] over the moving wheel's angle and the cam's, both even over a turn, shape (..., TURNS, TURNS).

    Argument: rotation [arcsec] at the prior's turns, shape (..., TURNS**2).
    """
    field = rotation.reshape(*rotation.shape[:-1], TURNS, TURNS)
    i, k = np.meshgrid(np.arange(TURNS), np.arange(TURNS), indexing="ij")
    moving, still = (i - k) % TURNS, -k % TURNS
    alpha_g, alpha_b = (moving, still) if kinematics.fixed == "rigid" else (still, moving)
    return np.asarray(kinematics.error_sign * field[..., alpha_g, alpha_b])


def log_likelihood(
    curves: Array, evidence: Evidence, scales: Array, u: float, sizes: int, directions: int, far: float = FAR
) -> Array:
    """Log likelihood of the traces, shape (scales, sizes, directions), -inf where it is negligible.

    Arguments: curves over coarse sizes and directions of the offset with the fixed wheel at rotation 0, as curves_of
    gives them; the numbers of fine sizes and directions. Between coarse ones curves are interpolated; where in the
    output's turn a trace began is open.
    """
    rows, columns = curves.shape[:2]
    total = np.zeros((len(scales), sizes, directions))
    for k, trace in enumerate(evidence.traces):
        rows_on = (trace.travel - trace.travel[0]) / u * TURNS / (2 * np.pi)
        part = np.full((len(scales), sizes, directions), -np.inf)
        coarse = [np.asarray(curves @ m.T, dtype=np.float32) for m in evidence.matrices[k]]
        least = _marginal(coarse, evidence.targets[k], rows_on, scales, peak=True).max(axis=0)
        near = least > least.max() - far / 2
        at_size = np.linspace(0, rows - 1, sizes)
        at_direction = np.arange(directions) * columns / directions
        low, first = np.minimum(at_size.astype(int), rows - 2), at_direction.astype(int)
        up, on = at_size - low, at_direction - first
        touched = np.zeros((sizes, directions), dtype=bool)
        for a in (0, 1):
            for b in (0, 1):
                touched |= near[np.ix_(low + a, (first + b) % columns)]
        s, d = np.nonzero(touched)
        fine = []
        for whitened in coarse:
            value = np.zeros((len(s), *whitened.shape[2:]), dtype=np.float32)
            for a, of_size in ((0, 1 - up), (1, up)):
                for b, of_direction in ((0, 1 - on), (1, on)):
                    share = (of_size[s] * of_direction[d]).astype(np.float32)
                    value += share[:, None, None] * whitened[low[s] + a, (first[d] + b) % columns]
            fine.append(value)
        part[:, s, d] = _marginal(fine, evidence.targets[k], rows_on, scales)
        # the wheel turned forward is the offset turned back
        total += _rolled(part, evidence.rotations_deg[k] * directions / 360)
    return total


def _rolled(values: Array, steps: float) -> Array:
    whole, part = divmod(steps, 1)
    first = np.roll(values, int(whole), axis=-1)
    if part < 1e-9:
        return first
    return np.asarray(np.logaddexp(np.log1p(-part) + first, np.log(part) + np.roll(first, 1, axis=-1)))


def _marginal(whitened: Sequence[Single], targets: Array, rows_on: Array, scales: Array, peak: bool = False) -> Array:
    """Log likelihood over all starts, shape (scales, ...); peak: that of the best start instead.

    Arguments: whitened curves of each stretch, shape (..., TURNS, CELLS), whitened targets, shape (stretches, CELLS);
    rows_on, rows of the moving wheel's angle from the first stretch to each.
    """
    shape = whitened[0].shape[:-1]
    along, square = np.zeros((2, 2, *shape))  # for starts at the rows and amid them
    for curve, target, on in zip(whitened, targets, rows_on, strict=True):
        target = target.astype(np.float32)
        to_target, own, both = curve @ target, np.square(curve).sum(-1), (curve * np.roll(curve, -1, -2)).sum(-1)
        for amid in (0, 1):
            whole, part = divmod(on + amid / 2, 1)
            shift = -int(whole)
            a, b = (np.roll(to_target, shift - j, axis=-1) for j in (0, 1))
            along[amid] += (1 - part) * a + part * b
            p, q, r = (np.roll(v, shift - j, axis=-1) for v, j in ((own, 0), (own, 1), (both, 0)))
            square[amid] += (1 - part) ** 2 * p + part**2 * q + 2 * part * (1 - part) * r
    fit = np.array([2 * s * along - s**2 * square for s in scales])
    fit = np.moveaxis(fit, 1, -1).reshape(len(scales), *shape[:-1], -1)
    base = float(np.square(targets).sum())
    if peak:
        return np.asarray((fit.max(axis=-1) - base) / 2)
    return np.asarray(logsumexp(fit / 2, axis=-1) - np.log(fit.shape[-1]) - base / 2)
