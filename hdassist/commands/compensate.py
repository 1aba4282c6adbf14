"""`hdassist compensate`: how much of the error a stored correction can take off, and the correction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from hdassist.commands.controller_options import ControllerOptions
from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.correction.correct import Correction
    from hdassist.correction.forms import CorrectionForm
    from hdassist.correction.records import RecordedError
    from hdassist.correction.writers import ControllerFormat
    from hdassist.preset.fields import Drive
    from hdassist.report import Report


@dataclass(frozen=True, kw_only=True)
class CompensateCommand(
    ControllerOptions, o.FigureOptions, o.SamplingOptions, o.SignOptions, o.TraceOptions, o.LoadedDriveOptions
):
    """How much of the error a stored correction can take off, in which form, and the table that does it.

    \b
    Examples:
      hdassist compensate vzp160
      hdassist compensate own.yaml --csv phasors.csv
      hdassist compensate own.yaml --form output --points 720 --csv table.csv
      hdassist compensate own.yaml run80.csv run800.csv --each-load --json
      hdassist compensate own.yaml run80.csv --after corrected80.csv
      hdassist compensate run80.csv --ratio 100 --torque 80 --csv phasors.csv
      hdassist compensate run.csv --ratio 100 --torque 80 --form cam --write c=t.h
      hdassist compensate vzp160 --torque 80 --torque -80 --details --json

    The error is taken apart: parts that repeat with the cam, that beat, that other loads change. Then each form that
    controllers store is fitted to it by least squares over the full cycle, for the first torque of the preset, and held
    against the drive as it may be, by all that is not known exactly (docs/unknown.md): at every torque, with the zero
    off, with a lost turn count. Errors are actual less ideal angles of the output, counter-clockwise seen from the cam
    side, from where the cam stands at phi_h = 0. --csv writes the correction; one that may make a drive worse is
    refused (docs/correct.md).

    A FILE is a record at a torque of the preset, in their order; then the correction is that of the record: of the full
    cycle in the record's own angles, of part of it by the drives of the preset that agree, in the preset's angles.
    With --ratio in place of a preset one FILE, of the full cycle at the one --torque, gives phasors with uncertainties,
    or a table. Two encoders then count the same way, both seen from the cam side; a column of errors needs
    --output-turns for a table over the output.
    --after has a record with the correction of the same options on: whether the promise is kept, or the likely cause.
    Exit codes: 0, 2 wrong options, 3 promise not kept, 4 bad file, 5 refused or no trustworthy answer, 6 open.
    """

    preset: str
    files: list[str] | None = None
    ratio: float | None = None
    form: Literal["phasors", "output", "cam", "half-cam"] = "phasors"
    points: int | None = None
    output_turns: Literal["with", "against"] | None = None
    each_load: bool = False
    after: str | None = None
    plot: bool = True
    details: bool = False

    def correction_form(self) -> CorrectionForm:
        """The form that is asked for."""
        from hdassist.correction.forms import CAM_POINTS, USUAL_POINTS, CorrectionForm

        if self.form == "phasors":
            return CorrectionForm(None, self.points or 0, self.each_load)
        usual = USUAL_POINTS if self.form == "output" else CAM_POINTS
        return CorrectionForm(self.form, self.points or usual, self.each_load)

    def recorded(
        self, file: str, drive: Drive, M_g: float | None = None, *, may_be_noise: bool = False
    ) -> RecordedError:
        """Error of a record of the drive, at a torque M_g [N*m] where it is its own; may_be_noise as of `measure`."""
        from hdassist.correction.records import recorded_error, require_sense

        found = self.reading().measured(file, drive, seed=self.seed, together=True, may_be_noise=may_be_noise)
        if M_g is not None:
            require_sense(found, drive, M_g, self.alignment())
        return recorded_error(found, drive, self.alignment())

    def records(self, drive: Drive) -> dict[float, RecordedError]:
        """Errors of the records by torque [N*m]. Raises UsageError for more records than torques."""
        files, torques = self.files or [], drive.operation.M_g
        if len(files) > len(torques):
            raise UsageError(f"{len(files)} records, but {drive.name} has {len(torques)} torques", "--torque for each")
        return {M_g: self.recorded(name, drive, M_g) for M_g, name in zip(torques, files, strict=False)}

    def of_record(self, file: str) -> Report:
        """Correction of a record without a preset. Raises UsageError for options that need one."""
        from hdassist.correction.correct import correction_alone
        from hdassist.pages.compensate import compensate_report
        from hdassist.preset.similarity import option_value

        remedy = "more needs a preset: hdassist compensate PRESET FILE..."
        if len(self.torque) != 1 or self.files:
            raise UsageError("--ratio takes one FILE and its --torque", remedy)
        if self.after or self.overrides or self.each_load:
            raise UsageError("--ratio goes without --after, --set and --each-load", remedy)
        form = self.correction_form()
        target = self.controller_target(form, force=self.force)
        M_g = option_value("--torque", self.torque[0], "N*m")
        found = self.reading().measured(file, None, self.ratio, seed=self.seed, together=True)
        result = correction_alone(found, self.alignment(), M_g, form, self.output_turns)
        self.write_controller(result, target)
        return compensate_report(result, is_written=bool(self.csv or target), warnings=found.warnings)

    def write_controller(self, result: Correction, target: tuple[ControllerFormat, str] | None) -> None:
        """Write the controller's file of a correction, where one is asked for and the correction is not refused."""
        from hdassist.terminal.files import write_text
        from hdassist.terminal.output import note

        if target and not result.chosen.is_refused:
            text, about = self.controller_texts(result, target[0])
            note(about.rstrip())
            write_text(target[1], text, self.force)

    def report(self, out: o.Output, preset: str) -> Report:
        """Corrections of the drive, or of a record alone."""
        from hdassist.correction.correct import correct, verify
        from hdassist.design.check import check_states
        from hdassist.pages.compensate import compensate_report, verified_report

        o.stdin_once(*(self.files or []), preset, self.after)
        if self.ratio is not None:
            return self.of_record(preset)
        if preset.endswith(".csv"):
            raise UsageError(f"{preset} is no preset", "a record alone needs the --ratio of its drive")
        form = self.correction_form()
        target = self.controller_target(form, force=self.force)
        drive = self.load(preset)
        records = self.records(drive)
        after = self.recorded(self.after, drive, may_be_noise=True) if self.after else None
        with out.run(drive.name, 2 * check_states(drive, draws=self.draws), self) as run:
            result = correct(drive, form=form, records=records, draws=self.draws, run=run)
            if after and not result.chosen.is_refused:
                return verified_report(result, verify(result, after, run))
        self.write_controller(result, target)
        return compensate_report(result, is_written=bool(target or self.csv))
