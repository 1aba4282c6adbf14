"""`hdassist sensitivity`: which tolerance to tighten first, or the measurement to make before."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.commands.draw_options import DrawOptions
from hdassist.terminal import options as o


@dataclass(frozen=True, kw_only=True)
class SensitivityCommand(o.FigureOptions, DrawOptions):
    """Which tolerance to tighten first, and how much a step takes off F'_ior; or the measurement to make before.

    \b
    Examples:
      hdassist sensitivity vzp160
      hdassist sensitivity vzp160 --torque 80 -n 256 --json
      hdassist sensitivity own.yaml --distribution uniform --csv figures.csv

    Over random drives of random designs as built (as hdassist tolerance draws them): the share of the variance of
    ln F'_ior that comes from each field, the size and the direction of a deviation together, and what the 95th
    percentile of F'_ior were with each tolerance a fifth tighter. Exit codes: 0 done, 2 wrong usage, 4 bad preset, 5 no
    trustworthy answer, 130 stopped.
    """

    preset: str
    count: int = 96
    details: bool = False

    def report(self, out: o.Output, preset: str) -> o.Report:
        """The tolerances, ranked."""
        with out.progress(preset):  # words before numpy is imported
            from dataclasses import replace
            from functools import partial

            from hdassist.pages.tolerance import sensitivity_report
            from hdassist.tolerance.production import Production
            from hdassist.tolerance.tightening import sensitivities

            drive = self.load(preset)
            law = self.law(drive)
            each_its_own = replace(law, shared=law.shared + law.own, own=())
            production = Production(
                each_its_own, drive.operation.M_g, mounting=False, seed=self.seed, per_design=1, steps=True
            )
        production, samples = self.with_designs(out, production, self.count)
        assert samples
        found = sensitivities(production, samples, partial(self.records, out))
        return sensitivity_report(replace(found, law=law))
