"""`hdassist check`: the design check of drives."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.terminal import options as o


@dataclass(frozen=True, kw_only=True)
class CheckCommand(o.PlotOptions, o.SamplingOptions, o.PitchOptions, o.LimitedDriveOptions):
    """Largest kinematic error F'_ior of drives over the full cycle, with verdict and proof.

    \b
    Examples:
      hdassist check vzp160
      hdassist check vzp160 --limit F_ior@80=30
      hdassist check my-drive.yaml --set tolerances.e_hb=60 --json
      hdassist check vzp160 --torque 40 --torque 80 --limit 45
      hdassist check my-drive.yaml --pitch-b wheel.csv --pitch-g flexspline.csv
      hdassist check *.yaml --csv figures.csv -q

    Every state of the cycle is solved and proven. The verdict holds F'_ior with the self error (what a drive without
    deviations does over tooth and ball phase) against --limit, or else the preset's acceptance limits. All inputs that
    are not known exactly are drawn jointly, weighted by the preset's catalogue (docs/unknown.md). PASS: the limit is
    kept with a probability of at least --sure; FAIL: with at most 1 less that; else INCONCLUSIVE.
    Exit codes: 0 PASS or no limit, 3 FAIL, 4 bad preset, 5 no trustworthy answer, 6 INCONCLUSIVE.
    """

    presets: list[str]
    sure: float = 0.95
    solver: str | None = None
    cross_check: str = "highs"

    def report(self, out: o.Output, preset: str) -> o.Report:
        """The design check of a drive."""
        with out.progress(preset) as progress:  # words before numpy is imported
            from hdassist.terminal.wheels import pitch_files, read_teeth

            files = pitch_files(self.presets, self)
            drive = self.load(preset)
            measured = read_teeth(files, drive)
            torques = ", ".join(f"{M_g:g}" for M_g in drive.operation.M_g)
            progress.expect(words := f"{drive.name}, {drive.gears.z_g}/{drive.gears.z_b}, {torques} N·m")
            from hdassist.design.check import check, check_states
            from hdassist.pages.check import check_report

            with out.run(words, check_states(drive, measured, self.draws), self, progress) as run:
                result = check(drive, measured=measured, solver=self.solver, draws=self.draws, sure=self.sure, run=run)
        return check_report(result, self.seed)
