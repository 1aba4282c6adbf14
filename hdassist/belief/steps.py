"""What it would take: F'_ior after each step that could be taken on a drive, for a limit that is not surely kept.

Some samples that weigh alike are solved again with the change that a step makes. The logarithm of F'_ior after it is a
line in that before, with the residuals r of these drives, and all samples are carried along it:

(1)  ln F'_i = ln F_i + a + b ln F_i + r_j

A question takes the samples apart by its answers. So one set of samples answers all, within some per cent.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass, replace
from functools import partial
from hashlib import sha256
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hdassist.belief.draws import WITHOUT_EFFECT
from hdassist.belief.influence import influences
from hdassist.belief.prior import DrivePrior, prior_of
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import even_rows, log_error, weighted_quantile
from hdassist.error.error_map import Batch, ErrorMap, Extremes, error_maps, searchable
from hdassist.error.sloped import drawn_extremes
from hdassist.error.waves import WAVE_POINTS, ErrorWaves
from hdassist.errors import HdassistError
from hdassist.model.deviations import carried
from hdassist.model.geometry import Array
from hdassist.model.unknown import no_hole_better, unknown_turn
from hdassist.preset.fields import DEVIATIONS, Drive
from hdassist.preset.knowledge import SUPPORT_FIELD, with_cam_support
from hdassist.run.cache import cached, keep, keeps_answers, program
from hdassist.run.kept import ClosedRecord
from hdassist.run.run import UNCHECKED, Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.walk import walk_library

CHANGED_SAMPLES = 12  # samples that are solved again
THIRD_LESS = 2 / 3  # of a tolerance: a third less
TRIED_HOLES = 4
PHASORS_OFF = 20  # strongest waves, that a controller takes off
FREE_HOLES = 12  # directions where the angle of the seat is free
LEAST_STEP_GAIN = 0.02  # of the probability, or of F'_ior without a limit: a smaller one is no step
ASKED_COUPLINGS = ("oldham", "solid")

StepKind = Literal["hole", "trials", "correction", "tolerance", "coupling", "question", "torque"]


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

    kind: StepKind
    of: str
    outcomes: tuple[Outcome, ...]
    gain: float


@dataclass(frozen=True)
class Changed:
    """F'_ior [arcsec] of a drive now and with each change, by name; None of one that makes no drive."""

    now: float
    after: Mapping[str, float | None]
    proof: Certificate = EMPTY


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
    drive, M_g, left = prior.drive, torques[torque], left_arcsec[torque]
    if not searchable(drive):
        return (), EMPTY
    drives, shares = [drive], np.full((1, 1), 0.5)
    if samples:
        rows = np.argsort(samples.F_ior_arcsec[:, torque], kind="stable")
        rows = rows[even_rows(samples.weights[rows], min(CHANGED_SAMPLES, max(2, len(rows) // 2)))]
        shares = samples.shares[rows]
        drives = [drive.with_values(values) for values in samples.values(rows)]
    changed = _changed(prior, drives, shares, M_g, bool(samples), run)
    now = np.array([each.now for each in changed])
    F_ior, weights = (samples.F_ior_arcsec[:, torque], samples.weights) if samples else (now, np.ones(1))
    judged = partial(_outcome, left=left)
    before, found = judged("", 1.0, F_ior, weights), list[Step]()
    if before.p50 <= 0 or not (now > 0).all():
        return (), sum((each.proof for each in changed), EMPTY)

    def carried_on(after: Array) -> Outcome:
        """Equation (1)."""
        ratio, x = log_error(after) - log_error(now), log_error(now)
        b = np.polyfit(x, ratio, 1)[0] if np.ptp(x) > 0.05 and len(x) > 4 else 0.0
        residual = ratio - b * (x - x.mean())
        moved = np.exp(np.add.outer((1 + b) * log_error(F_ior) - b * x.mean(), residual))
        return judged("", 1.0, moved.ravel(), np.repeat(weights, len(now)))

    def add(kind: StepKind, of: str, *outcomes: Outcome) -> None:
        total = sum(each.chance for each in outcomes)
        one, gain = len(outcomes) == 1, 0.0
        for each in outcomes:
            move = each.p50 / before.p50 - 1
            if before.probability is not None and each.probability is not None:
                move = before.probability - each.probability
            gain += each.chance / total * (-move if one else abs(move))
        if gain >= LEAST_STEP_GAIN:
            found.append(Step(kind, of, outcomes, gain))

    names = [name for name in changed[0].after if all(each.after[name] is not None for each in changed)]
    table = {name: np.array([each.after[name] for each in changed], dtype=float) for name in names}
    holes = {name: carried_on(after) for name, after in table.items() if name.startswith("hole:")}
    if holes and not unknown_turn(drive):
        best = min(holes, key=lambda name: (-(holes[name].probability or 0.0), holes[name].p50))
        add("hole", best.removeprefix("hole:"), holes[best])
    if holes and samples:
        tried = [0, *(int(name.removeprefix("hole:")) for name in holes)]
        tried = [tried[round(k * len(tried) / TRIED_HOLES)] for k in range(min(TRIED_HOLES, len(tried)))]
        least = np.min([now if hole == 0 else table[f"hole:{hole}"] for hole in tried], axis=0)
        add("trials", ",".join(map(str, tried)), carried_on(least))
    couplings = [
        replace(carried_on(table[c]), answer=c, chance=1 / len(ASKED_COUPLINGS)) for c in ASKED_COUPLINGS if c in table
    ]
    if len(couplings) == len(ASKED_COUPLINGS):
        add("question", "cam.coupling", *couplings)
    elif couplings:
        add("coupling", couplings[0].answer, replace(couplings[0], answer="", chance=1.0))
    for name, after in table.items():
        if name == "correction":
            add("correction", str(PHASORS_OFF), carried_on(after))
        elif "." in name:
            add("tolerance", name, carried_on(after))
    for k, other in enumerate(torques):
        room = left_arcsec[k] if left_arcsec[k] is not None else left
        if samples and left is not None and k != torque:
            add("torque", f"{other:g}", _outcome("", 1.0, samples.F_ior_arcsec[:, k], weights, room))
    for path, low, high in _answers(samples, torque, couplings) if samples else ():
        inside = [_outcome(text, float(w.sum() / weights.sum()), F_ior, w, left) for text, w in (low, high)]
        add("question", path, *inside)
    proof = sum((each.proof for each in changed), EMPTY)
    return tuple(sorted(found, key=lambda each: -each.gain)), proof


def _outcome(answer: str, chance: float, F_ior: Array, weights: Array, left: float | None) -> Outcome:
    """F'_ior over weighted samples; left: what a limit leaves it, None without one."""
    p5, p50, p95 = (weighted_quantile(F_ior, weights, share) for share in (0.05, 0.5, 0.95))
    kept = None if left is None else float(weights @ (left >= F_ior) / weights.sum())
    return Outcome(answer, chance, p5, p50, p95, kept)


def _answers(
    samples: Samples, torque: int, couplings: Sequence[Outcome]
) -> Iterator[tuple[str, tuple[str, Array], tuple[str, Array]]]:
    """Fields that F'_ior hangs on, by path, with two answers each, below and above the median: text and weights."""
    paths = [each.path for each in samples.prior.fields]
    values = {each.path: each.value(samples.shares[:, k]) for k, each in enumerate(samples.prior.fields)}
    for each in influences(samples.of_ranges, torque):
        if each.group not in paths or (each.group == SUPPORT_FIELD and len(couplings) > 1):
            continue
        of, weights = values[each.group], samples.weights
        middle = float(f"{weighted_quantile(of, weights, 0.5):.3g}")
        below = of < middle
        if 0 < weights[below].sum() < weights.sum():
            yield each.group, (f"< {middle:g}", weights * below), (f"> {middle:g}", weights * ~below)


def _changed(
    prior: DrivePrior, drives: Sequence[Drive], shares: Array, M_g: float, drawn: bool, run: Run
) -> list[Changed]:
    """Changes of drives at a torque [N*m], kept in the user's cache."""
    supports = _supports(prior, shares)
    depends = {
        "drives": [each.model_dump(mode="json", exclude=WITHOUT_EFFECT) for each in drives],
        "supports": supports, "M_g": M_g, "drawn": drawn, "program": [*program("daqp"), walk_library()[1]],
    }  # fmt: skip
    key = sha256(json.dumps(depends, sort_keys=True).encode()).hexdigest()
    with suppress(ValueError, TypeError, KeyError):
        if keeps_answers() and (data := cached("steps", key)):
            return [Changed(now, after, Certificate(*proof)) for now, after, proof in json.loads(data)]
    every = [{name: values[k] for name, values in supports.items()} for k in range(len(drives))]
    found = list(run.map(partial(_changed_one, M_g=M_g, drawn=drawn), drives, every))
    run.solved(sum(each.proof.states for each in found))
    if keeps_answers():
        keep("steps", key, json.dumps([(each.now, each.after, astuple(each.proof)) for each in found]).encode())
    return found


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
    for coupling in ASKED_COUPLINGS if is_open else ASKED_COUPLINGS[:1]:
        cam = drive.cam.model_copy(update={"coupling": coupling})
        there = with_cam_support(drive.model_copy(update={"cam": cam}))
        support = next((each for each in prior_of(there).fields if each.path == SUPPORT_FIELD), None)
        share = shares[:, place] if place is not None else np.full(len(shares), 0.5)
        found[coupling] = support.value(share).tolist() if support else [there.number(SUPPORT_FIELD)] * len(share)
    return found


def _changed_one(drive: Drive, supports: Mapping[str, float], *, M_g: float, drawn: bool) -> Changed:
    """Changes of one drive: the wheel in other holes, tighter tolerances, another coupling, phasors taken off."""
    holes = drive.mounting.holes or FREE_HOLES
    allowed = range(holes) if drive.mounting.allowed == "all" or not drive.mounting.holes else drive.mounting.allowed
    changes: dict[str, dict[str, float]] = {"": {}}
    if not no_hole_better(drive):
        for hole in allowed:
            if hole % holes:
                turn = 360 * hole / holes
                changes[f"hole:{hole}"] = {path: drive.number(path) + turn for path in carried(drive)}
    for each in DEVIATIONS:
        if each.size.startswith("tolerances.") and drive.number(each.size) > 0:
            changes[each.size] = {each.size: THIRD_LESS * drive.number(each.size)}
    paths = {path for change in changes.values() for path in change} or {"tolerances.F_i1"}
    columns = {path: np.array([c.get(path, drive.number(path)) for c in changes.values()]) for path in paths}
    (error_map,) = error_maps(drive, [M_g])
    searched = _extremes(error_map, Batch(drive, columns), drawn)
    now, proof = searched.first, searched.certificate
    after: dict[str, float | None] = dict(zip(changes, searched.F_ior_arcsec.tolist(), strict=True))
    del after[""]
    waves = ErrorWaves(drive, M_g, UNCHECKED)
    z = waves.waves([drive])[0]
    proof += waves.certificate
    weak = np.argsort(-np.abs(z), kind="stable")[PHASORS_OFF:]
    ranges = [_range(waves.k_g[some], waves.k_b[some], z[some]) for some in (np.arange(len(z)), weak)]
    after["correction"] = now * ranges[1] / ranges[0] if ranges[0] > 0 else 0.0
    for coupling, C_3 in supports.items():
        after[coupling] = None
        with suppress(HdassistError):
            there = drive.with_values({SUPPORT_FIELD: C_3})
            moved = _extremes(error_maps(there, [M_g])[0], Batch.of(there), drawn)
            after[coupling], proof = moved.first, proof + moved.certificate
    return Changed(now, after, proof)


def _extremes(error_map: ErrorMap, batch: Batch, drawn: bool) -> Extremes:
    """Extremes of drives: of drawn ones as samples have them."""
    return drawn_extremes(error_map, batch) if drawn else error_map.many_extremes(batch)


def _range(k_g: NDArray[np.int64], k_b: NDArray[np.int64], z: NDArray[np.complex128]) -> float:
    """Range [arcsec] of a sum of waves over a grid of the torus."""
    spectrum = np.zeros((WAVE_POINTS, WAVE_POINTS), dtype=complex)
    np.add.at(spectrum, (k_g % WAVE_POINTS, k_b % WAVE_POINTS), z)
    return float(np.ptp(np.fft.ifft2(spectrum).real) * WAVE_POINTS**2)
