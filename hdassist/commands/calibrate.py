"""`hdassist calibrate`: values of a preset found from targets."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hdassist.terminal import options as o


@dataclass(frozen=True, kw_only=True)
class CalibrateCommand(o.AnswerOptions, o.DriveOptions):
    """Find stiffnesses, clearances or any other measures of a preset from measured values of the drive.

    \b
    Examples:
      hdassist calibrate own.yaml --targets rig.yaml --write found.yaml

    \b
    A targets file:
      schema: hdassist.targets/1
      name: acceptance rig, drive 17
      unknowns:
        gears.j_n: {low: 0, high: 20}
        supports.C_2:     # within its range in the preset's source
      targets:
        - {quantity: F_ior, M_g: 80, phase: 180, value: 20.1, tolerance: 0.5}
        - {quantity: K_1, value: 50e4, tolerance: 10 %}
        - {quantity: self_error, M_g: 80, low: 0.25, high: 2.0}

    Quantities: F_ior, F_ior_max and F_ior_min (over the mounting phase), self_error, K_1, K_2, K_3 and lost_motion (as
    hdassist stiffness has them). Drives spread evenly over the bounds, then least squares from the best ones that lie
    apart; every set that meets the targets is kept, and where none does, targets and bounds in the way are named
    and --write writes no file. Exit codes: 0 all targets are met, 3 one is missed, 5 the fit did
    not come to rest.
    """

    preset: str
    targets: Path
    write: str | None = None
    evaluations: int = 128
    seed: int = 0
    jobs: int = 0
    details: bool = False

    def report(self, out: o.Output, preset: str) -> o.Report:
        """The values, found and written where that is asked for."""
        from hdassist.calibration import calibrate, estimate_drives, read_targets
        from hdassist.errors import UsageError
        from hdassist.files import read_bytes
        from hdassist.loading.write import with_found_values
        from hdassist.pages.calibrate import calibrate_report
        from hdassist.preset.fields import IDENTIFIED_WITH
        from hdassist.preset.library import READ_AT_MOST, read_preset
        from hdassist.terminal.files import take_output, write_text

        o.stdin_once(preset, str(self.targets))
        if self.write is not None:
            take_output(self.write, self.force)
            if preset == "-" or self.overrides:
                raise UsageError("--write changes the preset as it stands in its file: no stdin, no --set with it")
        drive = self.load(preset)
        wanted = read_targets(read_bytes(self.targets, READ_AT_MOST)[0], str(self.targets), drive)
        given = read_preset(preset)[0].decode("utf-8-sig") if self.write is not None else ""
        if self.write is not None:  # a text that cannot be changed is better known before than after
            with_found_values(given, preset, {u.path: u.low for u in wanted.unknowns}, "")
        with out.run(drive.name, estimate_drives(wanted, self.evaluations), self) as run:
            result = calibrate(drive, wanted, points=self.evaluations, run=run)
        if self.write is not None and not result.shortfall:
            best = wanted.by_path(result.fits[0].values)
            ref = f"hdassist calibrate, {wanted.name or self.targets.name}"
            model = {field: drive.value(f"numerics.{field}") for field in IDENTIFIED_WITH}
            write_text(self.write, with_found_values(given, preset, best, ref, model), self.force)
        return calibrate_report(result, self.write)
