"""Relations between two recordings of one drive: one file, and what else a rig may have written of the same readings.

A made-up drive is recorded over its full cycle or part of it, and decided at a limit near its error. The same readings
in other sweeps, begun elsewhere, modulo the output revolution, mirrored or in other units answer the same question:
where no reading is lost the number agrees, and no rewriting may turn FAIL or INCONCLUSIVE into PASS.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from hdassist.features.acceptance.decision import AcceptedValue, decide
from hdassist.features.acceptance.limits import F_IOR, Limit
from hdassist.features.measuring.measure import SweepResult, measure
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.errors import HdassistError, Verdict
from tests.fuzz.mutate import Rng
from tests.helpers.rigs import Array, drive_error, text, whole_range

RATIO, PER_TURN = 20.0, 30
STATED = {"encoder": 0.1, "coupling": 0.1, "reseating": 0.1, "temperature": 0.1}
SHARES = (1.0, 1.0, 0.96, 0.6)  # of the full cycle that is recorded
ARCMIN = 60.0  # arcsec


@dataclass(frozen=True)
class Recording:
    """Readings in the order of the file: cam angle [turns], error [arcsec] and torque [N*m], shape (rows,) each.

    names: of the columns; sizes: of their units, in turns, arcsec and N*m.
    """

    turns: Array
    error: Array
    torque: Array
    names: str = "cam_deg,error_arcsec,torque_Nm"
    sizes: tuple[float, float, float] = (1 / 360, 1.0, 1.0)

    def at(self, rows: Array) -> Recording:
        """Return the recording of some of its rows, in their order."""
        return replace(self, turns=self.turns[rows], error=self.error[rows], torque=self.torque[rows])

    def file(self) -> str:
        """Return the text of its file."""
        columns = (self.turns, self.error, self.torque)
        return text([column / size for column, size in zip(columns, self.sizes, strict=True)], self.names, digits=9)


@dataclass(frozen=True)
class RecordingRelation:
    """A recording and another one of the same readings; is_same: whether no reading and no joint is lost."""

    name: str
    first: Recording
    second: Recording
    is_same: bool
    limit_arcsec: float


def recording_of(rng: Rng) -> tuple[Recording, float]:
    """Return a recording of a drive at random, and its F'_ior [arcsec]."""
    curve = drive_error(rng, RATIO, beats=2)
    turns = np.arange(round(RATIO * PER_TURN * rng.choice(SHARES))) / PER_TURN
    noise = rng.choice([0.1, 0.5]) * rng.standard_normal(len(turns))
    torque = np.full(len(turns), 5.0)
    return Recording(turns, curve(turns) + noise, torque), whole_range(curve, RATIO)


def mirrored(recording: Recording, _: Rng) -> Recording:
    """Return the mirror image: angles, errors and torques count the other way."""
    return replace(recording, turns=-recording.turns, error=-recording.error, torque=-recording.torque)


def in_other_units(recording: Recording, _: Rng) -> Recording:
    """Return the recording in radians and arcmin."""
    return replace(recording, names="cam_rad,error_arcmin,torque_Nm", sizes=(1 / (2 * np.pi), ARCMIN, 1.0))


def with_another_zero(recording: Recording, rng: Rng) -> Recording:
    """Return the recording with whole output revolutions more, and another zero of the error."""
    turns = recording.turns + RATIO * rng.integers(1, 4)
    return replace(recording, turns=turns, error=recording.error + rng.uniform(-50, 50))


def with_torque_reversed(recording: Recording, _: Rng) -> Recording:
    """Return the recording with a torque that counts the other way."""
    return replace(recording, torque=-recording.torque)


def begun_elsewhere(recording: Recording, rng: Rng) -> Recording:
    """Return the recording begun at another of its rows: its angles begin again after the last one."""
    count = len(recording.turns)
    return recording.at(np.roll(np.arange(count), -int(rng.integers(count // 10, count - count // 10))))


def in_three_sweeps(recording: Recording, rng: Rng) -> Recording:
    """Return the recording in three sweeps, the last one first, each with a zero of its own."""
    count = len(recording.turns)
    first = int(rng.integers(count // 6, count // 2))
    second = int(rng.integers(first + count // 6, count - count // 6))
    parts = np.split(np.arange(count), [first, second])
    zero = np.repeat(rng.uniform(-5, 5, 3), [len(part) for part in parts])
    return replace(recording, error=recording.error + zero).at(np.concatenate(parts[::-1]))


def in_many_sweeps(recording: Recording, rng: Rng) -> Recording:
    """Return the recording in eight sweeps in any order."""
    parts = np.array_split(np.arange(len(recording.turns)), 8)
    return recording.at(np.concatenate([parts[k] for k in rng.permutation(8)]))


def resampled(recording: Recording, _: Rng) -> Recording:
    """Return every second row."""
    return recording.at(np.arange(0, len(recording.turns), 2))


def cut_short(recording: Recording, rng: Rng) -> Recording:
    """Return the recording without its last part."""
    return recording.at(np.arange(round(rng.uniform(0.5, 0.965) * len(recording.turns))))


def with_a_gap(recording: Recording, rng: Rng) -> Recording:
    """Return the recording without rows in the middle."""
    count = len(recording.turns)
    first = int(rng.integers(count // 10, count // 2))
    return recording.at(np.delete(np.arange(count), slice(first, first + count // 4)))


def between_torques(recording: Recording, _: Rng) -> Recording:
    """Return the recording twice, at torques below and above the one that is asked for."""
    twice = recording.at(np.tile(np.arange(len(recording.turns)), 2))
    return replace(twice, torque=np.repeat([3.0, 7.0], len(recording.turns)))


def shuffled(recording: Recording, rng: Rng) -> Recording:
    """Return the recording with its rows in any order."""
    return recording.at(rng.permutation(len(recording.turns)))


SAME: tuple[Callable[[Recording, Rng], Recording], ...] = (
    mirrored, in_other_units, with_another_zero, with_torque_reversed, begun_elsewhere, in_three_sweeps,
)  # fmt: skip
LESS = (in_many_sweeps, resampled, cut_short, with_a_gap, between_torques, shuffled)


def recording_relations(seed: int) -> Iterator[RecordingRelation]:
    """Yield the relations of one recording, at a limit near F'_ior of its drive."""
    rng = np.random.default_rng([60, seed])
    recording, true_arcsec = recording_of(rng)
    limit_arcsec = true_arcsec * float(rng.choice([0.8, 0.95, 1.02, 1.1]))
    for rewritten in (*SAME, *LESS):
        name = rewritten.__name__.replace("_", " ")
        yield RecordingRelation(name, recording, rewritten(recording, rng), rewritten in SAME, limit_arcsec)


def answer_of(recording: Recording, limit_arcsec: float) -> tuple[Verdict | None, SweepResult | None]:
    """Return the verdict on a recording and its result; None twice if it is refused."""
    try:
        trace = read_trace(io.StringIO(recording.file()), TraceForm())
        found = measure(trace, ratio=RATIO, stated=STATED, M_g=5.0)
    except HdassistError:
        return None, None
    direction = found.directions[0]
    limit = Limit(F_IOR.code, limit_arcsec, 5.0)
    value = AcceptedValue.measured(limit, direction)
    if found.trace.is_between_torques:
        value = AcceptedValue.between_torques()
    return decide(limit, value, "guard", 0.95).verdict, direction


def recording_faults(seed: int) -> Iterator[tuple[str, str]]:
    """Yield the relations of one recording by name, with what its two recordings differ by; empty if they agree."""
    answer = None
    for relation in recording_relations(seed):
        answer = answer or answer_of(relation.first, relation.limit_arcsec)
        yield relation.name, _fault(relation, *answer)


def _fault(relation: RecordingRelation, verdict: Verdict | None, first: SweepResult | None) -> str:
    """Return what the second recording of a relation gives else than the first; empty if they agree."""
    other_verdict, second = answer_of(relation.second, relation.limit_arcsec)
    if other_verdict is Verdict.PASS and verdict is not Verdict.PASS:
        return _unless_within(first, second, f"{verdict} becomes PASS at {relation.limit_arcsec:.2f}")
    if not relation.is_same or first is None:
        return ""
    if second is None:
        return "refused"
    if first.is_bound != second.is_bound:
        return "one of them is a bound"
    return _unless_within(first, second, "")


def _unless_within(first: SweepResult | None, second: SweepResult | None, words: str) -> str:
    """Return how far two values differ; words if they agree within the noise that the bootstrap gives each of them."""
    if first is None or second is None:
        return words
    room = np.hypot(first.uncertainty_arcsec, second.uncertainty_arcsec)
    if words and (first.is_bound or second.is_bound):
        return words
    off = abs(first.range.value - second.range.value)
    return f"{words} {first.range.value:.3f} and {second.range.value:.3f}" if off > room else ""


def study(recordings: int, seed: int) -> bool:
    """Print each relation that does not hold, and how many were asked; whether all hold."""
    asked, violated = 0, 0
    for number in range(seed, seed + recordings):
        for name, found in recording_faults(number):
            asked += 1
            if found:
                violated += 1
                print(f"{number} {name}: {found}", flush=True)
    print(f"{asked} relations of {recordings} recordings, {violated} violated")
    return violated == 0
