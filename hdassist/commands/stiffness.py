"""`hdassist stiffness`: twist against torque, lost motion, K1, K2, K3."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.terminal import options as o


@dataclass(frozen=True, kw_only=True)
class StiffnessCommand(o.PlotOptions, o.DriveOptions):
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

    preset: str
    t1: float | None = None
    t2: float | None = None
    to: float | None = None
    cross_check: str = "highs"

    def report(self, out: o.Output, preset: str) -> o.Report:
        """The twist over torque."""
        with out.progress(preset) as progress:  # words before numpy is imported
            from hdassist.error.stiffness import stiffness, stiffness_states
            from hdassist.pages.curves import stiffness_report

            drive = self.load(preset)
            with out.run(drive.name, stiffness_states(), self, progress) as run:
                return stiffness_report(drive, stiffness(drive, T_1=self.t1, T_2=self.t2, T_max=self.to, run=run))
