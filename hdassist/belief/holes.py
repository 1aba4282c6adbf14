"""The rule by which a hole of the fixed wheel is chosen, over weighted samples of F'_ior in each hole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hdassist.model.geometry import Array

NO_ERROR = 1e-9  # arcsec: a drive without deviations has less
LEAST_GAIN = 0.01  # smallest gain that pays for a turn, and that makes a hole better than another, as a share of F'_ior
FREE_STEP_DEG = 5.0  # between positions where the angle of the seat is free
_LEAST_SHARE = 1e-12  # smallest divisor, as a share of the mean F'_ior


def governing_share(F_ior_arcsec: Array, holes_arcsec: Array) -> Array:
    """Return F'_ior over the mean of all holes at the governing torque.

    The mean is the same wherever the wheel stands, so that no hole is preferred for being the present one.

    F_ior_arcsec: F'_ior [arcsec], shape (torques, samples, ...).
    holes_arcsec: F'_ior in all holes [arcsec], shape (torques, samples, holes).
    The result has the shape (samples, ...).
    """
    # F'_ior may have further axes, such as holes, which share the mean of their sample
    added_axes = tuple(range(2, F_ior_arcsec.ndim))
    mean = np.expand_dims(holes_arcsec.mean(axis=2), added_axes)
    # the torque at which a hole is worst relative to the mean governs it
    return np.asarray((F_ior_arcsec / np.maximum(mean, NO_ERROR)).max(axis=0))


def losses_of(share: Array) -> Array:
    """Return the loss of each hole against the best hole, as a share, shape (samples, holes).

    share: F'_ior over the mean of all holes at the governing torque, shape (samples, holes).
    """
    return np.asarray(share / np.maximum(share.min(axis=1, keepdims=True), _LEAST_SHARE) - 1)


def ranked_holes(expected_loss: Array, probability_kept: Array | None) -> list[int]:
    """Return the places of the holes, the best first: by the probability (to a hundredth), then by the loss.

    expected_loss: mean loss of each hole, shape (holes,).
    probability_kept: probability of each hole that all limits are met, shape (holes,); None without a limit.
    """
    # rounded: a difference below a hundredth is within the Monte Carlo error
    kept = np.zeros(len(expected_loss)) if probability_kept is None else -np.round(probability_kept, 2)
    # the last key sorts first
    return [int(place) for place in np.lexsort((expected_loss, kept))]


def chosen_hole(
    expected_loss: Array,
    probability_kept: Array | None,
    stay: int | None,
    cost: float = LEAST_GAIN,
) -> int:
    """Return the place of the hole to choose: the present hole, unless a turn is expected to earn its cost.

    expected_loss, probability_kept: as those of ranked_holes.
    stay: place of the present hole; None if the wheel may not stay there.
    cost: share of F'_ior that a turn has to earn.
    """
    best = ranked_holes(expected_loss, probability_kept)[0]
    # the wheel stands in no usable hole, so it has to be turned in any case
    if stay is None:
        return best
    earned = expected_loss[stay] - expected_loss[best] > cost
    # a larger probability of meeting the limit pays for a turn by itself
    is_likelier = probability_kept is not None and round(probability_kept[stay], 2) < round(probability_kept[best], 2)
    return best if earned or is_likelier else stay


def limits_met(F_ior_arcsec: Array, room_arcsec: Sequence[float | None]) -> Array | None:
    """Return which samples meet all limits in each hole, shape (samples, ...); None without a limit.

    F_ior_arcsec: F'_ior [arcsec], shape (torques, samples, ...).
    room_arcsec: the limit minus the self error at each torque [arcsec]; None without a limit.
    """
    # torques without a limit do not count
    limits = [(k, room) for k, room in enumerate(room_arcsec) if room is not None]
    if not limits:
        return None
    return np.asarray(np.all([F_ior_arcsec[k] <= room for k, room in limits], axis=0))
