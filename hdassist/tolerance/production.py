"""F'_ior of random drives: as each is put together by chance, and with its fixed wheel bolted in where it is best.

At each torque the table of the error (error/table.py) is read in every position of the wheel; where the wheel stands,
and where it may be best, the extremes are solved and proven (error/error_map.py).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any

import numpy as np
from pydantic import Field, TypeAdapter

from hdassist.error.error_map import Batch, ErrorMap, Indices, searchable
from hdassist.error.table import ErrorTable, Mesh, error_tables, estimates
from hdassist.errors import HdassistError, UntrustedError, UsageError
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import carried
from hdassist.model.geometry import Array
from hdassist.model.rules import first_conflict
from hdassist.mounting.positions import merit, seat_positions
from hdassist.preset.fields import Drive
from hdassist.run.kept import ClosedRecord, Count, Number, RecordKind
from hdassist.solve.answers import EMPTY, Progress
from hdassist.solve.certificate import Residual
from hdassist.solve.formulation import Formulation, formulate
from hdassist.tolerance.scatter import Draws

FREE_STEP = 30.0  # deg between positions where the seat has no holes
FIRST = 2  # positions besides the present one that are solved whatever the table says of the others
SPREADS = 3.0  # standard deviations of what the table misses of F'_ior that a position may be better
SPREAD = 0.01  # of F'_ior: what it is taken to miss at least
READ_MESH = Mesh(compared=0, turns=16)  # the turns are enough for how the error grows with a size


@dataclass(frozen=True, kw_only=True)
class RandomDrive(ClosedRecord):
    """F'_ior [arcsec] of a random drive at each torque, as built and in its best position.

    best_rotation_deg: that position, as a rotation from the present one; states and max_residual: of the proof;
    refused: why it has no F'_ior; values: what was drawn, by field.
    """

    F_ior_arcsec: tuple[Annotated[Number, Field(gt=0)], ...] = ()
    best_F_ior_arcsec: tuple[Annotated[Number, Field(gt=0)], ...] = ()
    best_rotation_deg: Number | None = None
    states: Count = 0
    max_residual: Residual = 0.0
    refused: str | None = None
    values: Mapping[str, Number]


@dataclass(frozen=True)
class Production:
    """Random drives of a preset: once it has tables, `records` can be called in any process.

    drive; draws; torques M_g [N*m]; rotations of the fixed wheel [deg], 0 first; limits of F'_ior [arcsec], one a
    torque, by which the best position is chosen (None: by what it gains); tables of the error, one a torque.
    """

    drive: Drive
    draws: Draws
    torques: tuple[float, ...]
    rotations: tuple[float, ...]
    limits: tuple[float, ...] | None
    tables: tuple[ErrorTable, ...] = field(default=(), repr=False)

    @classmethod
    def of(
        cls,
        drive: Drive,
        draws: Draws,
        torques: Sequence[float],
        *,
        mounting: bool = True,
        limits: Sequence[float] | None = None,
    ) -> Production:
        """Production of a drive, without tables yet.

        Arguments: torques M_g [N*m]; mounting, whether the wheel may be turned; limits [arcsec] of F'_ior, one a
        torque. Raises UsageError for a drive whose cycle cannot be searched.
        """
        if not searchable(drive):
            raise UsageError("with rolling balls the cycle cannot be searched", "set bearing.ball_motion=locked")
        rotations = seat_positions(drive, FREE_STEP) if mounting else [0.0]
        return cls(drive, draws, tuple(torques), tuple(rotations), None if limits is None else tuple(limits))

    def tabled(
        self, *, mesh: Mesh = READ_MESH, executor: Executor | None = None, progress: Progress | None = None
    ) -> Production:
        """The same with its tables solved.

        Arguments: mesh, how fine they are; executor, to spread the work over; progress, told how many states were
        solved. Raises UntrustedError where an answer cannot be trusted.
        """
        span = [(self.drive, [self.draws.widest(self.drive)])]
        (tables,) = error_tables(span, self.torques, mesh=mesh, executor=executor, progress=progress)
        return replace(self, tables=tuple(tables))

    def drawing(self, draws: Draws) -> Production:
        """The same tables for other draws, which they span."""
        return replace(self, draws=draws)

    @property
    def table_states(self) -> int:
        """States that tables take, about: each at the torque, and on both sides of it for slopes."""
        return READ_MESH.states(self.drive) * len(self.torques) * 3

    def records(self, first: int, last: int) -> list[RandomDrive]:
        """Records of drives first to last - 1, whatever else is or was computed.

        Each has its F'_ior [arcsec] at each torque as built and in its best position, where that is, how it was proven,
        or else why it has none; and the values drawn.
        """
        values = self.draws.values(first, last)
        found = []
        for k in range(first, last):
            drawn = {path: float(column[k - first]) for path, column in values.items()}
            try:
                found.append(self._answer(drawn))
            except HdassistError as error:
                found.append(RandomDrive(refused=error.message, values=drawn))
        return found

    @property
    def kind(self) -> RecordKind[RandomDrive]:
        """What the records are in a file."""
        return RecordKind(TypeAdapter(RandomDrive), self._fault)

    def _fault(self, _: int, record: RandomDrive) -> str:
        """Why a record cannot be that of a drive of this production; empty where it can."""
        spans = {scatter.path: (scatter.low, scatter.high) for scatter in self.draws.scatters}
        if record.values.keys() != spans.keys():
            return f"values: expected {', '.join(spans)}"
        for path, value in record.values.items():
            if not spans[path][0] <= value <= spans[path][1]:
                return f"values.{path}: expected {spans[path][0]:g} to {spans[path][1]:g}, as it is drawn"
        now, best = np.array(record.F_ior_arcsec), np.array(record.best_F_ior_arcsec)
        count = 0 if record.refused is not None else len(self.torques)
        if (len(now), len(best), min(record.states, 1)) != (count, count, min(count, 1)):
            return f"F_ior_arcsec: expected {count} values, proven by states"
        if count == 0:
            return ""
        if record.best_rotation_deg not in self.rotations:
            return "best_rotation_deg: expected a position of the seat"
        if self._merit(best, now) > self._merit(now, now) or (not record.best_rotation_deg and (now != best).any()):
            return "best_F_ior_arcsec: expected no worse than F_ior_arcsec"
        return ""

    def told(self) -> dict[str, Any]:
        """What decides the records, beside preset, seed and version."""
        return {
            "overrides": list(self.drive.origin.overrides),
            "torques_Nm": list(self.torques),
            "rotations_deg": list(self.rotations),
            "limits_arcsec": None if self.limits is None else list(self.limits),
            "method": self.draws.method,
            "scatter": [asdict(scatter) for scatter in self.draws.scatters],
        }

    def estimates(self, first: int, last: int) -> Array:
        """F'_ior [arcsec] by the tables alone, shape (drives, torques, rotations), of drives first to last - 1."""
        values = self.draws.values(first, last)
        rows = ({path: float(column[k]) for path, column in values.items()} for k in range(last - first))
        read = list(zip(self._searches, self.tables, strict=True))
        found = [[np.ptp(estimates(t, s, batch), axis=(1, 2)) for s, t in read] for batch in map(self._batch, rows)]
        return np.array(found)

    def _answer(self, drawn: dict[str, float]) -> RandomDrive:
        searches = self._searches if not self.draws.moves_system else self._searches_of(self._moved(drawn))
        batch = self._batch(drawn)
        proposed = [estimates(table, s, batch) for s, table in zip(searches, self.tables, strict=True)]
        near = np.array([np.ptp(maps, axis=(1, 2)) for maps in proposed])
        exact, proof = np.full(near.shape, np.nan), EMPTY
        while len(rows := self._promising(near, exact)):
            part = batch.take(rows)
            for t, search in enumerate(searches):
                found = search.many_extremes(part, proposed[t][rows])
                exact[t, rows] = found.F_ior_arcsec
                proof += found.certificate
        best = int(np.nanargmin(self._merit(exact, exact[:, 0])))
        return RandomDrive(
            F_ior_arcsec=tuple(exact[:, 0].tolist()),
            best_F_ior_arcsec=tuple(exact[:, best].tolist()),
            best_rotation_deg=self.rotations[best],
            states=proof.states,
            max_residual=proof.max_residual,
            values=drawn,
        )

    def _promising(self, near: Array, exact: Array) -> Indices:
        """Positions that may be the best and are not solved yet, from F'_ior by the table and as solved so far."""
        solved = ~np.isnan(exact[0])
        if not solved.any():
            first = np.argsort(self._merit(near, near[:, 0]), kind="stable")[:FIRST]
            return np.union1d([0], first)
        missed = exact[:, solved] / near[:, solved]
        spread = np.maximum(missed.std(axis=1), SPREAD)
        least = near * np.maximum(missed.mean(axis=1) - SPREADS * spread, 0)[:, None]
        may_be = self._merit(least, exact[:, 0]) < np.nanmin(self._merit(exact, exact[:, 0]))
        return np.flatnonzero(may_be & ~solved)

    def _merit(self, F_ior: Array, now: Array) -> Array:
        """What is least in the best position, shape (rotations,)."""
        return merit(F_ior, now if self.limits is None else np.array(self.limits))

    def _batch(self, drawn: dict[str, float]) -> Batch:
        """A drive in every position of its wheel."""
        turned, turns = carried(self.drive), np.array(self.rotations)
        columns = {path: np.full(len(turns), value) for path, value in drawn.items()}
        return Batch(self.drive, columns | {p: columns.get(p, self.drive.number(p)) + turns for p in turned})

    def _moved(self, drawn: dict[str, float]) -> Drive:
        """The drive with stiffnesses, clearances and shapes as drawn. Raises UntrustedError where they do not fit."""
        moved = self.drive.with_values(drawn)
        if (conflict := first_conflict(moved)) is not None:
            raise UntrustedError(f"no such drive: {conflict.path}: {conflict.message}")
        return moved

    @cached_property
    def _nominal(self) -> Formulation:
        return formulate(contact_system(self.drive))

    @cached_property
    def _searches(self) -> list[ErrorMap]:
        return [ErrorMap(self.drive, table.M_g, self._nominal) for table in self.tables]

    def _searches_of(self, drive: Drive) -> list[ErrorMap]:
        formulation = formulate(contact_system(drive))
        return [ErrorMap(drive, s.M_g, formulation, like=s.fresh) for s in self._searches]

    def __getstate__(self) -> dict[str, Any]:
        """What goes to another process: what can be made there anew stays here."""
        return {name: value for name, value in self.__dict__.items() if name not in ("_nominal", "_searches")}
