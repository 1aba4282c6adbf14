"""Options of commands that draw random drives, and the work that these commands share."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.belief.samples import Samples
    from hdassist.preset.fields import Drive
    from hdassist.tolerance.production import Production, ProductionLaw, RandomDrive


@dataclass(frozen=True, kw_only=True)
class DrawOptions(o.LimitedDriveOptions):
    """How random drives are drawn."""

    distribution: Literal["rayleigh", "uniform", "fixed"] = "rayleigh"
    known: list[str]
    seed: int = 0
    jobs: int = 0
    executor: str | None = None

    def law(self, drive: "Drive", *, chosen: bool = False) -> "ProductionLaw":
        """Distributions of the random drives; chosen, whether sizes that are assumed are tolerances to choose too.

        Raises UsageError for invalid options.
        """
        from hdassist.preset.fields import DEVIATION_FIELDS
        from hdassist.tolerance.production import production_law

        found = production_law(drive, self.distribution, chosen=chosen, known=self.known)
        if not any(each.path == each.group and each.path in DEVIATION_FIELDS for each in found.own):
            raise UsageError("no field scatters: all tolerances are 0", "set tolerances.e_hb or others above 0")
        return found

    def with_designs(
        self, out: "o.Output", production: "Production", count: int
    ) -> "tuple[Production, Samples | None]":
        """A production with the designs of so many drives, and the samples that they are of, if they differ."""
        with out.run("designs", production.design_states(count), self) as run:
            return production.with_designs(count, run=run)

    def records(self, out: "o.Output", production: "Production", count: int) -> "list[RandomDrive]":
        """Records of so many drives of a production."""
        from hdassist.run.run import stream

        found: list[RandomDrive] = []
        with out.progress(production.drive.name, count) as progress, out.engine(self) as engine:
            for records in stream(production.records, count, jobs=self.jobs, executor=engine):
                found += records
                progress(len(records))
        return found


def require_limits(drive: "Drive") -> list[float]:
    """Limit of F'_ior [arcsec] at each torque. Raises UsageError where there is none at one of them."""
    limits = []
    for M_g in drive.operation.M_g:
        limit = drive.limit(M_g)
        if limit is None:
            hint = f"--limit 30, --limit F_ior@{M_g:g}=30, or --torque for those that have one"
            raise UsageError(f"no limit of F'_ior at {M_g:g} N*m", hint)
        limits.append(limit)
    return limits
