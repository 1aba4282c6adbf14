"""Options of commands that draw random drives, and the work that these commands share."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from hdassist.errors import DataError, UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.belief.samples import Samples
    from hdassist.preset.fields import Drive
    from hdassist.terminal.output import Output
    from hdassist.tolerance.law import ProductionLaw, SizeLaw
    from hdassist.tolerance.production import Production, RandomDrive


@dataclass(frozen=True, kw_only=True)
class DrawOptions(o.LimitedDriveOptions):
    """How random drives are drawn."""

    distribution: Annotated[
        Literal["rayleigh", "uniform", "fixed"],
        o.drive_option(metavar="NAME", help="Scatter of given sizes: rayleigh, uniform or fixed."),
    ] = "rayleigh"
    scatter: Annotated[
        list[str],
        o.drive_option(
            metavar="FIELD=NAME|FILE", default_factory=list, show_default=False,
            help="The same of one field, or a file of its values.",
        ),
    ]  # fmt: skip
    known: Annotated[
        list[str],
        o.drive_option(
            metavar="FIELD", default_factory=list, show_default=False, help="A direction that is as the preset has it."
        ),
    ]
    seed: o.SeedOption = 0
    jobs: o.Jobs = 0

    def law(self, drive: "Drive", *, chosen: bool = False) -> "ProductionLaw":
        """Distributions of the random drives; chosen, whether sizes that are assumed are tolerances to choose too.

        Raises UsageError and DataError for invalid options.
        """
        from hdassist.preset.deviations import DEVIATION_FIELDS
        from hdassist.tolerance.law import assumed_sizes, production_law

        laws = dict.fromkeys(assumed_sizes(drive), self.distribution) if chosen else {}
        by_field = laws | dict(map(_scatter_of, self.scatter))
        found = production_law(drive, self.distribution, by_field=by_field, known=self.known)
        if not any(each.path == each.group and each.path in DEVIATION_FIELDS for each in found.own):
            raise UsageError("no field scatters: all tolerances are 0", "set tolerances.F_i2 or others above 0")
        return found


@dataclass(frozen=True)
class ProductionRun:
    """Where drives of a production are computed: so many processes, progress shown under the name of the drive."""

    name: str
    jobs: int
    out: "Output"

    def with_designs(self, production: "Production", count: int) -> "tuple[Production, Samples | None]":
        """A production with the designs of so many drives, and the samples that they are of, if they differ."""
        with self.out.run("designs", production.design_states(count), self) as run:
            return production.with_designs(count, run=run)

    def records(self, production: "Production", count: int) -> "list[RandomDrive]":
        """Records of so many drives of a production."""
        from hdassist.run.stream import stream

        found: list[RandomDrive] = []
        with self.out.progress(self.name, count) as progress:
            for records in stream(production.records, count, jobs=self.jobs):
                found += records
                progress(len(records))
        return found


def require_limits(drive: "Drive") -> list[float]:
    """Limit of F'_ior [arcsec] at each torque. Raises UsageError where there is none at one of them."""
    limits = [drive.limit(M_g) for M_g in drive.operation.M_g]
    open_ = [M_g for M_g, limit in zip(drive.operation.M_g, limits, strict=True) if limit is None]
    if open_:
        hint = f"--limit 30, --limit F_ior@{open_[0]:g}=30, or --torque for those that have one"
        raise UsageError(f"no limit of F'_ior at {open_[0]:g} N*m", hint)
    return [limit for limit in limits if limit is not None]


def _scatter_of(text: str) -> "tuple[str, SizeLaw | list[float]]":
    """A field, and its distribution or the values measured of it."""
    from hdassist.tolerance.law import SIZE_LAWS

    path, _, source = text.partition("=")
    if not source:
        raise UsageError(f"invalid --scatter {text!r}: expected FIELD=NAME or FIELD=FILE")
    named: dict[str, SizeLaw] = {name: name for name in SIZE_LAWS}
    return path, named[source] if source in named else _measured(source)


def _measured(file: str) -> list[float]:
    """Values in the only column of a file, or in its first one. Raises DataError: not readable, empty or negative."""
    from hdassist.readers.table import read_numbers

    table = read_numbers(file)
    table.require_sound()
    if not len(table.values):
        raise DataError(f"{file}: no values in it", "a column of measured sizes, one a line, in the field's unit")
    values = table.values[:, 0].tolist()
    if min(values) < 0:
        raise DataError(f"{file}: a size below 0 ({min(values):g})", "sizes of deviations, without signs")
    return [float(value) for value in values]
