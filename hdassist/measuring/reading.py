"""How records of a drive are read and looked at: the options that every command with measured traces has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hdassist.errors import DataError
from hdassist.measuring.bench import bench_record
from hdassist.measuring.cycle import gearing_of
from hdassist.measuring.measure import Measurement, measure, require_drift
from hdassist.measuring.orders import parse_orders
from hdassist.measuring.uncertainty import parse_stated
from hdassist.preset.fields import Drive
from hdassist.readers.table import NumberTable
from hdassist.readers.trace import TraceForm, read_record, trace_of
from hdassist.run.kept import ClosedRecord


@dataclass(frozen=True)
class Reading(ClosedRecord, TraceForm):
    """Form of the file, orders like "1-12", kind of drift and stated uncertainties like "encoder=0.3"."""

    orders: str | None = None
    drift: str = "none"
    budget: tuple[str, ...] = ()

    def require_sound(self) -> None:
        """Raise UsageError for options that cannot be, whatever the file."""
        super().require_sound()
        parse_stated(self.budget)
        parse_orders(self.orders or None)
        require_drift(self.drift)

    def measured(self, file: str, drive: Drive | None, ratio: float | None = None, **how: Any) -> Measurement:
        """Results of a record of a drive, or of one of a ratio; how: more arguments of `measure`.

        Raises what it and read_trace do.
        """
        table = read_record(file, self)
        if bench_record(table):
            words = f"{table.file}: approached positions or a torque loop, which is no trace"
            raise DataError(words, "hdassist measure has its figures; accept takes them as --value NAME=VALUE±U")
        return self.of_table(table, drive, ratio, **how)

    def of_table(self, table: NumberTable, drive: Drive | None, ratio: float | None = None, **how: Any) -> Measurement:
        """Results of the trace in a table, of a drive or of one of a ratio; how: more arguments of `measure`."""
        gearing = gearing_of(drive, ratio)
        trace = trace_of(table, self, gearing.ratio if gearing else None)
        orders, stated = parse_orders(self.orders or None), parse_stated(self.budget)
        return measure(trace, drive=drive, ratio=ratio, orders=orders, drift=self.drift, stated=stated, **how)
