"""Deviations that are not known, as JSON."""

from __future__ import annotations
