"""Deviations that are not known, as JSON."""

from __future__ import annotations

from collections.abc import Iterable

from hdassist.model.unknown import Unknown
from hdassist.terminal.answers import Json


def unknown_objects(unknown: Iterable[Unknown]) -> list[Json]:
    """Deviations that are not known: each with the range that it may have, in the unit of its field."""
    return [{"field": u.path, "range": [u.low, u.high], "reason": u.reason} for u in unknown]
