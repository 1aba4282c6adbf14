"""`hdassist compensate`: how much of the error a stored correction can take off, and the correction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from hdassist.commands.controller_options import ControllerOptions
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.correction.forms import CorrectionForm
    from hdassist.report.report import Report

FORMS = {"phasors": None, "output": "output", "cam": "cam", "half-cam": "half cam turn"}


@dataclass(frozen=True, kw_only=True)
class CompensateCommand(ControllerOptions, o.FigureOptions, o.SamplingOptions, o.LoadedDriveOptions):
    """How much of the error a stored correction can take off, in which form, and the table that does it.

    \b
    Examples:
      hdassist compensate vzp160
      hdassist compensate own.yaml --csv phasors.csv
      hdassist compensate own.yaml --form output --points 720 --csv table.csv
      hdassist compensate vzp160 --torque 80 --torque -80 --details --json

    The error is taken apart: what repeats with the cam, what beats, what other loads change. Then each form that
    controllers store is fitted to it by least squares over the full cycle, for the first torque of the preset, and held
    against the drive as it may be, by all that is not known exactly (docs/unknown.md): at every torque, with the zero
    off, with a lost turn count. Errors are actual less ideal angles of the output, counter-clockwise seen from the cam
    side, from where the cam stands at phi_h = 0. --csv writes the correction; one that may make a drive worse is
    refused (docs/correct.md). Exit codes: 0, 2 wrong options, 4 bad preset, 5 refused or no trustworthy answer.
    """

    preset: o.Preset
    form: Annotated[
        Literal["phasors", "output", "cam", "half-cam"],
        typer.Option(metavar="FORM", help="Form: phasors, or a table over a turn: output, cam, half-cam."),
    ] = "phasors"
    points: Annotated[int, typer.Option(metavar="N", min=2, max=100_000, help="Points of a table.")] = 1500
    each_load: Annotated[bool, typer.Option("--each-load", help="A table of its own for each torque.")] = False
    plot: o.Plot = True
    details: o.Details = False

    def correction_form(self) -> CorrectionForm:
        """The form that is asked for."""
        from hdassist.correction.forms import CorrectionForm

        turn = FORMS[self.form]
        return CorrectionForm(turn, self.points if turn else 0, self.each_load)  # type: ignore[arg-type]

    def run(self) -> int:
        """Compute corrections of the drive; returns the exit code."""
        from functools import partial

        from hdassist.correction.correct import correct
        from hdassist.design.check import check_states
        from hdassist.pages.compensate import compensate_report
        from hdassist.solve.window import in_wide_enough_window
        from hdassist.terminal.files import write_text
        from hdassist.terminal.output import note
        from hdassist.terminal.runs import give, run_each

        out, form = self.open(), self.correction_form()
        target = self.controller_target(form, force=self.force)

        def one(name: str) -> Report:
            drive = self.load(name)
            with out.run(drive.name, 2 * check_states(drive, draws=self.draws), self) as run:
                corrected = partial(correct, form=form, draws=self.draws, run=run)
                result = in_wide_enough_window(drive, corrected)
            if target and not result.chosen.is_refused:
                text, about = self.controller_texts(result, target[0])
                note(about.rstrip())
                write_text(target[1], text, self.force)
            return compensate_report(result)

        return give("compensate", run_each("compensate", [self.preset], one, self, keep_failures=False), self, out)
