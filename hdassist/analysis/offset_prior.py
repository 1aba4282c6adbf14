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
from scipy.stats import norm, qmc

from hdassist.analysis.extremes import searchable
from hdassist.analysis.response import DEVIATIONS, Response, tables, turns
from hdassist.errors import UsageError
from hdassist.model.deviations import deviation_scalars
from hdassist.model.geometry import Array
from hdassist.preset.convert import field_table
from hdassist.preset.drive import Drive, least_of
from hdassist.preset.overrides import is_overridden
from hdassist.solve.answers import EMPTY, Certificate, Progress

WORLDS = 64  # draws for each set of stiffnesses; with 16 many trials came out surer than they were
SIZES, DIRECTIONS = 11, 36  # of the offset, at which F'_ior is computed
FINE_SIZES, FINE_DIRECTIONS = 41, 72  # and interpolated to
NARROWEST = 1.0  # um: a size needs some width to be weighed over
WIDEST = 2.0  # an offset without an uncertainty may be so many times the preset's
SCALE = 0.10  # standard deviation of the drive's F'_ior over the model's, assumed; docs/trials.md shows what it brings
SCALES = np.linspace(-2.4, 2.4, 7)  # standard deviations at which it is taken
STATES = 4_000  # that a world's F'_ior at a torque is worth, about, for a progress bar


@dataclass(frozen=True)
class OffsetNames:
    """Fields of the offset that stands with the fixed wheel, and of that wheel's own deviation."""

    size: str
    direction: str
    tooth: str

    @classmethod
    def of(cls, drive: Drive) -> OffsetNames:
        """Those of a drive, by the wheel that is fixed."""
        if drive.mounting.fixed == "rigid":
            return cls("tolerances.e_hb", "phases.phi_hb", "tolerances.F_i2")
        return cls("tolerances.e_hg", "phases.phi_hg", "tolerances.F_i1")


@dataclass(frozen=True)
class OffsetPrior:
    """F'_ior over worlds, sizes and directions of the offset, and how likely each is before any trial.

    size_um, shape (sizes,); direction_deg, shape (directions,), evenly over the turn from 0; weight, shape (worlds,
    sizes, directions), sums to 1; F_ior_arcsec, with the fixed wheel at rotation 0, and tooth_slope, its change by
    a micrometre more of that wheel's own deviation (half its range) [arcsec/um], shape (torques, worlds, sizes,
    directions); tooth_um, that deviation, shape (worlds,); model, which set of stiffnesses a world has, 0 for the
    preset's, and scale, the drive's F'_ior over the model's, already in F_ior_arcsec, shape (worlds,);
    standard_error_arcsec of F_ior_arcsec, shape (torques,).
    """

    drive: Drive
    torques: tuple[float, ...]
    size_um: Array
    direction_deg: Array
    weight: Array
    F_ior_arcsec: Array
    tooth_slope: Array
    tooth_um: Array
    model: NDArray[np.int64]
    scale: Array
    standard_error_arcsec: Array
    certificate: Certificate

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
        if not reseat_um:
            return np.zeros(1)
        along = _turned(self.tooth_slope, rotation_deg) * reseat_um
        step = np.radians(360 / len(self.direction_deg))
        slope = (np.roll(self.F_ior_arcsec, -1, -1) - np.roll(self.F_ior_arcsec, 1, -1)) / (2 * step)
        aside = np.arctan2(reseat_um, self.tooth_um)[:, None, None] * _turned(slope, rotation_deg)
        return np.asarray(np.hypot(along, aside))


def _turned(values: Array, rotation_deg: float) -> Array:
    """Values at directions less by the rotation; directions come last."""
    count = values.shape[-1]
    whole, part = divmod(rotation_deg * count / 360, 1)
    first = np.roll(values, int(whole), axis=-1)
    return first if part < 1e-9 else np.asarray((1 - part) * first + part * np.roll(first, 1, axis=-1))


def offset_prior(
    drive: Drive,
    torques: Sequence[float],
    *,
    reseat: bool = False,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> OffsetPrior:
    """What is known of the offset of a drive before any trial.

    Its direction is open and its size anywhere up to WIDEST times the preset's, unless the preset gives an uncertainty
    for them; the same holds for the offset that turns with the cam. Other deviations that have an uncertainty are
    drawn; stiffnesses are the preset's and its alternatives'.

    Arguments: torques [N*m]; reseat, whether tooth_slope is wanted (zero without); executor and progress as in
    mounting_curve. Raises UsageError for a drive with rolling balls, without an offset, or with an uncertainty in
    a field that is no deviation; UntrustedError where an answer cannot be trusted.
    """
    names = OffsetNames.of(drive)
    if not searchable(drive):
        raise UsageError("trials need locked balls", "bearing.ball_motion: locked")
    others = [path for path in drive.uncertainty if not path.startswith(DEVIATIONS)]
    if others:
        raise UsageError(
            f"trials cannot take in an uncertainty of {', '.join(others)}",
            "leave it out; sets of values that agree with a calibration belong to alternatives",
        )
    size, weight = _sizes(drive, names.size)
    direction = np.arange(FINE_DIRECTIONS) * 360.0 / FINE_DIRECTIONS
    facing = _facing(drive, names.direction, direction)
    models = [drive, *(drive.with_values(_not_overridden(drive, values)) for values in drive.alternatives)]
    rest = _draw(drive, names, seed)
    worlds = [model.with_values(values) for model in models for values in rest]
    spans = [_span(model, rest, names, float(size[-1]), seed) for model in models]
    responses = tables(list(zip(models, spans, strict=True)), torques, executor=executor, progress=progress)
    tasks = [
        (world, names, float(size[-1]), responses[k // len(rest)][t], reseat)
        for t in range(len(torques))
        for k, world in enumerate(worlds)
    ]
    F_ior, slope = [], []
    for values, slopes in (executor.map if executor else map)(_world, tasks):
        F_ior.append(values)
        slope.append(slopes)
        if progress:
            progress(STATES)
    shape = (len(torques), len(worlds), len(size), len(direction))
    scale, likely = 1 + SCALE * SCALES, norm.pdf(SCALES) / norm.pdf(SCALES).sum()
    proofs = [response.certificate for row in responses for response in row]
    return OffsetPrior(
        drive=drive,
        torques=tuple(torques),
        size_um=size,
        direction_deg=direction,
        weight=np.multiply.outer(np.repeat(likely, len(worlds)) / len(worlds), np.outer(weight, facing)),
        F_ior_arcsec=_scaled(np.array(F_ior).reshape(shape), scale),
        tooth_slope=_scaled(np.array(slope).reshape(shape), scale),
        tooth_um=np.tile([float(world.value(names.tooth)) / 2 for world in worlds], len(scale)),
        model=np.tile(np.repeat(np.arange(len(models)), len(rest)), len(scale)),
        scale=np.repeat(scale, len(worlds)),
        standard_error_arcsec=np.max([[r.standard_error for r in row] for row in responses], axis=0),
        certificate=sum(proofs, EMPTY),
    )


def _scaled(values: Array, scale: Array) -> Array:
    """Values at each scale, the worlds of one scale after those of another."""
    return np.concatenate([values * factor for factor in scale], axis=1)


def _sizes(drive: Drive, path: str) -> tuple[Array, Array]:
    """Sizes of the offset [um] and how likely each is."""
    value, uncertainty = float(drive.value(path)), drive.uncertainty.get(path)
    if uncertainty is None:
        if not value > 0:
            raise UsageError(
                f"nothing is known of the size of the cam offset {path}",
                f"--set {path}=80 says that up to {WIDEST:g} times 80 um are likely",
            )
        return np.linspace(0, WIDEST * value, FINE_SIZES), np.full(FINE_SIZES, 1 / FINE_SIZES)
    size = np.linspace(0, max(value + 2 * uncertainty, NARROWEST), FINE_SIZES)
    # no narrower than the grid can show
    weight = norm.pdf(size, value, max(uncertainty / 2, size[1] / 2))
    return size, weight / weight.sum()


def _facing(drive: Drive, path: str, direction: Array) -> Array:
    """How likely each direction [deg] of the offset is."""
    uncertainty = drive.uncertainty.get(path)
    if uncertainty is None:
        return np.full(len(direction), 1 / len(direction))
    away = (direction - float(drive.value(path)) + 180) % 360 - 180
    weight = norm.pdf(away, 0, max(uncertainty / 2, 180 / len(direction)))
    return np.asarray(weight / weight.sum())


def _not_overridden(drive: Drive, values: dict[str, float]) -> dict[str, float]:
    return {path: value for path, value in values.items() if not is_overridden(path, drive.origin.overrides)}


def _draw(drive: Drive, names: OffsetNames, seed: int) -> list[dict[str, float]]:
    """Values of the rest, drawn evenly over what they may be, one dict a world; one world where nothing is open."""
    e_hh, phi_hh = "tolerances.e_hh", "phases.phi_hh"
    measured = {path for path in drive.uncertainty if path not in (names.size, names.direction)}
    if not drive.tolerances.e_hh and not any(drive.uncertainty[path] for path in measured):
        return [{}]  # nothing to draw
    paths = sorted({e_hh, phi_hh} | measured)
    points = qmc.Sobol(len(paths), seed=seed).random(WORLDS)
    drawn = {}
    for path, share in zip(paths, points.T, strict=True):
        value = float(drive.value(path))
        if path in measured:
            least = least_of(field_table()[path])
            drawn[path] = np.maximum(value + drive.uncertainty[path] / 2 * norm.ppf(share), least)
        else:
            drawn[path] = share * (WIDEST * value if path == e_hh else 360.0)
    return [{path: float(values[k]) for path, values in drawn.items()} for k in range(WORLDS)]


def _span(model: Drive, rest: list[dict[str, float]], names: OffsetNames, widest: float, seed: int) -> list[Drive]:
    """Drives that a table is compared on, the widest offset of each world among them."""
    shares = qmc.Sobol(2, seed=seed).random(WORLDS)
    pairs = [(*share, values) for share, values in zip(shares, cycle(rest), strict=False)]
    drives = [model.with_values({**v, names.size: widest * s, names.direction: 360 * d}) for s, d, v in pairs]
    drives += [model.with_values({**values, names.size: widest}) for values in rest]
    wider = {names.tooth: 1 + max(float(d.value(names.tooth)) for d in drives) + 2 * TOOTH_STEP}
    return [*drives, drives[-1].with_values(wider)]


TOOTH_STEP = 5.0  # um of the fixed wheel's deviation, over which the slope is taken

_World = tuple[Drive, OffsetNames, float, Response, bool]


def _world(task: _World) -> tuple[Array, Array]:
    """F'_ior [arcsec] of one world and its slope by the wheel's own deviation, shape (sizes, directions) each."""
    drive, names, widest, response, reseat = task
    values = _over_offsets(drive, names, widest, response)
    if not reseat:
        return values, np.zeros_like(values)
    more = drive.with_values({names.tooth: float(drive.value(names.tooth)) + 2 * TOOTH_STEP})
    return values, (_over_offsets(more, names, widest, response) - values) / TOOTH_STEP


def _over_offsets(drive: Drive, names: OffsetNames, widest: float, response: Response) -> Array:
    # the scalars are affine in the offset's two components
    nothing, x, y = (
        deviation_scalars(drive.with_values({names.size: size, names.direction: phi}), *turns())
        for size, phi in ((0.0, 0.0), (1.0, 0.0), (1.0, 90.0))
    )
    size = np.linspace(0, widest, SIZES)
    phi = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    coarse = np.array(
        [
            response.F_ior(
                np.array([nothing + s * (np.cos(p) * (x - nothing) + np.sin(p) * (y - nothing)) for p in phi])
            )
            for s in size
        ]
    )
    return _finer(coarse)


def _finer(coarse: Array) -> Array:
    """Interpolated from the computed sizes and directions to the fine ones."""
    fine = np.linspace(0, SIZES - 1, FINE_SIZES)
    rows = np.array([np.interp(fine, np.arange(SIZES), column) for column in coarse.T])
    around = np.append(rows, rows[:1], axis=0)
    places = np.arange(FINE_DIRECTIONS) * DIRECTIONS / FINE_DIRECTIONS
    return np.array([np.interp(places, np.arange(DIRECTIONS + 1), column) for column in around.T])
