"""The mounting position under uncertainty: phases and sizes of deviations are measured, and measured wrongly."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor

import numpy as np

from hdassist.error.error_map import SEARCHED, Batch, ErrorMap, searchable
from hdassist.error.table import DEVIATIONS
from hdassist.errors import UsageError
from hdassist.model.unknown import draw
from hdassist.mounting.cloud import MESH, cloud_of, open_fields
from hdassist.mounting.losses import Criterion, Losses
from hdassist.mounting.positions import MountingCurve, rotated
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY, Certificate, Progress

LEAST_PROBABILITY = 0.95  # of a gain, for a turn to be worth making


def robust(
    drive: Drive,
    curve: MountingCurve,
    *,
    samples: int = 256,
    criterion: str = "expected",
    seed: int = 0,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Losses:
    """Sample what a preset does not know, or gives an uncertainty for, and look at each usable position of a curve.

    Uncertainties are expanded ones (k = 2) of normal distributions, cut where a field ends; what is not known is drawn
    evenly. Many samples that differ in deviations alone are read off a table. Executor and progress as in
    mounting_curve. Raises UsageError where all is known, for an unknown criterion, or with rolling balls;
    UntrustedError where an answer cannot be trusted.
    """
    how = Criterion.of(criterion)
    if not is_open(drive):
        raise UsageError("the preset gives no uncertainty", "like --set uncertainty.phases.xi_b=10")
    if not searchable(drive):
        raise UsageError("uncertainty needs locked balls", "bearing.ball_motion: locked")
    rotations = (0.0, *curve.rotation_deg[curve.usable].tolist())
    if interpolates(drive, samples, len(rotations)):
        open_ = open_fields(drive)
        cloud = cloud_of(drive, curve.torques, open_, samples, seed=seed, executor=executor, progress=progress)
        found = np.array([cloud.at(rotations, cloud.possible, M_g, executor) for M_g in curve.torques])
        proof, errors = cloud.certificate, tuple(cloud.tables[M_g].standard_error for M_g in curve.torques)
    else:
        tasks = [(sample, curve.torques, rotations) for sample in draw(drive, samples, seed)]
        F_ior, proof, errors = [], EMPTY, ()
        for values, certificate in (executor.map if executor else map)(_searched, tasks):
            F_ior.append(values)
            proof += certificate
            if progress:
                progress(certificate.states)
        found = np.moveaxis(np.array(F_ior), 0, 1)
    # found: torques, samples, positions with the present one first
    return Losses(rotations[1:], found[..., 1:], found[..., 0], how, curve.weights, True, errors, proof)


def is_open(drive: Drive) -> bool:
    """Whether there is anything to sample: what is not known, or has an uncertainty."""
    return bool(open_fields(drive))


def interpolates(drive: Drive, samples: int, positions: int) -> bool:
    """Whether samples differ in deviations alone and are so many that a table of the error pays."""
    deviations = all(path.startswith(DEVIATIONS) for path in drive.uncertainty)
    return deviations and samples * positions * SEARCHED > MESH.states(drive)


def sample_states(drive: Drive, samples: int, positions: int) -> int:
    """Number of states that the samples take at one torque, about, for a progress bar."""
    if not is_open(drive) or not samples:
        return 0
    return MESH.states(drive) if interpolates(drive, samples, positions) else samples * positions * SEARCHED


def _searched(task: tuple[Drive, Sequence[float], Sequence[float]]) -> tuple[list[list[float]], Certificate]:
    """F'_ior [arcsec] of a drive, a row a torque, with its wheel turned, and their proof."""
    drive, torques, rotations = task
    maps = [ErrorMap(drive, M_g) for M_g in torques]
    found = [[each.many_extremes(Batch.of(rotated(drive, rotation))) for rotation in rotations] for each in maps]
    return [[f.first for f in row] for row in found], sum((f.certificate for row in found for f in row), EMPTY)
