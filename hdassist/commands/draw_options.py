"""Options of commands that draw random drives: what they are drawn from, and the limits they are held against."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import isfinite
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import typer

from hdassist.errors import DataError, UsageError
from hdassist.numerals import number_of
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.preset.fields import Drive
    from hdassist.tolerance.law import ProductionLaw, SizeLaw


@dataclass(frozen=True)
class DrawOptions(o.LoadedDriveOptions):
    """How drives are drawn, and what they are held against."""

    panel: ClassVar[str] = "Drives"

    limit: Annotated[
        list[str],
        typer.Option(metavar="[M_G:]ARCSEC", help="Limit of F'_ior with the self error: 30, or 80:30. Repeatable."),
    ] = field(default_factory=list)
    distribution: Annotated[
        Literal["rayleigh", "uniform", "fixed"], typer.Option(help="How sizes that are given scatter up to them.")
    ] = "rayleigh"
    scatter: Annotated[
        list[str],
        typer.Option(
            metavar="FIELD=NAME|FILE", help="The same of one field, or a file of values measured of it. Repeatable."
        ),
    ] = field(default_factory=list)
    known: Annotated[
        list[str],
        typer.Option(metavar="FIELD", help="A direction that is as the preset has it, not any. Repeatable."),
    ] = field(default_factory=list)
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random drives.")] = 0

    def load(self, preset: str, *more: str) -> Drive:
        """The drive of a preset with overrides, torques and limits. Raises DataError, PresetError or UsageError."""
        return super().load(preset, *more, *map(_limit_override, self.limit))

    def law(self, drive: Drive, *, chosen: bool = False) -> ProductionLaw:
        """What random drives are drawn from; chosen, whether sizes that are assumed are tolerances to choose too.

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


def require_limits(drive: Drive) -> list[float]:
    """Limit of F'_ior [arcsec] at each torque. Raises UsageError where there is none at one of them."""
    limits = [drive.limit(M_g) for M_g in drive.operation.M_g]
    open_ = [M_g for M_g, limit in zip(drive.operation.M_g, limits, strict=True) if limit is None]
    if open_:
        hint = f"--limit 30, --limit {open_[0]:g}:30, or --torque for those that have one"
        raise UsageError(f"no limit of F'_ior at {open_[0]:g} N*m", hint)
    return [limit for limit in limits if limit is not None]


def _limit_override(text: str) -> str:
    torque, colon, limit = text.rpartition(":")
    for number in (torque, limit) if colon else (limit,):
        if not isfinite(number_of(number)):
            raise UsageError(f"--limit: not a limit in arcsec (got {text or 'nothing'})", "like 30, or 80:30 at 80 N*m")
    return f"acceptance.F_ior.{torque}={limit}" if colon else f"acceptance.F_ior={limit}"


def _scatter_of(text: str) -> tuple[str, SizeLaw | list[float]]:
    """A field, and its distribution or the values measured of it."""
    from hdassist.tolerance.law import SIZE_LAWS

    path, _, what = text.partition("=")
    if not what:
        raise UsageError(f"--scatter: not of the form FIELD=NAME or FIELD=FILE (got {text or 'nothing'})")
    named: dict[str, SizeLaw] = {name: name for name in SIZE_LAWS}
    return path, named[what] if what in named else _measured(what)


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
