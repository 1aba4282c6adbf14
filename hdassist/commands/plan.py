"""`hdassist plan`: how much of F'_ior a test sees, before it is made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.planning import ReadingPlan


@dataclass(frozen=True, kw_only=True)
class PlanCommand(o.PlotOptions, o.SamplingOptions, o.LimitedDriveOptions):
    """How much of F'_ior a test sees, before it is made: which positions or which record are enough.

    \b
    Examples:
      hdassist plan vzp160
      hdassist plan my-drive.yaml --limit F_ior@6.7=45 --noise 0.5
      hdassist plan my-drive.yaml --limit 45 --positions 127
      hdassist plan vzp160 --positions 24 --turns 2 --json

    A test reads the output at some positions, from an angle that is not known, and takes the greatest less the least
    error. It misses all that lies between, and does not see waves that come as often as there are positions. Each drive
    that this one may be, by all that is not known exactly (docs/unknown.md), is put to each test, at the first torque
    with a limit. Its teeth are smooth; noise of single teeth lowers the shares (docs/plan.md).

    A test is enough that keeps both shares of wrong verdicts, false PASS and false FAIL among all tested; without
    a limit, one that sees 95 % of F'_ior in 95 % of cases. Exit codes: 0 a test (or the one asked about) is enough, 3
    it is not, 6 that is open, 2 wrong options, 4 bad preset, 5 no trustworthy answer.
    """

    preset: str
    positions: int | None = None
    turns: float = 1.0
    both: bool = False
    noise: float = 0.0
    corrected: bool = False
    wrong: float = 0.05

    def plan(self) -> ReadingPlan | None:
        """The test to judge, None where none was asked about. Raises UsageError for options without one."""
        from hdassist.planning import ReadingPlan

        if self.positions is not None:
            return ReadingPlan.positions(self.positions, self.turns, self.both)
        if self.both or self.turns != 1:
            raise UsageError("--turns and --both are of a test to judge", "--positions 12")
        return None

    def report(self, out: o.Output, preset: str) -> o.Report:
        """Tests of the drive, judged."""
        with out.progress(preset) as progress:  # words before numpy is imported
            from hdassist.design.check import check_states
            from hdassist.pages.plan import plan_report
            from hdassist.planning import PlanDemands, choose_plan

            asked, demands = self.plan(), PlanDemands(self.wrong, self.noise, self.corrected)
            drive = self.load(preset)
            with out.run(drive.name, check_states(drive, draws=self.draws), self, progress) as run:
                return plan_report(choose_plan(drive, asked=asked, demands=demands, draws=self.draws, run=run))
