"""`hdassist self-error`: the error of a drive without deviations."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.preset.fields import Drive


@o.with_groups
def self_error_command(preset: o.Preset, drives: o.LoadedDriveOptions, options: o.FigureOptions) -> None:
    """Self error: what a drive without deviations does over tooth phase and ball phase.

    \b
    Examples:
      hdassist self-error vzp160
      hdassist self-error my-drive.yaml --torque 50 --json

    F'_ior looks at positions in which teeth and balls stand alike; this is what lies between them.
    """
    from hdassist.error.self_error import self_error
    from hdassist.pages.self_error import self_error_answer
    from hdassist.run.run import Run
    from hdassist.solve.window import in_wide_enough_window
    from hdassist.terminal.runs import Answer, give, run_each

    out = options.open()

    def one(name: str) -> Answer:
        return in_wide_enough_window(drives.load(name), of)

    def of(drive: Drive) -> Answer:
        torques = drive.operation.M_g
        with out.progress(drive.name, len(torques) * drive.numerics.n_phase**2) as progress:
            return self_error_answer(drive, self_error(drive, torques, run=Run(progress=progress)))

    give("self-error", run_each("self-error", [preset], one, options, keep_failures=False), options, out)
