"""The limits of a preset, each with what it is for."""

from __future__ import annotations

from collections.abc import Iterator

from hdassist.acceptance.checks import LOST_MOTION, ORDER, PER_TORQUE, STIFFNESSES
from hdassist.acceptance.decision import Asked
from hdassist.errors import DataError
from hdassist.preset.fields import Drive


def limits_of(drive: Drive) -> tuple[Asked, ...]:
    """Limits of a drive in the order of the checklist, at the torques of operation.M_g and those the limits name.

    Raises DataError: there is none.
    """
    found = tuple(_limits(drive))
    if not found:
        raise DataError(
            f"{drive.name}: no limit to accept it by",
            "acceptance: {F_ior: {80: 30}} in the preset, or --limit F_ior=30",
        )
    return found


def _limits(drive: Drive) -> Iterator[Asked]:
    acceptance = drive.acceptance
    for check in PER_TORQUE:
        named = [float(key) for key in getattr(acceptance, check.field) if key != "all"]
        for M_g in dict.fromkeys([*drive.operation.M_g, *named]):
            if (limit := drive.limit(M_g, check.field)) is not None:
                yield Asked(check, limit, M_g)
    for key, limit in acceptance.order_amplitude.items():
        for M_g in drive.operation.M_g:
            yield Asked(ORDER, limit, M_g, float(key))
    for check in (LOST_MOTION, *STIFFNESSES):
        if (limit := getattr(acceptance, check.field)) is not None:
            yield Asked(check, limit)
