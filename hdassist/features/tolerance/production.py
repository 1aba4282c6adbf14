"""Random drives of random designs: their distributions, and F'_ior as assembled and in the best hole.

A size of a deviation given by the preset is a tolerance here: parts are between zero and the tolerance, according to a
law. A size that the preset does not give, or only assumes, is sampled as in `check`. Directions are random because
parts are assembled in any orientation. All other uncertain inputs are the same in all drives of a design, except
clearances with a tolerance.

Designs are sampled from the prior of these shared inputs and weighted by the preset's reference data. Each design has
the same number of drives, which are sampled from the law of the production. A coarse grid of states determines which
positions of the wheel may be the best. In these positions and in the present one, the extremes are located on a finer
grid, solved and verified (drive/error/error_map.py).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, TypeAdapter

from hdassist.belief.evidence import evidence_of
from hdassist.belief.prior import DrivePrior, FieldPrior, prior_of
from hdassist.belief.samples import Samples, SamplingEffort, draw_samples
from hdassist.drive.error.cycle import state_place
from hdassist.drive.error.error_map import Batch, ErrorMap, Extremes, error_maps, searchable
from hdassist.drive.error.extremes import DRAWN_GRIDS, DRAWN_STATES, many_extremes
from hdassist.drive.model.contacts import StateGaps
from hdassist.drive.model.deviations import assumptions, carried
from hdassist.drive.model.geometry import Array
from hdassist.drive.model.rules import first_conflict
from hdassist.drive.preset.fields import DEVIATION_FIELDS, DEVIATIONS, Deviation, Drive
from hdassist.drive.solve.answers import EMPTY, Certificate, Residual
from hdassist.drive.solve.loadcase import LoadCase
from hdassist.features.mounting.positions import merit, seat_positions
from hdassist.run.errors import HdassistError, UntrustedError, UsageError
from hdassist.run.kept import ClosedRecord, Count, Number, RecordKind
from hdassist.run.run import Run

_SizeLaw = Literal["rayleigh", "uniform", "fixed"]
RAYLEIGH_TAIL = (
    3.0  # tolerance in standard deviations of each component of a Rayleigh-distributed size: 1 in 90 is beyond it
)
_PRODUCTION_FREE_STEP = 30.0  # step between positions if the seat has no holes [deg]
TIGHTER_STEP = 0.8  # ratio of a tolerance that is one step tighter to the present tolerance
_MOST_WEIGHT = 1e9  # largest weight of a design, far above the weights from reference data
_DRAWS_PER_DESIGN = 64  # maximum number of draws for each design that agrees with the reference data
_MapsOf = Callable[[Drive], list[ErrorMap]]  # function that returns the error maps of a drive, one per torque


@dataclass(frozen=True)
class TolerancedSize(FieldPrior):
    """Size of a deviation in a production, distributed by a law between 0 and its tolerance `high`."""

    law: _SizeLaw = "rayleigh"

    def value(self, share: Array) -> Array:
        """Return the quantiles of the size, in the field's unit; share: quantile levels, whose shape the result has."""
        # in the worst case, every part is at its limit
        if self.law == "fixed":
            return np.full_like(share, self.high)
        # the components x and y are normal, and the size is truncated at the tolerance
        if self.law == "rayleigh":
            return np.asarray(
                self.high / RAYLEIGH_TAIL * np.sqrt(-2 * np.log1p(share * np.expm1(-(RAYLEIGH_TAIL**2) / 2)))
            )
        return super().value(share)


@dataclass(frozen=True)
class ProductionLaw:
    """Distributions of random drives.

    drive: drive of the preset.
    shared: fields that are equal in all drives of a design.
    own: fields that differ from drive to drive.
    """

    drive: Drive
    shared: tuple[FieldPrior, ...]
    own: tuple[FieldPrior, ...]

    @cached_property
    def joint(self) -> DrivePrior:
        """Prior of a random drive of a random design."""
        return DrivePrior(self.drive, self.shared + self.own)

    @property
    def sizes(self) -> list[str]:
        """Paths of the sampled sizes of deviations, both shared and own."""
        return [f.path for f in self.joint.fields if f.path == f.group and f.path in DEVIATION_FIELDS]

    @property
    def tolerances(self) -> tuple[TolerancedSize, ...]:
        """Sizes that are sampled up to a tolerance of the preset."""
        return tuple(field for field in self.own if isinstance(field, TolerancedSize))

    @property
    def not_given(self) -> tuple[str, ...]:
        """Paths of sizes that are sampled up to an assumed bound instead of a tolerance, as in `check`."""
        # fields that are neither toleranced nor normal are sampled up to an assumed bound
        even = {f.path for f in self.joint.fields if not isinstance(f, TolerancedSize) and f.distribution != "normal"}
        return tuple(path for path in self.sizes if path in even)

    def values(self, seed: int, drive: int) -> dict[str, float]:
        """Return the own fields of a drive by path; they depend only on the seed and the number of the drive."""
        # each drive has its own random stream, which allows any process to compute any drive
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(drive,)))
        shares = rng.random((1, len(self.own)))
        return {path: float(column[0]) for path, column in DrivePrior(self.drive, self.own).columns(shares).items()}

    def scaled(self, factors: Mapping[str, float]) -> ProductionLaw:
        """Return the law with some tolerances multiplied by factors, and with the bounds that are assumed from them.

        factors: factors by path of the tolerance.
        """
        # bounds that are assumed as shares of a tolerance follow the new tolerance
        high = {f.path: f.high * factors[f.path] for f in self.tolerances if f.path in factors}
        following = {f.path: f for f in prior_of(self.drive.with_values(high)).fields}
        own_fields = (
            replace(f, high=high.get(f.path, f.high)) if isinstance(f, TolerancedSize) else following.get(f.path, f)
            for f in self.own
        )
        return replace(self, own=tuple(own_fields))

    def following(self, path: str) -> list[str]:
        """Return the paths of the sizes whose bound is assumed from the tolerance at a path."""
        pairs = zip(
            self.own,
            self.scaled({path: TIGHTER_STEP}).own,
            strict=True,
        )
        return [before.path for before, after in pairs if before.path != path and before.high != after.high]


def production_law(
    drive: Drive,
    law: _SizeLaw = "rayleigh",
    *,
    chosen: bool = False,
    known: Sequence[str] = (),
) -> ProductionLaw:
    """Return the law of a preset's production.

    drive: the drive of the preset.
    law: distribution of sizes up to their tolerance.
    chosen: whether assumed sizes with a value also count as tolerances.
    known: paths of directions that are as in the preset in all drives.
    Raises UsageError if a known path is not a direction given in the preset.
    """
    # a known direction is the same in all drives
    _require_directions(drive, known)
    priors = {field.path: field for field in prior_of(drive).fields}
    # if tolerances are chosen, an assumed size with a value is also a tolerance
    assumed = {assumption.path for assumption in assumptions(drive)} if chosen else set()
    own_fields: dict[str, FieldPrior] = {}  # fields by path, because the orders of a wheel's pitch share their size
    for deviation in DEVIATIONS:
        high = drive.number(deviation.size)
        # a size with its own prior is sampled from it
        is_prior = deviation.size in priors and not (deviation.size in assumed and high)
        if not (is_prior or high > 0):
            continue
        if deviation.size not in own_fields:
            toleranced = _toleranced_size(deviation.size, high, law)
            own_fields[deviation.size] = priors[deviation.size] if is_prior else toleranced
        has_direction = drive.value(deviation.direction) is not None
        if has_direction and deviation.direction in priors:
            own_fields[deviation.direction] = priors[deviation.direction]
        # parts are assembled in any orientation, whatever direction the preset gives for one drive
        elif deviation.direction not in known:
            own_fields[deviation.direction] = _random_direction(deviation)
    other_fields = [prior for prior in priors.values() if prior.path not in DEVIATION_FIELDS]
    # an uncertain value that does not belong to the design differs from drive to drive
    clearances = [field for field in other_fields if _is_clearance(field)]
    # stiffnesses and similar fields belong to the design
    shared = [field for field in other_fields if not _is_clearance(field)]
    return ProductionLaw(drive, tuple(shared), (*own_fields.values(), *clearances))


def _is_clearance(field: FieldPrior) -> bool:
    """Return whether a field is not a deviation but differs between the drives of one design."""
    return field.distribution == "normal" and field.owner != "design"


def _require_directions(drive: Drive, known: Sequence[str]) -> None:
    """Raise UsageError if a path is not a direction with a value in the preset."""
    directions = {deviation.direction for deviation in DEVIATIONS if drive.value(deviation.direction) is not None}
    invalid = {*known} - directions
    if invalid:
        raise UsageError(
            f"invalid --known {min(invalid)}: expected a direction that the preset states",
            "name a direction field, for example phases.phi_hb, or state its value in the preset",
        )


def _toleranced_size(
    path: str,
    tolerance: float,
    law: _SizeLaw,
) -> TolerancedSize:
    """Return the size of a deviation of each drive, distributed by a law up to its tolerance."""
    return TolerancedSize(
        path=path,
        distribution="even",
        low=0.0,
        high=tolerance,
        owner="drive",
        group=path,
        reason="its tolerance",
        law=law,
    )


def _random_direction(deviation: Deviation) -> FieldPrior:
    """Return the uniformly distributed direction of a deviation of each drive."""
    return FieldPrior(
        path=deviation.direction,
        distribution="even",
        low=0.0,
        high=360.0 / deviation.order,
        owner="drive",
        group=deviation.size,
        reason="parts are combined at random",
    )


@dataclass(frozen=True, kw_only=True)
class RandomDrive(ClosedRecord):
    """F'_ior [arcsec] of a random drive at each torque, as assembled and in its best position.

    design: number of the drive's design.
    weight: weight of the design from the reference data.
    F_ior_arcsec: F'_ior as assembled, at each torque [arcsec].
    best_F_ior_arcsec: F'_ior in the best position, at each torque [arcsec].
    best_rotation_deg: best position, as a rotation from the present one [deg].
    tighter: lower bound of F'_ior in the best position with one size TIGHTER_STEP smaller, by path of the size.
    states, max_residual: number of solved states and largest residual of the certificate.
    refused: reason why there is no result.
    values: sampled values by field.
    """

    design: Count
    weight: Annotated[Number, Field(ge=0, le=_MOST_WEIGHT)]
    F_ior_arcsec: tuple[Annotated[Number, Field(gt=0)], ...] = ()
    best_F_ior_arcsec: tuple[Annotated[Number, Field(gt=0)], ...] = ()
    best_rotation_deg: Number | None = None
    tighter: Mapping[str, tuple[Number, ...]] | None = None
    states: Count = 0
    max_residual: Residual = 0.0
    refused: str | None = None
    values: Mapping[str, Number]


def _with_each_tighter(one: Batch, paths: Sequence[str]) -> Batch:
    """Return one copy of a drive for each size, with only this size one step smaller.

    paths: paths of the sizes.
    """
    columns = {path: np.repeat(column, len(paths)) for path, column in one.columns.items()}
    for number, path in enumerate(paths):
        # each copy has one smaller size
        columns[path] = columns[path] * np.where(np.arange(len(paths)) == number, TIGHTER_STEP, 1.0)
    return Batch(one.drive, columns)


@dataclass(frozen=True)
class Production:
    """Random drives of a preset; with designs, `records` can be called in any process.

    Raises UsageError if the cycle of the drive cannot be searched.

    law: distributions that the drives are sampled from.
    torques: torques M_g [N*m].
    mounting: whether the wheel may be turned.
    limits: limits of F'_ior at each torque [arcsec], None without a limit, for the choice of the best position. If
        limits is None, the choice minimises F'_ior relative to its mean.
    seed: seed of the random drives.
    per_design: number of drives of a design.
    steps: whether records have `tighter`.
    designs: shared values by path, and weight, of each design.
    """

    law: ProductionLaw
    torques: tuple[float, ...]
    mounting: bool = True
    limits: Sequence[float | None] | None = None
    seed: int = 0
    per_design: int = 20
    steps: bool = False
    designs: tuple[tuple[Mapping[str, float], float], ...] = ()

    def __post_init__(self) -> None:
        if not searchable(self.law.drive):
            raise UsageError(
                "random drives require bearing.ball_motion: locked", "use --set bearing.ball_motion=locked"
            )

    @property
    def rotations(self) -> tuple[float, ...]:
        """Tried rotations of the fixed wheel [deg], beginning with 0."""
        return tuple(seat_positions(self.drive, _PRODUCTION_FREE_STEP)) if self.mounting else (0.0,)

    @property
    def drive(self) -> Drive:
        """Drive of the preset."""
        return self.law.drive

    def design_of(self, drive: int) -> int:
        """Return the number of a drive's design, which is 0 for all drives if no shared field is uncertain."""
        # designs differ only if a shared field is uncertain
        return drive // self.per_design if self.law.shared else 0

    def design_states(self, drives: int) -> int:
        """Return the approximate number of states solved for the designs of some drives, for the progress bar."""
        return (self.design_of(drives - 1) + 1) * len(self.torques) * DRAWN_STATES if self.law.shared else 1

    def with_designs(self, drives: int, *, run: Run = Run()) -> tuple[Production, Samples | None]:
        """Return the production with designs for a number of drives, and their samples if designs differ.

        Raises UntrustedError if too few designs agree with the preset's reference data.
        """
        if not self.law.shared:
            return replace(self, designs=(({}, 1.0),)), None
        count = self.design_of(drives - 1) + 1
        # several draws per design are needed, because reference data reject many designs
        most_draws = _DRAWS_PER_DESIGN * count
        samples = draw_samples(
            self.law.joint,
            self.torques,
            # only reference data of the type are used, because values of one drive do not apply to other drives
            evidence=evidence_of(self.drive, of_type=True),
            enough=lambda so_far: len(so_far.weights) >= count,
            effort=SamplingEffort(
                effective=1, settling_draws=most_draws, most_draws=most_draws, batch=min(count, max(16, count // 4))
            ),
            run=replace(run, seed=self.seed),
        )
        if len(samples.weights) < count:
            message = f"only {len(samples.weights)} of {samples.draws} sampled designs agree with the reference data"
            raise UntrustedError(
                f"{message}; {count} are required", "narrow the assumed ranges, or reduce the number of drives"
            )
        # the own fields of a sample are not used for the drives of its design
        paths = [field.path for field in self.law.shared]
        drawn = samples.values()
        designs = tuple(
            ({path: values[path] for path in paths}, float(weight))
            for values, weight in zip(drawn[:count], samples.weights, strict=False)
        )
        return replace(self, designs=designs), samples

    def records(self, first: int, last: int) -> list[RandomDrive]:
        """Return the records of drives first to last - 1, which do not depend on other computed drives."""
        records = []
        drives: list[tuple[Drive, list[ErrorMap]]] = []

        def maps(drive: Drive) -> list[ErrorMap]:
            # only the last design is cached because drives are solved in sequence
            if not drives or drives[0][0] != drive:  # drives of a design share a contact system
                drives[:] = [(drive, error_maps(drive, self.torques))]
            return drives[0][1]

        for k in range(first, last):
            design, weight = self.designs[self.design_of(k)]
            own_values = self.law.values(self.seed, k)
            about = RandomDrive(
                design=self.design_of(k),
                weight=weight,
                values={**design, **own_values},
            )
            try:
                records.append(replace(about, **self._solved(about.values, maps)))
            # a drive without a result is counted and does not stop the production
            except HdassistError as error:
                records.append(replace(about, refused=error.message))
        return records

    @property
    def kind(self) -> RecordKind[RandomDrive]:
        """Kind of the records in a file, whose designs and numbers of torques must be those of the production."""

        def fault(item: int, record: RandomDrive) -> str:
            # a wrong design shows that the file was computed with other options
            if record.design != self.design_of(item):
                return f"expected design {self.design_of(item)}"
            wanted = 0 if record.refused else len(self.torques)
            lengths = {len(record.F_ior_arcsec), len(record.best_F_ior_arcsec)}
            return "" if lengths == {wanted} else f"expected F'_ior at {wanted} torques"

        return RecordKind(TypeAdapter(RandomDrive), fault)

    def options(self) -> dict[str, Any]:
        """Return the inputs that the records depend on, in addition to preset, seed and version."""
        return {
            "overrides": list(self.drive.origin.overrides),
            "torques_Nm": list(self.torques),
            "rotations_deg": list(self.rotations),
            "limits_arcsec": None if self.limits is None else list(self.limits),
            "drives_per_design": self.per_design,
            "own": [asdict(field) for field in self.law.own],
            "shared": [asdict(field) for field in self.law.shared],
        }

    def _solved(self, values: Mapping[str, float], maps: _MapsOf) -> dict[str, Any]:
        """Return F'_ior as assembled and in the best position, with its certificate, as fields of a record."""
        drive = self.drive.with_values({path: value for path, value in values.items() if path not in DEVIATION_FIELDS})
        # sampled values may be incompatible with each other
        conflict = first_conflict(drive)
        if conflict:
            raise UntrustedError(f"the sampled values do not give a valid drive: {conflict.path}: {conflict.message}")
        # one search covers all positions
        batch = self._in_positions(drive, values)
        extremes_by_torque = [many_extremes(error_map, batch, DRAWN_GRIDS) for error_map in maps(drive)]
        certificate = sum((extremes.certificate for extremes in extremes_by_torque), EMPTY)
        F_ior = np.array([extremes.F_ior_arcsec for extremes in extremes_by_torque])  # shape (torques, positions)
        # the best hole is the same for all torques
        best = int(np.argmin(self._merit(F_ior)))
        tighter = None
        # sensitivities need the effect of each size near the present design
        if self.steps:
            in_best_position = batch.take(np.array([best]))
            tighter, further_certificate = self._tighter(in_best_position, best, extremes_by_torque, maps(drive))
            certificate += further_certificate
        return {
            "F_ior_arcsec": tuple(F_ior[:, 0].tolist()),
            "best_F_ior_arcsec": tuple(F_ior[:, best].tolist()),
            "best_rotation_deg": self.rotations[best],
            "tighter": tighter,
            "states": certificate.states,
            "max_residual": certificate.max_residual,
        }

    def _in_positions(self, drive: Drive, values: Mapping[str, float]) -> Batch:
        """Return a drive in each position of its fixed wheel.

        values: sampled values by path, including deviations.
        """
        rotations = np.array(self.rotations)
        columns = {path: np.full(len(rotations), value) for path, value in values.items() if path in DEVIATION_FIELDS}
        turned = {path: columns.get(path, drive.number(path)) + rotations for path in carried(drive)}
        return Batch(drive, columns | turned)

    def _tighter(
        self,
        one: Batch,
        row: int,
        present: Sequence[Extremes],
        maps: Sequence[ErrorMap],
    ) -> tuple[dict[str, tuple[float, ...]], Certificate]:
        """Return F'_ior between the states of the extremes with each size one step smaller, and the certificate.

        It is a lower bound because other states may become the extremes.

        one: the drive in its best position.
        row: index of the best position.
        present: extremes in all positions, at each torque.
        maps: error maps at each torque.
        """
        paths = self.law.sizes
        batch = _with_each_tighter(one, paths)
        rows = np.arange(len(paths))
        differences = []
        certificate = EMPTY
        for extremes, error_map in zip(present, maps, strict=True):
            rotations = []  # output rotations at the states of the largest and the smallest error
            # F'_ior with the smaller size is at least the difference between the states of the present extremes
            for state in (extremes.at_max[row], extremes.at_min[row]):
                states = error_map.states.take(np.full(len(paths), state))
                case = LoadCase(
                    error_map.fresh.formulation,
                    error_map.M_g,
                    like=error_map.fresh,
                    many=True,
                )
                gaps = StateGaps(batch.scalars(rows, states.alpha_g, states.alpha_b))
                answers = case.solve(gaps, partial(state_place, states, error_map.M_g))
                rotations.append(answers.rotation_arcsec)
                certificate += answers.certificate
            differences.append(error_map.sign * (rotations[0] - rotations[1]))
        by_size = np.array(differences).T.tolist()
        return {path: tuple(by_torque) for path, by_torque in zip(paths, by_size, strict=True)}, certificate

    def _merit(self, F_ior: Array) -> Array:
        """Return the figure of merit of each position, smallest in the best one, shape (rotations,)."""
        # without limits, F'_ior at each torque is relative to its mean
        if self.limits is None:
            return merit(F_ior, F_ior.mean(axis=1))
        return merit(F_ior, np.array([np.inf if limit is None else limit for limit in self.limits]))
