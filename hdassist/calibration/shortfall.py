"""What stood in the way of a fit: the targets that it misses, by how much, and the bounds that held it back."""

from __future__ import annotations

from collections.abc import Sequence

from hdassist.calibration.targets import Target, Unknown
from hdassist.model.geometry import Array
from hdassist.preset.kinds import plain

AT_BOUND = 0.01  # of the bounds' width: nearer than that a value stands at its bound
FURTHER, GAIN = 0.1, 0.01  # of the width, of the sum of squares: what going on beyond a bound would have to bring


def holding(unknowns: Sequence[Unknown], point: Array, off: Array, jacobian: Array) -> tuple[float | None, ...]:
    """For each unknown the bound at which it stands and beyond which the fit would go on; None where there is none.

    Arguments: point, of the unit cube; off, how far the targets are off there, in their tolerances; jacobian, its
    change over the unit cube, shape (targets, unknowns).
    """
    slope, worth = 2 * off @ jacobian * FURTHER, GAIN * float(off @ off)
    bounds: list[float | None] = []
    for unknown, at, gain in zip(unknowns, point.tolist(), slope.tolist(), strict=True):
        low, high = at < AT_BOUND and gain > worth, at > 1 - AT_BOUND and -gain > worth
        bounds.append(unknown.low if low else unknown.high if high else None)
    return tuple(bounds)


def missed(target: Target, found: float) -> str:
    """By how much a value misses a target, in words."""
    value = f"{target.words} {plain(float(f'{found:.3g}'))} {target.unit}"
    if target.trace is not None:
        return f"{value} rms off the trace, {target.tolerance:g} allowed"
    end = target.low if found < target.low else target.high
    wanted = end if target.value is None else target.value
    side = "above" if found > wanted else "below"
    by = f"{100 * abs(found / wanted - 1):.2g} %" if wanted else f"{abs(found):.2g} {target.unit}"
    return f"{value} is still {by} {side} its target {plain(wanted)}"


def in_the_way(
    unknowns: Sequence[Unknown],
    targets: Sequence[Target],
    found: Sequence[float],
    met: Sequence[bool],
    held: Sequence[float | None],
) -> str:
    """Targets that are missed and bounds that held the fit back, in words; empty where all targets are met.

    Arguments: found, the quantity of each target, and whether it is met; held, the bound that holds each unknown.
    """
    words = [missed(target, value) for target, value, ok in zip(targets, found, met, strict=True) if not ok]
    at = [f"{u.path} stands at its bound {plain(b)}" for u, b in zip(unknowns, held, strict=True) if b is not None]
    return "; ".join([*words, *(at or ["no bound is in the way"])]) if words else ""
