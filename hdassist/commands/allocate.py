"""`hdassist allocate`: the cheapest tolerances that reach a yield."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from hdassist.commands.draw_options import DrawOptions, require_limits
from hdassist.terminal import options as o

DRIVES_PER_DESIGN = 5  # of many designs few drives each tell more than the reverse


@dataclass(frozen=True, kw_only=True)
class AllocateCommand(o.FigureOptions, DrawOptions):
    """The cheapest tolerances with which enough drives pass, as built and with each fixed wheel in its best hole.

    \b
    Examples:
      hdassist allocate vzp160 --torque 80 --limit 20
      hdassist allocate vzp160 --limit 20 --limit F_ior@800=6
      hdassist allocate own.yaml --limit 30 --set cost.tolerances.e_hb.share=3

    Tolerances are recommended only where they reach the yield with a probability of --sure over all that is not known
    of the design; a size that the preset assumes is a tolerance to choose too. What one costs stands in the preset:
    cost: {tolerances.e_hb: {share: 3, k: 1.5, least: 10}} costs 3 as the preset has it and 3 (now/tolerance)^1.5 else,
    and no less than 10 um can be made; without it 1, k = 1 and a tenth. Tolerances may grow to twice their value.
    Exit codes: 0 done, 3 no tolerances reach the yield, 6 none is shown to reach it, 2 wrong usage, 4 bad preset, 5 no
    trustworthy answer, 130 stopped.
    """

    preset: str
    wanted: float = 0.95
    count: int = 250
    sure: float = 0.95
    mounting: bool = True

    def report(self, out: o.Output, preset: str) -> o.Report:
        """The cheapest tolerances."""
        with out.progress(preset):  # words before numpy is imported
            from hdassist.error.self_error import self_error
            from hdassist.errors import UsageError
            from hdassist.pages.tolerance import allocate_report
            from hdassist.tolerance.production import Production
            from hdassist.tolerance.tightening import Allocator, to_measure

            drive = self.load(preset)
            law, torques, limits = self.law(drive, chosen=True), drive.operation.M_g, require_limits(drive)
            own = [found.range_arcsec for found in self_error(drive, torques)]
            room = [limit - each for limit, each in zip(limits, own, strict=True)]
            if min(room) <= 0:
                worst = room.index(min(room))
                words = f"the self error alone is {own[worst]:.1f}″ at {torques[worst]:g} N*m"
                hint = "no tolerance changes that: a limit above it, or another wave or clearance"
                raise UsageError(f"{words}, the limit {limits[worst]:g}", hint)
        production = Production(
            law, torques, mounting=self.mounting, limits=room, seed=self.seed, per_design=DRIVES_PER_DESIGN, steps=True
        )
        if not law.tolerances:
            raise UsageError(
                "no tolerance to choose: none that the preset gives is drawn", "set tolerances.e_hb above 0"
            )
        production, samples = self.with_designs(out, production, self.count)
        allocator = Allocator(production, tuple(room), self.wanted, self.sure, partial(self.records, out), self.count)
        ways = [allocator.cheapest(turned) for turned in ((False, True) if self.mounting else (False,))]
        gains = to_measure(law, samples, 0) if samples else ()
        return allocate_report(allocator, ways, own, gains)
