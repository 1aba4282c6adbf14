"""Measured wheels in the answers: in words, and as JSON."""

from __future__ import annotations

from hdassist.model.wheels import MeasuredTeeth, MeasuredWheel
from hdassist.preset.yamltext import shown
from hdassist.terminal.texts import texts


def wheels(measured: MeasuredTeeth | None) -> list[tuple[str, MeasuredWheel]]:
    """The wheels that are measured, by their name in the catalogue: rigid, flexspline."""
    found = (("rigid", measured.b), ("flexspline", measured.g)) if measured else ()
    return [(name, wheel) for name, wheel in found if wheel is not None]


def heading(measured: MeasuredTeeth | None) -> str:
    """Words behind a heading: whose teeth were measured; empty where none were."""
    found = [f"{texts()(f'wheel.{name}')} ({shown(wheel.pitch.file)})" for name, wheel in wheels(measured)]
    return f"; measured teeth: {', '.join(found)}" if found else ""
