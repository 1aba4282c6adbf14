"""`hdassist compare`: a measured trace over the predicted one, or presets beside each other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.report import Report

PRESET_SUFFIXES = (".yaml", ".yml")
OF_TRACES = ("start", "zero", "error_is", "cam_sense")  # options that presets do not have, beside TraceOptions


@dataclass(frozen=True, kw_only=True)
class CompareCommand(o.FigureOptions, o.SamplingOptions, o.SignOptions, o.TraceOptions, o.DriveOptions):
    """A measured trace over the predicted one, and which deviation explains the difference; or presets side by side.

    \b
    Examples:
      hdassist compare own.yaml run.csv --torque 80
      hdassist compare own.yaml run.csv --error-is output-cam --drift linear
      hdassist compare own.yaml run.csv --angle enc1 --second enc2
      hdassist compare own.yaml run.csv --set phases.xi_b=230 --json
      hdassist compare vzp160 own.yaml

    Each deviation, of the cam (wave generator), the rigid wheel (circular spline) or the flexspline, is fitted alone,
    then all together, through the contact model; the page names causes that the record cannot separate.

    A FILE that is a name of the library, or ends in .yaml or .yml, is a preset; anything else is a trace (./NAME for
    one that is called like a preset). Presets: which one to take, and how sure that is; F'_ior and best hole of each,
    at torques that all have, else at the same shares of their rated torques; fields that differ, and which of them does
    most, each changed alone. --torque, --set, --draws, --seed, --jobs are theirs too.
    Exit codes: 0, 4 bad file, 5 orders or a range that the record does not tell, or no trustworthy answer.
    """

    preset: str
    files: list[str]
    torque: str | None = None
    start: str = "fit"
    zero: str | None = None
    plot: bool = True
    details: bool = False

    @property
    def changes(self) -> list[str]:
        """All that the options change of a preset, its torque too."""
        return [*super().changes, *o.torque_overrides([self.torque])]

    def run(self) -> int:
        """Compare; returns the exit code."""
        return self._compare_presets() if any(map(is_preset, self.files)) else self._compare_traces()

    def _compare_traces(self) -> int:
        """Compare measured traces with the drive; returns the exit code."""
        from hdassist.comparing.compare import FIT_STATES, compare, torque_of, zero_of
        from hdassist.pages.compare import comparison_report
        from hdassist.run.run import Run
        from hdassist.terminal.answers import failure
        from hdassist.terminal.runs import give, run_each

        o.stdin_once(*self.files, self.preset)
        out = self.open()
        start, given_zero = o.degrees_or_fit("--phi-g0", self.start), o.degrees_or_fit("--cam-zero", self.zero or "0")
        drive, reading = self.load(self.preset), self.reading()
        M_g = torque_of(drive)

        def one(name: str) -> Report:
            found = reading.measured(name, drive, seed=self.seed, together=True)
            zero = given_zero if self.zero else zero_of(found.trace, drive, start)
            fitted = (start is None, zero is None)
            asked = replace(self.alignment(), start_deg=start or 0.0, zero_deg=zero or 0.0, fitted=fitted)
            with out.progress(f"{drive.name}, {found.trace.file}", FIT_STATES) as progress:
                result = compare(found, drive, M_g=M_g, asked=asked, run=Run(progress=progress))
            return comparison_report(result)

        answers = run_each("compare", self.files, one, self, failed=lambda name, e: failure("compare", e, file=name))
        return give("compare", answers, self, out)

    def _compare_presets(self) -> int:
        """Compare presets; returns the exit code.

        Raises UsageError where traces stand among presets, or options are asked for that belong to traces.
        """
        from hdassist.comparing.drives import at_common_torques, compare_drives, estimate_comparison
        from hdassist.pages.compare import comparison_warnings, drives_report
        from hdassist.terminal.answers import failure
        from hdassist.terminal.output import warn
        from hdassist.terminal.runs import give, run_each

        if traces := [name for name in self.files if not is_preset(name)]:
            words = f"{traces[0]} is taken for a trace, and {next(filter(is_preset, self.files))} for a preset"
            raise UsageError(words, "a preset is a name of the library or a .yaml file; compare presets, or traces")
        plain = all(getattr(self, name) == getattr(type(self), name) for name in OF_TRACES)
        if not plain or self.only(o.TraceOptions) != o.TraceOptions(budget=[]):
            raise UsageError("how a trace is read says nothing of presets", "leave out its options, or name a trace")
        names = [self.preset, *self.files]
        if self.csv is not None:
            raise UsageError("a comparison of presets has no CSV", f"hdassist check {' '.join(names)} --csv FILE")
        o.stdin_once(*names)
        out = self.open()

        def one(_: str) -> Report:
            drives = at_common_torques([self.load(name) for name in names])
            words = ", ".join(drive.name for drive in drives)
            with out.run(words, estimate_comparison(drives, self.draws), self) as run:
                result = compare_drives(drives, draws=self.draws, run=run)
            for text in comparison_warnings(result):
                warn(text)
            return drives_report(result, self.seed)

        schema = "compare-presets"
        answers = run_each(schema, [""], one, self, failed=lambda _, e: failure(schema, e, preset=names[0]))
        return give(schema, answers, self, out)


def is_preset(name: str) -> bool:
    """Whether an argument beside a preset is one too, and no trace: a name of the library, or a YAML file."""
    from hdassist.preset.library import preset_names

    return Path(name).suffix.lower() in PRESET_SUFFIXES or name in preset_names()
