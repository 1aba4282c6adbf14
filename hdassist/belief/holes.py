"""Rule for the choice of a hole for the fixed wheel, over weighted samples of F'_ior in each hole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hdassist.drive.model.geometry import Array

NO_ERROR = 1e-9  # arcsec; F'_ior of a drive without deviations is smaller
LEAST_GAIN = 0.01  # smallest gain that pays for a turn, and that makes a hole better than another, as a share of F'_ior
FREE_STEP_DEG = 5.0  # step between positions if the angle of the seat is free [deg]
_LEAST_SHARE = 1e-12  # smallest divisor, as a share of the mean F'_ior


def governing_share(F_ior_arcsec: Array, holes_arcsec: Array) -> Array:
    """Return F'_ior over the mean of all holes at the governing torque, shape (samples, ...).

    The mean does not depend on the present hole, so the present hole is not preferred.

    F_ior_arcsec: F'_ior [arcsec], shape (torques, samples, ...).
    holes_arcsec: F'_ior in all holes [arcsec], shape (torques, samples, holes).
    """
    # F'_ior may have further axes, such as holes, to which the mean of each sample applies
    added_axes = tuple(range(2, F_ior_arcsec.ndim))
    mean = np.expand_dims(holes_arcsec.mean(axis=2), added_axes)
    # the governing torque is that at which a hole is worst relative to the mean
    return np.asarray((F_ior_arcsec / np.maximum(mean, NO_ERROR)).max(axis=0))


def losses_of(share: Array) -> Array:
    """Return the loss of each hole relative to the best hole, as a share, shape (samples, holes).

    share: F'_ior over the mean of all holes at the governing torque, shape (samples, holes).
    """
    return np.asarray(share / np.maximum(share.min(axis=1, keepdims=True), _LEAST_SHARE) - 1)


def ranked_holes(expected_loss: Array, probability_kept: Array | None) -> list[int]:
    """Return the indices of the holes, the best first: by the probability (to a hundredth), then by the loss.

    expected_loss: mean loss of each hole, shape (holes,).
    probability_kept: probability that all limits are met in each hole, shape (holes,); None without a limit.
    """
    # rounded, because a difference below a hundredth is within the Monte Carlo error
    kept = np.zeros(len(expected_loss)) if probability_kept is None else -np.round(probability_kept, 2)
    # the last key is the primary key of lexsort
    return [int(place) for place in np.lexsort((expected_loss, kept))]


def chosen_hole(
    expected_loss: Array,
    probability_kept: Array | None,
    stay: int | None,
    cost: float = LEAST_GAIN,
) -> int:
    """Return the index of the hole to choose, which is the present hole unless the expected gain of a turn pays off.

    expected_loss, probability_kept: as for `ranked_holes`.
    stay: index of the present hole; None if the wheel may not stay there.
    cost: smallest reduction of F'_ior that pays for a turn, as a share.
    """
    best = ranked_holes(expected_loss, probability_kept)[0]
    # the wheel is not in a usable hole, so it must be turned in any case
    if stay is None:
        return best
    earned = expected_loss[stay] - expected_loss[best] > cost
    # a larger probability of meeting the limit is sufficient reason for a turn
    is_likelier = probability_kept is not None and round(probability_kept[stay], 2) < round(probability_kept[best], 2)
    return best if earned or is_likelier else stay


def limits_met(F_ior_arcsec: Array, room_arcsec: Sequence[float | None]) -> Array | None:
    """Return whether each sample meets all limits in each hole, shape (samples, ...); None without a limit.

    F_ior_arcsec: F'_ior [arcsec], shape (torques, samples, ...).
    room_arcsec: limit minus self error at each torque [arcsec]; None without a limit.
    """
    # omit torques without a limit
    limits = [(k, room) for k, room in enumerate(room_arcsec) if room is not None]
    if not limits:
        return None
    return np.asarray(np.all([F_ior_arcsec[k] <= room for k, room in limits], axis=0))
