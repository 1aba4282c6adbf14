"""Which inputs the spread of F'_ior comes from, what to measure next, and what it would take to keep a limit.

Influence is a weighted stepwise regression of ln F'_ior over the samples. The size and the direction of a deviation are
one group. Groups enter one after the other, the one that explains most first, as long as chance alone would hardly
explain as much; each has the share of the variance that it adds, less that which as many columns of chance would add.
The rest is unexplained: products of inputs, bends that no square follows. A measurement is taken alone: the share of
the variance that its columns explain of all of it.

A step changes the drive: some samples that weigh alike are solved again with it. The logarithm of F'_ior after it is a
line in that before, with the residuals r of these drives, and all samples are carried along it:

(1)  ln F'_i = ln F_i + a + b ln F_i + r_j

A question takes the samples apart by its answers. So one set of samples answers all, within some per cent.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter
from scipy.special import fdtrc

from hdassist.belief.evidence import evidence_of
from hdassist.belief.prior import DrivePrior, prior_of
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import effective_number, even_rows, log_error, weighted_quantile
from hdassist.error.cycle import WITHOUT_EFFECT
from hdassist.error.error_map import Batch, ErrorMap, Extremes, error_maps, searchable
from hdassist.error.extremes import DRAWN_GRIDS, FINE_GRIDS, many_extremes
from hdassist.error.waves import WAVE_POINTS, ErrorWaves
from hdassist.errors import HdassistError
from hdassist.model.deviations import carried, no_hole_better, unknown_turn
from hdassist.model.geometry import Array
from hdassist.preset.fields import DEVIATIONS, Drive
from hdassist.preset.knowledge import SUPPORT_FIELD, with_cam_support
from hdassist.run.kept import ClosedRecord, kept_answer
from hdassist.run.run import UNCHECKED, Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.walk import digits_depend_on

_CHANCE_OF_INFLUENCE = 0.05  # of any group at all to enter where none has an influence
# what single teeth do depends on all of these together, not on one: columns of them would be chance
_ONE_OF_MANY = frozenset(each.direction for each in DEVIATIONS if each.kind == "pitch")
_INDEPENDENT = 1e-8  # of a column's length, below which the part of it that is new is rounding


@dataclass(frozen=True)
class Influence:
    """Share of the variance of ln F'_ior that comes from a group of fields, by the path of its first."""

    group: str
    share: float


def influences(samples: Samples, torque: int) -> tuple[Influence, ...]:
    """Shares of the variance of ln F'_ior at a torque, by its place, the largest first.

    The rest to 1 is unexplained. Empty where samples are too few, or F'_ior does not vary.
    """
    return influences_on(samples, log_error(samples.F_ior_arcsec[:, torque]))


def influences_on(samples: Samples, y: Array) -> tuple[Influence, ...]:
    """Shares of the variance of another result of the samples, shape (samples,), the largest first."""
    groups = {name: columns_of(samples, samples.shares, name) for name in _groups_of(samples)}
    return shares_of_variance(groups, y, samples.weights)


def _groups_of(samples: Samples) -> tuple[str, ...]:
    """Groups of the fields of samples, by path, in the order of the preset."""
    return tuple(dict.fromkeys(each.group for each in samples.prior.fields))


def columns_of(samples: Samples, shares: Array, group: str) -> Array:
    """Columns of a regression that a group of fields makes of its shares, shape (samples, columns).

    A number and its square; sine and cosine of a direction that is unknown, times the size where that is not
    known either. None of single teeth whose size is known.
    """
    columns, size = [], np.ones(len(shares))
    for k, each in enumerate(samples.prior.fields):
        if each.group == group and not each.is_any_direction:
            x = 2 * shares[:, k] - 1
            columns += [x, x**2]
            size = shares[:, k] if each.path == group else size
    for k, each in enumerate(samples.prior.fields):
        if each.group == group and each.is_any_direction and each.path not in _ONE_OF_MANY:
            turn = 2 * np.pi * shares[:, k]
            columns += [size * np.cos(turn), size * np.sin(turn)]
    return np.array(columns).reshape(-1, len(shares)).T


def shares_of_variance(groups: Mapping[str, Array], y: Array, weights: Array) -> tuple[Influence, ...]:
    """Shares of the weighted variance of y, shape (samples,), that groups of columns add, the largest first."""
    root = np.sqrt(weights / weights.sum())[:, None]
    basis = root / np.linalg.norm(root)
    rest = _orthogonal_to(basis, root * y[:, None])
    whole, free = float(np.sum(rest**2)), effective_number(weights) - 1
    if whole <= 1e-18:
        return ()
    left = {name: root * columns for name, columns in groups.items()}
    found: list[Influence] = []
    while left:
        candidates = {name: _explained_by(columns, basis, rest, free) for name, columns in left.items()}
        best = min((chance, -gain, name) for name, (_, gain, chance) in candidates.items())[2]
        directions, gain, chance = candidates[best]
        if chance > _CHANCE_OF_INFLUENCE / len(groups):
            break
        found.append(Influence(best, gain / whole))
        basis = np.hstack([basis, directions])
        rest = _orthogonal_to(basis, rest)
        free -= directions.shape[1]
        del left[best]
    return tuple(sorted(found, key=lambda each: -each.share))


def _explained_by(columns: Array, basis: Array, rest: Array, free: float) -> tuple[Array, float, float]:
    """New directions of columns beside a basis, shares explained of the squares of a rest, and probability by chance.

    The share is less that of as many columns of chance; the probability is that of chance alone explaining
    as much (F test). Argument: free, degrees of freedom of the rest.
    """
    u, size, _ = np.linalg.svd(_orthogonal_to(basis, columns), full_matrices=False)
    directions = u[:, size > _INDEPENDENT * np.linalg.norm(columns)]
    count, remaining = directions.shape[1], float(np.sum(rest**2))
    if count == 0 or free - count < 1:
        return directions, 0.0, 1.0
    gain = float(np.sum((directions.T @ rest) ** 2))
    left = max((remaining - gain) / (free - count), 1e-30)
    return directions, gain - count * left, float(fdtrc(count, free - count, gain / count / left))


def _orthogonal_to(basis: Array, columns: Array) -> Array:
    """The part of columns that is orthogonal to a basis."""
    return columns - basis @ (basis.T @ columns)


@dataclass(frozen=True)
class MeasurementGain:
    """A measurement, by the path of a field or as `stiffness.K_1`, and the share of the spread that it takes off."""

    measured: str
    gain: float


def measurements(samples: Samples, torque: int) -> tuple[MeasurementGain, ...]:
    """Measurements by the share of the spread of ln F'_ior at a torque, by its place, that each takes off, best first.

    Each is taken as the only one, and as exact: a group of fields, or a stiffness that was not measured yet.
    """
    columns = {name: columns_of(samples, samples.shares, name) for name in _groups_of(samples)}
    known = {each.figure for each in evidence_of(samples.prior.drive) if each.path.startswith("measured.")}
    for name in [each for each in samples.figures if each not in known]:
        x = log_error(samples.figures[name])
        columns[f"stiffness.{name}"] = np.stack([x, x**2], axis=1)
    y = log_error(samples.F_ior_arcsec[:, torque])
    found = {name: shares_of_variance({name: some}, y, samples.weights) for name, some in columns.items()}
    gains = [MeasurementGain(name, 1 - float(np.sqrt(1 - each[0].share))) for name, each in found.items() if each]
    return tuple(sorted(gains, key=lambda each: -each.gain))


_CHANGED_SAMPLES = 12  # samples that are solved again
_ASKED_OF = 3  # drives, of which two are solved with another coupling: each is another contact system
_GRID_OF_WAVES = 24  # points around each wheel by which phasors are taken off: the rest is known within 5 %
_FEWEST_OF_LINE, _LEAST_SPAN = 5, 0.05  # drives that a line is put through, and span of ln F'_ior: else the mean alone
_THIRD_LESS = 2 / 3  # of a tolerance: a third less
_TRIED_HOLES = 4
_PHASORS_OFF = 20  # strongest waves, that a controller takes off
_FREE_HOLES = 12  # directions where the angle of the seat is free
_LEAST_STEP_GAIN = 0.02  # of the probability, or of F'_ior without a limit: a smaller one is no step
_ASKED_COUPLINGS = ("oldham", "solid")

_StepKind = Literal["hole", "trials", "correction", "tolerance", "coupling", "question", "torque"]
_ALONE: tuple[_StepKind, ...] = ("trials", "tolerance", "correction")  # of whose changes each is a step by itself


@dataclass(frozen=True)
class Outcome(ClosedRecord):
    """F'_ior [arcsec] after a step, or with one answer to a question: percentiles, probability of keeping the limit.

    answer, in the words or number of a preset, empty of a step; chance of that answer; probability None without limit.
    """

    answer: str
    chance: float
    p5: float
    p50: float
    p95: float
    probability: float | None


@dataclass(frozen=True)
class Step(ClosedRecord):
    """A step on a drive and what comes of it.

    kind; of: hole to go to, holes to try, number of phasors, path of the field, coupling, or torque [N*m]; outcomes, of
    a question one an answer; gain: mean move of the probability of keeping the limit, or without one of the median of
    F'_ior, as a share of it.
    """

    kind: _StepKind
    of: str
    outcomes: tuple[Outcome, ...]
    gain: float


@dataclass(frozen=True)
class _Changed:
    """F'_ior [arcsec] of a drive now and with each change that was tried; None of one that makes no drive.

    after: by kind and name of the step, like "hole:4".
    """

    now: float
    after: Mapping[str, float | None]
    proof: Certificate = EMPTY


_CHANGED = TypeAdapter(list[_Changed])


def steps_of(
    prior: DrivePrior,
    samples: Samples | None,
    torques: Sequence[float],
    torque: int,
    left_arcsec: Sequence[float | None],
    run: Run = Run(),
) -> tuple[tuple[Step, ...], Certificate]:
    """Steps on a drive at one of its torques [N*m], by its place, by their gain, the greatest first, and their proof.

    Arguments: samples of its prior, None where all is known; left_arcsec, what a limit leaves F'_ior at each torque,
    None without one. No steps of drives with rolling balls. Raises UntrustedError where a state cannot be trusted.
    """
    drive = prior.drive
    if not searchable(drive):
        return (), EMPTY
    drives, shares = [drive], np.full((1, 1), 0.5)
    if samples:
        rows = np.argsort(samples.F_ior_arcsec[:, torque], kind="stable")
        rows = rows[even_rows(samples.weights[rows], min(_CHANGED_SAMPLES, max(2, len(rows) // 2)))]
        shares = samples.shares[rows]
        drives = [drive.with_values(values) for values in samples.values(rows)]
    changed = _changed(prior, drives, shares, torques[torque], bool(samples), run)
    proof = sum((each.proof for each in changed), EMPTY)
    if not all(each.now > 0 for each in changed):
        return (), proof
    now = np.array([each.now for each in changed])
    F_ior, weights = (samples.F_ior_arcsec[:, torque], samples.weights) if samples else (now, np.ones(1))
    before = _Before(F_ior, weights, changed, left_arcsec[torque])
    found = [Step(*each, before.gain(each[2])) for each in _steps(prior, samples, torques, torque, left_arcsec, before)]
    return tuple(sorted((s for s in found if s.gain >= _LEAST_STEP_GAIN), key=lambda each: -each.gain)), proof


@dataclass(frozen=True)
class _Before:
    """F'_ior [arcsec] over weighted samples before any step, changes of some, and what a limit leaves it, if any."""

    F_ior: Array
    weights: Array
    changed: Sequence[_Changed]
    left: float | None

    def answered(self, answer: str = "", inside: NDArray[np.bool_] | bool = True) -> Outcome:
        """F'_ior without any change, of the samples that have an answer, with its chance."""
        chosen = self.weights * inside
        return _outcome(answer, float(chosen.sum() / self.weights.sum()), self.F_ior, chosen, self.left)

    def carried(self, name: str, answer: str = "", chance: float = 1.0) -> Outcome:
        """F'_ior over all samples by that of the drives which a change was tried on, by its name: equation (1)."""
        x, y = log_error(np.array([(each.now, each.after[name]) for each in self.changed if name in each.after])).T
        b = np.polyfit(x, y - x, 1)[0] if np.ptp(x) > _LEAST_SPAN and len(x) >= _FEWEST_OF_LINE else 0.0
        residual = y - x - b * (x - x.mean())
        moved = np.exp(np.add.outer((1 + b) * log_error(self.F_ior) - b * x.mean(), residual))
        return _outcome(answer, chance, moved.ravel(), np.repeat(self.weights, len(x)), self.left)

    def gain(self, outcomes: Sequence[Outcome]) -> float:
        """Mean move of the probability of keeping the limit, or of the median as a share; of a question either way."""
        now, total, gain = self.answered(), sum(each.chance for each in outcomes), 0.0
        for each in outcomes:
            move = 1 - each.p50 / now.p50
            if now.probability is not None and each.probability is not None:
                move = each.probability - now.probability
            gain += each.chance / total * (move if len(outcomes) == 1 else abs(move))
        return gain


def _steps(
    prior: DrivePrior,
    samples: Samples | None,
    torques: Sequence[float],
    torque: int,
    left_arcsec: Sequence[float | None],
    before: _Before,
) -> Iterator[tuple[_StepKind, str, tuple[Outcome, ...]]]:
    """Steps with their outcomes: the kind, of which hole, field or torque, and one outcome or those of the answers."""
    asked: dict[str, dict[str, str]] = {}
    for name in before.changed[0].after:
        kind, _, of = name.partition(":")
        if None not in (each.after.get(name, 0.0) for each in before.changed):
            asked.setdefault(kind, {})[of] = name
    holes = {of: before.carried(name) for of, name in asked.get("hole", {}).items()}
    if holes and not unknown_turn(prior.drive):
        best = min(holes, key=lambda hole: (-(holes[hole].probability or 0.0), holes[hole].p50))
        yield "hole", best, (holes[best],)
    for kind in _ALONE:
        for of, name in asked.get(kind, {}).items():
            yield kind, of, (before.carried(name),)
    couplings = asked.get("coupling", {})
    if len(couplings) == len(_ASKED_COUPLINGS):
        coupled = (before.carried(name, of, 1 / len(couplings)) for of, name in couplings.items())
        yield "question", "cam.coupling", tuple(coupled)
    else:
        for of, name in couplings.items():
            yield "coupling", of, (before.carried(name),)
    if not samples:
        return
    for k, M_g in enumerate(torques):
        room = before.left if left_arcsec[k] is None else left_arcsec[k]
        if before.left is not None and k != torque:
            yield "torque", f"{M_g:g}", (_outcome("", 1.0, samples.F_ior_arcsec[:, k], samples.weights, room),)
    paths = {each.path: k for k, each in enumerate(samples.prior.fields)}
    for each in influences(samples.of_ranges, torque):
        if each.group in paths and (each.group != SUPPORT_FIELD or len(couplings) < len(_ASKED_COUPLINGS)):
            x = samples.prior.fields[paths[each.group]].value(samples.shares[:, paths[each.group]])
            middle = float(f"{weighted_quantile(x, samples.weights, 0.5):.3g}")
            sides = {f"< {middle:g}": x < middle, f"> {middle:g}": x >= middle}
            answers = [before.answered(text, side) for text, side in sides.items() if samples.weights[side].any()]
            if len(answers) == len(sides):
                yield "question", each.group, tuple(answers)


def _outcome(answer: str, chance: float, F_ior: Array, weights: Array, left: float | None) -> Outcome:
    """F'_ior over weighted samples; left: what a limit leaves it, None without one."""
    p5, p50, p95 = (weighted_quantile(F_ior, weights, share) for share in (0.05, 0.5, 0.95))
    kept = None if left is None else float(weights @ (left >= F_ior) / weights.sum())
    return Outcome(answer, chance, p5, p50, p95, kept)


def _changed(
    prior: DrivePrior, drives: Sequence[Drive], shares: Array, M_g: float, drawn: bool, run: Run
) -> list[_Changed]:
    """Changes of drives at a torque [N*m], kept in the user's cache."""
    supports = _supports(prior, shares)
    depends = {
        "drives": [each.model_dump(mode="json", exclude=WITHOUT_EFFECT) for each in drives],
        "supports": supports, "M_g": M_g, "drawn": drawn, "program": digits_depend_on(),
    }  # fmt: skip

    def changed() -> list[_Changed]:
        every = [{name: of[k] for name, of in supports.items() if k % _ASKED_OF != 1} for k in range(len(drives))]
        one = partial(_changed_one, M_g=M_g, drawn=drawn, every_hole=not unknown_turn(prior.drive))
        found = list(run.map(one, drives, every))
        run.solved(sum(each.proof.states for each in found))
        return found

    return kept_answer("steps", depends, _CHANGED, changed)


def _supports(prior: DrivePrior, shares: Array) -> dict[str, list[float]]:
    """Stiffness of the cam's support of drives [N/mm], by the coupling that they could have.

    A solid hub is no other design where the coupling is known, or its support.
    """
    drive = prior.drive
    place = next((k for k, each in enumerate(prior.fields) if each.path == SUPPORT_FIELD), None)
    is_open = drive.cam.coupling == "unknown" and place is not None
    if drive.cam.coupling == "oldham" or not drive.number(SUPPORT_FIELD):
        return {}
    found = {}
    for coupling in _ASKED_COUPLINGS if is_open else _ASKED_COUPLINGS[:1]:
        there = with_cam_support(drive.with_values({"cam.coupling": coupling}))
        support = next((each for each in prior_of(there).fields if each.path == SUPPORT_FIELD), None)
        share = shares[:, place] if place is not None else np.full(len(shares), 0.5)
        found[coupling] = support.value(share).tolist() if support else [there.number(SUPPORT_FIELD)] * len(share)
    return found


def _changed_one(drive: Drive, supports: Mapping[str, float], *, M_g: float, drawn: bool, every_hole: bool) -> _Changed:
    """Changes of one drive: the wheel in other holes, tighter tolerances, another coupling, phasors taken off.

    every_hole: whether the best hole is asked for, not only what trying some brings.
    """
    holes, usable = drive.mounting.holes or _FREE_HOLES, _usable_holes(drive)
    tried = _apart(usable)
    changes: dict[str, dict[str, float]] = {"": {}}
    for hole in usable if every_hole else tried:
        if hole == 0:
            continue  # as the drive is
        changes[f"hole:{hole}"] = {path: drive.number(path) + 360 * hole / holes for path in carried(drive)}
    for each in DEVIATIONS:
        if each.size.startswith("tolerances.") and drive.number(each.size) > 0:
            changes[f"tolerance:{each.size}"] = {each.size: _THIRD_LESS * drive.number(each.size)}
    paths = {path for change in changes.values() for path in change} or {"tolerances.F_i1"}
    columns = {path: np.array([c.get(path, drive.number(path)) for c in changes.values()]) for path in paths}
    (error_map,) = error_maps(drive, [M_g])
    searched = _extremes(error_map, Batch(drive, columns), drawn)
    F_ior = dict(zip(changes, searched.F_ior_arcsec.tolist(), strict=True))
    now = F_ior.pop("")
    after: dict[str, float | None] = {**F_ior}
    if drawn and len(tried) > 1:
        least = min(now if hole == 0 else F_ior[f"hole:{hole}"] for hole in tried)
        after[f"trials:{','.join(map(str, tried))}"] = least
    waves = ErrorWaves(drive, M_g, UNCHECKED, error_map)
    z = waves.waves([drive], _GRID_OF_WAVES)[0]
    weak = np.argsort(-np.abs(z), kind="stable")[_PHASORS_OFF:]
    whole, left = (_range(waves.k_g[some], waves.k_b[some], z[some]) for some in (np.arange(len(z)), weak))
    after[f"correction:{_PHASORS_OFF}"] = now * left / whole if whole > 0 else 0.0
    proof = searched.certificate + waves.certificate
    for coupling, C_3 in supports.items():
        after[f"coupling:{coupling}"] = None
        with suppress(HdassistError):
            there = drive.with_values({SUPPORT_FIELD: C_3})
            moved = _extremes(error_maps(there, [M_g])[0], Batch.of(there), drawn)
            after[f"coupling:{coupling}"], proof = moved.first, proof + moved.certificate
    return _Changed(now, after, proof)


def _usable_holes(drive: Drive) -> list[int]:
    """Return the holes that the fixed wheel may be put in, of a free seat directions; none if no hole is better."""
    if no_hole_better(drive):
        return []
    if not drive.mounting.holes:
        return list(range(_FREE_HOLES))
    if drive.mounting.allowed == "all":
        return list(range(drive.mounting.holes))
    return sorted(drive.mounting.allowed)


def _apart(holes: Sequence[int]) -> list[int]:
    """Return up to _TRIED_HOLES of some holes, as far apart as they can be."""
    count = min(_TRIED_HOLES, len(holes))
    return [holes[round(k * len(holes) / count)] for k in range(count)]


def _extremes(error_map: ErrorMap, batch: Batch, drawn: bool) -> Extremes:
    """Extremes of drives: of drawn ones as samples have them."""
    return many_extremes(error_map, batch, DRAWN_GRIDS if drawn else FINE_GRIDS)


def _range(k_g: NDArray[np.int64], k_b: NDArray[np.int64], z: NDArray[np.complex128]) -> float:
    """Range [arcsec] of a sum of waves over a grid of the torus."""
    spectrum = np.zeros((WAVE_POINTS, WAVE_POINTS), dtype=complex)
    np.add.at(spectrum, (k_g % WAVE_POINTS, k_b % WAVE_POINTS), z)
    return float(np.ptp(np.fft.ifft2(spectrum).real) * WAVE_POINTS**2)
