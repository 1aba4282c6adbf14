"""`hdassist trace`: the error against the cam angle."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.terminal import options as o


@dataclass(frozen=True, kw_only=True)
class TraceCommand(o.PlotOptions, o.PitchOptions, o.DriveOptions):
    """Kinematic error F_kpp against the cam angle, with its orders and their causes.

    \b
    Examples:
      hdassist trace vzp160 --torque 80 --phi-g0 20
      hdassist trace vzp160 --torque 80 -n 100 --csv trace.csv
      hdassist trace my-drive.yaml --set phases.xi_b=260 --json

    One cam revolution has as many states as the fixed wheel has teeth. Orders that differ by the
    flexspline's slow turn come apart over the full cycle only (for 200/202 teeth: -n 100).
    """

    preset: str
    torque: str | None = None
    start: float = 0.0
    revolutions: int = 1
    solver: str | None = None
    cross_check: str = "highs"
    seed: int = 0

    @property
    def changes(self) -> list[str]:
        """All that the options change of a preset, its torque too."""
        return [*super().changes, *o.torque_overrides([self.torque])]

    def report(self, out: o.Output, preset: str) -> o.Report:
        """The trace of a drive."""
        from hdassist.error.trace import trace
        from hdassist.model.kinematics import Kinematics
        from hdassist.pages.curves import trace_report
        from hdassist.terminal.wheels import pitch_files, read_teeth

        files = pitch_files([preset], self)
        drive = self.load(preset)
        measured = read_teeth(files, drive)
        with out.run(drive.name, self.revolutions * Kinematics.of(drive).teeth_fixed, self) as run:
            result = trace(
                drive,
                drive.operation.M_g[0],
                measured=measured,
                start_deg=self.start,
                revolutions=self.revolutions,
                solver=self.solver,
                run=run,
            )
        return trace_report(drive, result, self.seed)
