"""`hdassist stiffness`: twist against torque, lost motion, K1, K2, K3."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.report.report import Report


@dataclass(frozen=True, kw_only=True)
class StiffnessCommand(o.FigureOptions, o.DriveOptions):
    """Torsional stiffness: twist against torque in both directions, lost motion, K1, K2, K3.

    \b
    Examples:
      hdassist stiffness vzp160
      hdassist stiffness my-drive.yaml --t1 29 --t2 108 --to 250
      hdassist stiffness my-drive.yaml --csv curve.csv -q

    Mesh, rings and balls of the contact model in series with the shell as a tube, without deviations and without
    friction. The segments end at T_1 and T_2 of the preset's catalogue, else where catalogues end them, by the cube of
    the pitch diameter, unless --t1 and --t2 say otherwise. K1, K2, K3 are chords, beside those of the
    preset's catalogue.
    """

    preset: o.Preset
    t1: float | None = None
    t2: float | None = None
    to: float | None = None
    plot: o.Plot = True
    details: o.Details = False
    cross_check: o.CrossCheckOption = "highs"

    def run(self) -> int:
        """Compute the twist over torque; returns the exit code."""
        from hdassist.error.stiffness import stiffness, stiffness_states
        from hdassist.pages.stiffness import stiffness_report
        from hdassist.terminal.runs import give, run_each

        out = self.open()

        def one(name: str) -> Report:
            drive = self.load(name)
            with out.run(drive.name, stiffness_states(), self) as run:
                result = stiffness(drive, T_1=self.t1, T_2=self.t2, T_max=self.to, run=run)
            return stiffness_report(drive, result)

        return give("stiffness", run_each("stiffness", [self.preset], one, self), self, out)
