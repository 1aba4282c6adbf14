"""What is known of the cam offset before a trial, and F'_ior for all of it.

The cam offset that stands with the fixed wheel, its size and its direction, is seldom measurable in a housing. The
rest that F'_ior depends on is not known exactly either: the cam offset that turns with the cam, what the preset gives
an uncertainty for, the stiffnesses among the sets that agree with a calibration, and the model's own scale: its
absolute values are less sure than its ratios. Each draw of that rest is a world; over sizes and directions of the
offset every world has its own F'_ior.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import cycle

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates
from scipy.stats import norm, qmc

from hdassist.error.search import searchable
from hdassist.error.table import DEVIATIONS, KNOWN, ErrorTable, error_tables, turns
from hdassist.errors import UsageError
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array
from hdassist.model.kinematics import Kinematics
from hdassist.preset.fields import Drive
from hdassist.preset.overrides import is_overridden
from hdassist.solve.answers import EMPTY, Certificate, Progress
from hdassist.trials.trace_evidence import PARTICLES, Evidence, curves_of, log_likelihood
from hdassist.trials.traced_worlds import Case, drawn_from_traces, evidence_of, off_centre
from hdassist.trials.trial import Rig, Trial
from hdassist.trials.unknowns import FINE_DIRECTIONS, FINE_SIZES, Unknowns

SIZES, DIRECTIONS = 11, 36  # of the offset, at which F'_ior is computed; between them it is interpolated
SCALE = 0.10  # standard deviation of the drive's F'_ior over the model's, assumed; docs/trials.md shows what it brings
SCALES = np.linspace(-2.4, 2.4, 7)  # standard deviations at which it is taken
BETWEEN = 16  # offsets between those, at which the interpolation is compared
NEGLIGIBLE = 1e-9  # of the likeliest size, direction and scale in a world
STATES = 4_000  # that a world's F'_ior at a torque is worth, about, for a progress bar


@dataclass(frozen=True)
class SampleSizes:
    """How much is drawn of what is not known.

    draws of the rest for each set of stiffnesses (with 16 many trials came out surer than they were); traced_draws,
    where traces tell what to draw; particles that are moved to where the traces make them likely; compared, drives
    that a table of the error is compared with.
    """

    draws: int = 64
    traced_draws: int = 32
    particles: int = PARTICLES
    compared: int = KNOWN


FULL = SampleSizes()


@dataclass(frozen=True)
class OffsetPrior:
    """F'_ior over worlds, sizes and directions of the offset, and how likely each is before any trial.

    size_um, shape (sizes,); direction_deg, shape (directions,), evenly over the turn from 0; weight, shape (worlds,
    sizes, directions), sums to 1; F_ior_arcsec, with the fixed wheel at rotation 0, and seat_slope, its standard
    deviation for each micrometre of that of the wheel's centre along any direction [arcsec/um], shape (torques, worlds,
    sizes, directions); model, which set of stiffnesses a world has, 0 for the
    preset's, and scale, the drive's F'_ior over the model's, already in F_ior_arcsec, shape (worlds,);
    standard_error_arcsec of F_ior_arcsec, of the tables and of the grid over sizes and directions, shape
    (torques,); traced: trials whose traces were taken in.
    """

    drive: Drive
    torques: tuple[float, ...]
    size_um: Array
    direction_deg: Array
    weight: Array
    F_ior_arcsec: Array
    seat_slope: Array
    model: NDArray[np.int64]
    scale: Array
    standard_error_arcsec: Array
    certificate: Certificate
    traced: tuple[Trial, ...] = ()

    def at(self, rotation_deg: float) -> Array:
        """F'_ior [arcsec] with the fixed wheel turned, shape (torques, worlds, sizes, directions).

        Turning the wheel forward is turning the offset back: only their angle counts.
        """
        return _turned(self.F_ior_arcsec, rotation_deg)

    def at_nodes(self, rotation_deg: float, nodes: NDArray[np.int64]) -> Array:
        """The same for some flat places among worlds, sizes and directions alone, shape (torques, nodes)."""
        count = len(self.direction_deg)
        flat = self.F_ior_arcsec.reshape(len(self.torques), -1)
        whole, part = divmod(rotation_deg * count / 360, 1)
        direction = nodes % count
        start = nodes - direction
        first = flat[:, start + (direction - int(whole)) % count]
        if part < 1e-9:
            return np.asarray(first)
        return np.asarray((1 - part) * first + part * flat[:, start + (direction - int(whole) - 1) % count])

    def seat_error(self, rotation_deg: float, reseat_um: float) -> Array:
        """Standard deviation of F'_ior [arcsec] by the wheel's centre coming to lie reseat_um off, as at."""
        return _turned(self.seat_slope, rotation_deg) * reseat_um if reseat_um else np.zeros(1)


def _turned(values: Array, rotation_deg: float) -> Array:
    """Values at directions less by the rotation; directions come last."""
    count = values.shape[-1]
    whole, part = divmod(rotation_deg * count / 360, 1)
    first = np.roll(values, int(whole), axis=-1)
    return first if part < 1e-9 else np.asarray((1 - part) * first + part * np.roll(first, 1, axis=-1))


@dataclass(frozen=True, eq=False)
class Tables:
    """The error of a drive over its deviations, for each set of stiffnesses and each torque."""

    unknowns: Unknowns
    torques: tuple[float, ...]
    models: tuple[Drive, ...]
    responses: tuple[tuple[ErrorTable, ...], ...]
    seed: int
    sizes: SampleSizes

    @property
    def certificate(self) -> Certificate:
        """Proof of all that was solved."""
        return sum((response.certificate for row in self.responses for response in row), EMPTY)

    @property
    def standard_error_arcsec(self) -> Array:
        """That of an F'_ior, shape (torques,)."""
        return np.asarray(np.max([[r.standard_error for r in row] for row in self.responses], axis=0))


def tabulated(
    drive: Drive,
    torques: Sequence[float],
    *,
    traced: bool = False,
    reseat: bool = False,
    seed: int = 0,
    sizes: SampleSizes = FULL,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Tables:
    """Tables of a drive over all that trials leave open.

    Arguments: torques [N*m]; traced, whether traces will be taken in; reseat, whether the seat's error is wanted;
    sizes, how much is drawn; executor and progress as in mounting_curve. Raises as offset_prior does.
    """
    if not searchable(drive):
        raise UsageError("trials need locked balls", "bearing.ball_motion: locked")
    others = [path for path in drive.uncertainty if not path.startswith(DEVIATIONS)]
    if others:
        raise UsageError(
            f"trials cannot take in an uncertainty of {', '.join(others)}",
            "leave it out; sets of values that agree with a calibration belong to alternatives",
        )
    unknowns = Unknowns.of(drive)
    models = [drive, *(drive.with_values(_not_overridden(drive, values)) for values in drive.alternatives)]
    rest = unknowns.drawn(sizes.draws, seed)
    spans = [_span(model, rest, unknowns, seed, sizes.draws, traced=traced, reseat=reseat) for model in models]
    cases = list(zip(models, spans, strict=True))
    found = error_tables(cases, torques, compared=sizes.compared, executor=executor, progress=progress)
    return Tables(unknowns, tuple(torques), tuple(models), tuple(map(tuple, found)), seed, sizes)


def offset_prior(
    drive: Drive,
    torques: Sequence[float],
    *,
    reseat: bool = False,
    trials: Sequence[Trial] = (),
    rig: Rig | None = None,
    seed: int = 0,
    sizes: SampleSizes = FULL,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> OffsetPrior:
    """What is known of the offset of a drive before any F'_ior was measured.

    Its direction is open and its size anywhere up to WIDEST times the preset's, unless the preset gives an uncertainty
    for them; the same holds for the offset that turns with the cam. Other deviations that have an uncertainty are
    drawn; stiffnesses are the preset's and its alternatives'. Traces of trials are taken in; what else the trials
    measured is for posterior.

    Arguments: torques [N*m]; reseat, whether seat_slope is wanted (zero without); trials and the rig that they were
    measured on, needed where one of them has a trace; sizes, how much is drawn; executor and progress as in
    mounting_curve. Raises UsageError for a drive with rolling balls, without an offset, or with an uncertainty in a
    field that is no deviation; UntrustedError where an answer cannot be trusted, or nothing explains the traces.
    """
    traced = [trial for trial in trials if trial.trace]
    found = tabulated(
        drive, torques, traced=bool(traced), reseat=reseat, seed=seed, sizes=sizes, executor=executor, progress=progress
    )
    return prior_of(found, reseat=reseat, trials=traced, rig=rig, executor=executor, progress=progress)


def prior_of(
    found: Tables,
    *,
    reseat: bool = False,
    trials: Sequence[Trial] = (),
    rig: Rig | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> OffsetPrior:
    """The same from tables that were made before."""
    unknowns, models, torques = found.unknowns, found.models, found.torques
    run = executor.map if executor else map
    rests, shares = [unknowns.drawn(found.sizes.draws, found.seed)] * len(models), np.full(len(models), 1 / len(models))
    evidence, place = None, -1
    if traced := tuple(trial for trial in trials if trial.trace):
        if rig is None:
            raise UsageError("traces need the rig that they were measured on")
        place = torques.index(rig.M_g)
        error = float(found.standard_error_arcsec[place])
        evidence = evidence_of(models[0], found.responses[0][place], traced, rig, error)
        cases = [
            Case(model, row[place], unknowns, evidence, SCALE, float(SCALES[-1]))
            for model, row in zip(models, found.responses, strict=True)
        ]
        rests, shares = drawn_from_traces(cases, found.sizes.traced_draws, found.sizes.particles, found.seed, executor)
    worlds = [(k, model.with_values(values)) for k, model in enumerate(models) for values in rests[k]]
    tasks = [
        (world, unknowns, found.responses[k][t], reseat, evidence if t == place else None)
        for t in range(len(torques))
        for k, world in worlds
    ]
    F_ior, slope, off, told = [], [], [], []
    for values, slopes, missed, likely in run(_world, tasks):
        off.append(missed)
        F_ior.append(values)
        slope.append(slopes)
        if likely is not None:
            told.append(likely)
        if progress:
            progress(STATES)
    size, direction = unknowns.size_um, unknowns.direction_deg
    shape = (len(torques), len(worlds), len(size), len(direction))
    scale, likely = 1 + SCALE * SCALES, norm.pdf(SCALES) / norm.pdf(SCALES).sum()
    count = np.array([len(rest) for rest in rests])
    model = np.repeat(np.arange(len(models)), count)
    weight = np.multiply.outer(
        np.multiply.outer(likely, shares[model] / count[model]),
        np.outer(unknowns.size_weight, unknowns.direction_weight),
    )
    if told:
        weight = _taught(weight, np.array(told))
    return OffsetPrior(
        drive=unknowns.drive,
        torques=torques,
        size_um=size,
        direction_deg=direction,
        weight=weight.reshape(-1, *shape[2:]),
        F_ior_arcsec=_scaled(np.array(F_ior).reshape(shape), scale),
        seat_slope=_scaled(np.array(slope).reshape(shape), scale),
        model=np.tile(model, len(scale)),
        scale=np.repeat(scale, len(worlds)),
        standard_error_arcsec=np.sqrt(found.standard_error_arcsec**2 + np.array(off).reshape(shape[:2]).mean(axis=1)),
        certificate=found.certificate,
        traced=traced,
    )


def _taught(weight: Array, log: Array) -> Array:
    """Weights, shape (scales, worlds, sizes, directions), with what traces say inside of a world, which keeps its own.

    Worlds were drawn as likely as the traces make them; log likelihoods, shape (worlds, scales, sizes, directions).
    """
    whole = weight.sum(axis=(0, 2, 3))
    log = np.moveaxis(log, 0, 1)
    taught = weight * np.exp(log - log.max(axis=(0, 2, 3), keepdims=True))
    taught = np.where(taught > NEGLIGIBLE * taught.max(axis=(0, 2, 3), keepdims=True), taught, 0.0)
    return np.asarray(taught * (whole / taught.sum(axis=(0, 2, 3)))[:, None, None])


def _scaled(values: Array, scale: Array) -> Array:
    """Values at each scale, the worlds of one scale after those of another."""
    return np.concatenate([values * factor for factor in scale], axis=1)


def _not_overridden(drive: Drive, values: dict[str, float]) -> dict[str, float]:
    return {path: value for path, value in values.items() if not is_overridden(path, drive.origin.overrides)}


def _span(
    model: Drive,
    rest: list[dict[str, float]],
    unknowns: Unknowns,
    seed: int,
    draws: int,
    *,
    traced: bool,
    reseat: bool,
) -> list[Drive]:
    """Drives that a table is compared on, the widest offset of each world among them."""
    names, widest = unknowns.names, unknowns.widest
    shares = qmc.Sobol(2, seed=seed).random(draws)
    pairs = [(*share, values) for share, values in zip(shares, cycle(rest), strict=False)]
    drives = [model.with_values({**v, names.size: widest * s, names.direction: 360 * d}) for s, d, v in pairs]
    drives += [model.with_values({**values, names.size: widest}) for values in rest]
    if traced:
        drives.append(model.with_values({**unknowns.outermost(), names.size: widest}))
    if reseat:
        drives.append(drives[-1].with_values({"tolerances.e_b": model.number("tolerances.e_b") + SEAT_STEP}))
    return drives


SEAT_STEP = 5.0  # um that the wheel's centre is moved by, to see what its seat's error does

_World = tuple[Drive, Unknowns, ErrorTable, bool, Evidence | None]


def _world(task: _World) -> tuple[Array, Array, float, Array | None]:
    """F'_ior [arcsec] of one world and its slope by the seat's error, shape (sizes, directions) each.

    And the mean square of what interpolation over sizes and directions misses; and the log likelihood of the traces,
    shape (scales, sizes, directions), where there are any.
    """
    drive, unknowns, response, reseat, evidence = task
    values, missed, told = _over_offsets(drive, unknowns, response, evidence)
    if not reseat:
        return values, np.zeros_like(values), missed, told
    moved = [_over_offsets(drive, unknowns, response, None, SEAT_STEP * 1j**k)[0] - values for k in range(4)]
    # both components vary: twice the mean square over four directions, were it linear
    return values, np.sqrt(2 * np.mean(np.square(moved), axis=0)) / SEAT_STEP, missed, told


def _over_offsets(
    drive: Drive, unknowns: Unknowns, response: ErrorTable, evidence: Evidence | None, off_um: complex = 0
) -> tuple[Array, float, Array | None]:
    """As _world, without slopes; off_um: the fixed wheel's centre off its place."""
    # the scalars are affine in the offset's two components
    names = unknowns.names
    nothing, x, y = (
        deviation_scalars(drive.with_values({names.size: size, names.direction: phi}), *turns())
        for size, phi in ((0.0, 0.0), (1.0, 0.0), (1.0, 90.0))
    )
    if off_um:
        nothing, x, y = (off_centre(drive, each, off_um) for each in (nothing, x, y))
    size = np.linspace(0, unknowns.widest, SIZES)
    phi = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    kinematics = Kinematics.of(drive)
    coarse, curves = [], []

    def scalars(s: Array, p: Array) -> Array:
        along, aside = ((s * part(p))[:, None, None] for part in (np.cos, np.sin))
        return np.asarray(nothing + along * (x - nothing) + aside * (y - nothing))

    for s in size:
        rotation = response.rotation(scalars(np.full(DIRECTIONS, s), phi))
        coarse.append(response.range_of(rotation))
        if evidence:
            curves.append(np.asarray(curves_of(rotation, kinematics), dtype=np.float32))
    told = None
    if evidence:
        told = log_likelihood(np.array(curves), evidence, 1 + SCALE * SCALES, kinematics.u, FINE_SIZES, FINE_DIRECTIONS)
    grid = np.array(coarse)
    share = qmc.Sobol(2, seed=0).random(BETWEEN)
    exact = response.F_ior(scalars(unknowns.widest * share[:, 0], 2 * np.pi * share[:, 1]))
    around = np.append(grid, grid[:, :1], axis=1)
    between = map_coordinates(around, share.T * [[SIZES - 1], [DIRECTIONS]], order=1)
    return _finer(grid), float(np.mean(np.square(exact - between))), told


def _finer(coarse: Array) -> Array:
    """Interpolated from the computed sizes and directions to the fine ones."""
    fine = np.linspace(0, SIZES - 1, FINE_SIZES)
    rows = np.array([np.interp(fine, np.arange(SIZES), column) for column in coarse.T])
    around = np.append(rows, rows[:1], axis=0)
    places = np.arange(FINE_DIRECTIONS) * DIRECTIONS / FINE_DIRECTIONS
    return np.array([np.interp(places, np.arange(DIRECTIONS + 1), column) for column in around.T])
