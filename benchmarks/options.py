"""Options of check compared with the edited preset: `python -m benchmarks.options [--seeds 0,1] [--drives csf25,open]`.

Each option, and each answer about the coupling, that is an edit of the preset is carried out: the samples that `check`
would draw for the edited preset, with the same seed, give its probability. A line gives the probability before the
edit, the probability of the option with its interval, and the probability of the edited preset. The summary gives the
mean of the difference with its standard error, and its root mean square, by kind of option, in percentage points.

With --every, all edits are carried out that a user could make, whether check lists them or not: each tolerance and each
harmonic reduced by a third, each coupling, the next accuracy grade and each hole. A line names the best of them, and
the best that check lists.
"""

from __future__ import annotations

import argparse
import math
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from unittest import mock

from hdassist import load_preset
from hdassist.belief import options
from hdassist.belief.edits import COUPLING, SOURCE_REF, coupled, graded, tightened
from hdassist.belief.options import Step, steps_of
from hdassist.belief.prior import prior_of
from hdassist.belief.samples import Samples, drive_samples
from hdassist.drive.error.cycle import self_error
from hdassist.drive.model.deviations import carried, no_hole_better, unknown_turn
from hdassist.drive.preset.fields import Drive, deviation_sizes
from hdassist.drive.solve.answers import EMPTY
from hdassist.run.errors import HdassistError
from hdassist.run.run import Run

SHEET = ("--ratio", "100", "--pitch-diameter", "63.5", "--torque", "67", "--stiffness", "3.1e4,5.0e4,5.7e4")
ACCURATE = (*SHEET, "--lost-motion", "60", "--accuracy", "60")


@dataclass(frozen=True)
class Case:
    """A drive with limits at one torque.

    name: name of the drive or of its preset.
    M_g: torque [N*m].
    limits: limits of F'_ior [arcsec].
    made_by: arguments of `presets new` that make the preset, empty for a preset of the library.
    """

    name: str
    M_g: float
    limits: tuple[float, ...]
    made_by: tuple[str, ...] = ()


CASES = (
    Case("csf25", 6.7, (36, 45), (*ACCURATE, "--coupling", "oldham")),
    Case("csf25-solid", 6.7, (45, 60), (*ACCURATE, "--coupling", "solid")),
    Case("open", 6.7, (36, 48), SHEET),
    Case("size-17-100", 2.4, (42, 50)),
    Case("size-40-100", 26.5, (25, 31)),
    Case("vzp160", 80, (26, 28)),
)


@dataclass(frozen=True)
class Compared:
    """Probabilities of meeting the limit, for an option and for the edited preset.

    kind: kind of the option.
    of: field, or answer to a question.
    before: probability without the option.
    option: probability with the option, as check states it.
    low, high: ends of its interval.
    edited: probability of the edited preset.
    """

    kind: str
    of: str
    before: float
    option: float
    low: float
    high: float
    edited: float

    @property
    def difference(self) -> float:
        """Probability of the option minus that of the edited preset, in percentage points."""
        return 100 * (self.option - self.edited)


@dataclass(frozen=True)
class CarriedOut:
    """An edit of a preset, and the probability of meeting the limit with it.

    name: kind and subject of the edit.
    is_listed: whether check lists it among its options.
    edited: probability of the edited preset.
    """

    name: str
    is_listed: bool
    edited: float


@dataclass(frozen=True)
class Sampled:
    """Samples of a preset.

    samples: the samples.
    room_arcsec: limit minus self error [arcsec].
    probability: probability of meeting the limit.
    """

    samples: Samples
    room_arcsec: float
    probability: float


@dataclass(frozen=True)
class Study:
    """Samples of a preset and of its edits, with one torque, limit and seed.

    preset: name or file of the preset.
    overrides: changes of the preset that set torque and limit.
    run: the run, with the seed.
    probabilities: probabilities of the presets edited so far, by the texts of the edit.
    """

    preset: str
    overrides: tuple[str, ...]
    run: Run
    probabilities: dict[tuple[str, ...], float | None] = field(default_factory=dict)

    def drive(self, edit: Sequence[str] = ()) -> Drive:
        """Return the drive of the preset with an edit; edit: texts of the edit for --set."""
        return load_preset(self.preset, (*self.overrides, *edit))

    def sampled(self, drive: Drive) -> Sampled:
        """Return the samples that `check` draws for a drive, with the probability of meeting the limit."""
        [M_g] = drive.operation.M_g
        [of_torque] = self_error(drive, (M_g,))
        limit = drive.limit(M_g)
        assert limit is not None
        room = limit - of_torque.range_arcsec
        samples = drive_samples(prior_of(drive), [room], run=self.run)
        return Sampled(samples, room, samples.probability_within(room, 0).value)

    @cached_property
    def now(self) -> Sampled:
        """Samples of the preset without an edit."""
        return self.sampled(self.drive())

    @cached_property
    def steps(self) -> tuple[Step, ...]:
        """Options and questions of `check`, without the correction, which is no edit and takes several full cycles."""
        prior = prior_of(self.drive())
        with mock.patch.object(options, "_corrected_step", lambda *_: (None, EMPTY)):
            steps, _ = steps_of(prior, self.now.samples, self.now.samples.torques, 0, [self.now.room_arcsec], self.run)
        return steps

    def edited(self, edit: tuple[str, ...]) -> float | None:
        """Return the probability of the preset with an edit; None if the edited preset has no result.

        edit: texts of the edit for --set.
        """
        if edit not in self.probabilities:
            try:
                self.probabilities[edit] = self.sampled(self.drive(edit)).probability
            except HdassistError:
                self.probabilities[edit] = None
        return self.probabilities[edit]

    def compared(self, most: int) -> Iterator[Compared]:
        """Yield the first options, and the answers about the coupling, with the edited presets.

        most: largest number of options.
        """
        edits = [step for step in self.steps if step.edit]
        questions = [step for step in self.steps if step.is_question and step.of == COUPLING]
        for step in [*edits[:most], *questions]:
            for outcome in step.outcomes:
                edited = self.edited(outcome.edit or step.edit)
                if edited is None or outcome.probability is None:
                    continue
                assert outcome.probability_low is not None and outcome.probability_high is not None
                yield Compared(
                    kind=step.kind,
                    of=outcome.answer or step.of,
                    before=self.now.probability,
                    option=outcome.probability,
                    low=outcome.probability_low,
                    high=outcome.probability_high,
                    edited=edited,
                )

    def carried_out(self) -> Iterator[CarriedOut]:
        """Yield every edit with the probability of the edited preset."""
        listed = {step.edit for step in self.steps if step.edit}
        for name, edit in every_edit(self.drive()):
            edited = self.edited(edit)
            if edited is not None:
                yield CarriedOut(name, edit in listed, edited)


def every_edit(drive: Drive) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Yield the name and the texts for --set of each edit of a drive that a user could make.

    Harmonics are reduced as tolerances are, although drawings do not contain them.
    """
    prior = prior_of(drive)
    for edit in (*tightened(prior), *coupled(prior), *graded(prior)):
        yield edit.name, edit.texts
    for size in prior.fields:
        if size.path in deviation_sizes() and size.path.startswith("harmonics."):
            high = 2 / 3 * size.high
            source = f"source.{size.path}={{kind: assumed, range: [0, {high:.4g}], ref: {SOURCE_REF}}}"
            yield f"harmonic:{size.path}", (f"{size.path}={high / 2:.4g}", source)
    if no_hole_better(drive) or unknown_turn(drive):
        return
    for hole in range(1, drive.mounting.holes):
        turn_deg = 360 * hole / drive.mounting.holes
        known = [path for path in carried(drive) if drive.value(path) is not None]
        yield f"hole:{hole}", tuple(f"{path}={(drive.number(path) + turn_deg) % 360:.6g}" for path in known)


def summary(rows: Sequence[Compared]) -> str:
    """Return the table of number, mean and rms of the differences, and share within the interval, by kind."""
    by_kind = defaultdict(list)
    for row in rows:
        by_kind[row.kind].append(row)
        by_kind["all"].append(row)
    lines = ["| kind | number | mean ± standard error | rms | within the interval |", "| --- | --- | --- | --- | --- |"]
    for kind, some in by_kind.items():
        differences = [row.difference for row in some]
        count = len(differences)
        mean = sum(differences) / count
        rms = math.sqrt(sum(difference**2 for difference in differences) / count)
        # without a second row there is no standard error
        error = math.sqrt(max(rms**2 - mean**2, 0) / (count - 1)) if count > 1 else math.nan
        within = sum(row.low <= row.edited <= row.high for row in some) / count
        lines.append(f"| {kind} | {count} | {mean:+.1f} ± {error:.1f} | {rms:.1f} | {100 * within:.0f} % |")
    return "\n".join(lines)


def best_words(edits: Sequence[CarriedOut]) -> str:
    """Return the best of all edits and the best listed one, with their probabilities, as text."""
    best = max(edits, key=lambda edit: edit.edited)
    listed = max((edit for edit in edits if edit.is_listed), key=lambda edit: edit.edited, default=None)
    of_listed = "no edit is listed" if listed is None else f"best listed {listed.name} {listed.edited:.3f}"
    return f"best of {len(edits)} edits {best.name} {best.edited:.3f}, {of_listed}"


def prepared(case: Case, folder: str) -> str:
    """Return the name of the preset of a drive, or its file after it is made in the folder."""
    if not case.made_by:
        return case.name
    preset = str(Path(folder) / f"{case.name}.yaml")
    made = [sys.executable, "-m", "hdassist", "presets", "new", case.name, *case.made_by, "-o", preset]
    subprocess.run(made, check=True, capture_output=True)
    return preset


def studied(study: Study, head: str, arguments: argparse.Namespace) -> list[Compared]:
    """Return the options of a study with the edited presets, and print each as soon as it is compared.

    head: drive, limit and seed as text.
    arguments: arguments of the command line.
    """
    rows = []
    for row in study.compared(arguments.most):
        rows.append(row)
        stated = f"{row.option:.3f} ({row.low:.3f} to {row.high:.3f})"
        show(f"{head} {row.kind} {row.of}: {row.before:.3f} option {stated} edited {row.edited:.3f}")
    if arguments.every:
        edits = []
        for edit in study.carried_out():
            edits.append(edit)
            show(f"{head} every {edit.name}: {edit.edited:.3f}{' (listed)' if edit.is_listed else ''}")
        if edits:
            show(f"{head} {best_words(edits)}")
    return rows


def show(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def main() -> None:
    """Print each option as soon as it is compared, and then the summary."""
    reader = argparse.ArgumentParser(
        prog="python -m benchmarks.options", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    reader.add_argument("--seeds", default="0,1,2", help="seeds of the samples")
    reader.add_argument("--drives", default=",".join(case.name for case in CASES), help="names of the drives")
    reader.add_argument("--limits", default="1,2", help="1 for the first limit of each drive, 2 for the second")
    reader.add_argument("--most", type=int, default=99, help="options of each check, the first ones")
    reader.add_argument("--every", action="store_true", help="carry out all edits, whether check lists them or not")
    arguments = reader.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for case in CASES:
            if case.name not in arguments.drives.split(","):
                continue
            preset = prepared(case, folder)
            for number in map(int, arguments.limits.split(",")):
                limit = case.limits[number - 1]
                for seed in map(int, arguments.seeds.split(",")):
                    overrides = (f"operation.M_g={case.M_g:g}", f"acceptance.F_ior={limit:g}")
                    study = Study(preset, overrides, Run(seed=seed))
                    rows += studied(study, f"{case.name} {limit:g} seed {seed}", arguments)
    if rows:
        show(summary(rows))


if __name__ == "__main__":
    main()
