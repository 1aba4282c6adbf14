"""`hdassist compensate`: how much of the error a stored correction can take off, and the correction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from hdassist.commands.controller_options import ControllerOptions
from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.correction.forms import CorrectionForm
    from hdassist.correction.records import RecordedError
    from hdassist.correction.table import RepeatTurn
    from hdassist.preset.fields import Drive
    from hdassist.report.report import Report

FORMS: dict[str, RepeatTurn | None] = {"phasors": None, "output": "output", "cam": "cam", "half-cam": "half cam turn"}


@dataclass(frozen=True, kw_only=True)
class CompensateCommand(ControllerOptions, o.FigureOptions, o.SamplingOptions, o.TraceOptions, o.LoadedDriveOptions):
    """How much of the error a stored correction can take off, in which form, and the table that does it.

    \b
    Examples:
      hdassist compensate vzp160
      hdassist compensate own.yaml --csv phasors.csv
      hdassist compensate own.yaml --form output --points 720 --csv table.csv
      hdassist compensate own.yaml run80.csv run800.csv --each-load --json
      hdassist compensate vzp160 --torque 80 --torque -80 --details --json

    The error is taken apart: what repeats with the cam, what beats, what other loads change. Then each form that
    controllers store is fitted to it by least squares over the full cycle, for the first torque of the preset, and held
    against the drive as it may be, by all that is not known exactly (docs/unknown.md): at every torque, with the zero
    off, with a lost turn count. Errors are actual less ideal angles of the output, counter-clockwise seen from the cam
    side, from where the cam stands at phi_h = 0. --csv writes the correction; one that may make a drive worse is
    refused (docs/correct.md).

    A FILE is a record of the full cycle at a torque of the preset, in their order; then the correction is that of the
    record, in the record's own angles. Exit codes: 0, 2 wrong options, 4 bad file, 5 refused or no trustworthy answer.
    """

    preset: o.Preset
    files: Annotated[
        list[str] | None, typer.Argument(metavar="FILE", help="Records, at each torque of the preset in its order.")
    ] = None
    error_is: Annotated[
        Literal["cam-output", "output-cam"],
        o.trace_option(metavar="SIGN", help="Errors are cam-output (cam/ratio - output) or output-cam."),
    ] = "cam-output"
    cam_sense: Annotated[
        Literal["ccw", "cw"], o.trace_option(metavar="SENSE", help="Sense of angles, seen from the cam: ccw or cw.")
    ] = "ccw"
    kind: Annotated[
        Literal["phasors", "output", "cam", "half-cam"],
        typer.Option("--form", metavar="FORM", help="Form: phasors, or a table over a turn: output, cam, half-cam."),
    ] = "phasors"
    points: Annotated[
        int | None,
        typer.Option(metavar="N", min=2, max=100_000, show_default="1500, of the cam 256", help="Points of a table."),
    ] = None
    each_load: Annotated[bool, typer.Option("--each-load", help="A table of its own for each torque.")] = False
    plot: o.Plot = True
    details: o.Details = False

    def correction_form(self) -> CorrectionForm:
        """The form that is asked for."""
        from hdassist.correction.forms import CAM_POINTS, USUAL_POINTS, CorrectionForm

        turn = FORMS[self.kind]
        usual = USUAL_POINTS[0] if turn == "output" else CAM_POINTS
        return CorrectionForm(turn, (self.points or usual) if turn else 0, self.each_load)

    def records(self, drive: Drive) -> dict[float, RecordedError]:
        """Errors of the records by torque [N*m]. Raises UsageError for more records than torques."""
        from hdassist.comparing.record import ERROR_SIGNS, SENSES, Alignment
        from hdassist.correction.records import recorded_error
        from hdassist.measuring.measure import measure
        from hdassist.measuring.orders import parse_orders
        from hdassist.measuring.uncertainty import parse_stated
        from hdassist.model.kinematics import Kinematics
        from hdassist.readers.trace import read_trace

        files, torques, found = self.files or [], drive.operation.M_g, {}
        if len(files) > len(torques):
            raise UsageError(f"{len(files)} records, but {drive.name} has {len(torques)} torques", "--torque for each")
        orders, stated = parse_orders(self.orders or None), parse_stated(self.budget)
        sign = 1.0 if self.error_is == ERROR_SIGNS[1.0] else -1.0
        asked = Alignment(sign=sign, sense=1.0 if self.cam_sense == SENSES[1.0] else -1.0)
        for name, M_g in zip(files, torques, strict=False):
            trace = read_trace(name, self.form(), abs(Kinematics.of(drive).u))
            result = measure(
                trace, drive=drive, orders=orders, drift=self.drift, stated=stated, seed=self.seed, together=True
            )
            found[M_g] = recorded_error(trace, result.directions[0], drive, asked)
        return found

    def run(self) -> int:
        """Compute corrections of the drive; returns the exit code."""
        from hdassist.correction.correct import correct
        from hdassist.design.check import check_states
        from hdassist.pages.compensate import compensate_report
        from hdassist.terminal.files import write_text
        from hdassist.terminal.output import note
        from hdassist.terminal.runs import give, run_each

        o.stdin_once(*(self.files or []), self.preset)
        out, form = self.open(), self.correction_form()
        target = self.controller_target(form, force=self.force)

        def one(name: str) -> Report:
            drive = self.load(name)
            records = self.records(drive)
            with out.run(drive.name, 2 * check_states(drive, draws=self.draws), self) as run:
                result = correct(drive, form=form, records=records, draws=self.draws, run=run)
            if target and not result.chosen.is_refused:
                text, about = self.controller_texts(result, target[0])
                note(about.rstrip())
                write_text(target[1], text, self.force)
            return compensate_report(result)

        return give("compensate", run_each("compensate", [self.preset], one, self, keep_failures=False), self, out)
