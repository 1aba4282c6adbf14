"""What a preset may say of deviations: their sizes and directions. What it does not say is not known, and not zero."""

from __future__ import annotations

from typing import Any

from hdassist.preset.kinds import Section, field


def _size(meaning: str, example: float | None = None) -> Any:
    return field(meaning, "um", None, example, unknown=True, ge=0, le=1000)


def _direction(meaning: str) -> Any:
    return field(meaning, "deg", None, unknown=True, ge=-3600, le=3600)


class Tolerances(Section):
    """Deviations of the parts: first harmonics, as peak-to-peak for teeth and as offset for the cam."""

    F_i1: float | None = _size("tangential composite deviation F'_i1 of the flexspline", 75.0)
    F_i2: float | None = _size("tangential composite deviation F'_i2 of the rigid wheel", 75.0)
    e_hb: float | None = _size("cam offset that stands still with the rigid wheel", 80.0)
    e_hh: float | None = _size("cam offset that turns with the cam", 30.0)
    e_hg: float | None = _size("cam offset that goes with the flexspline")
    e_b: float | None = _size("offset of the rigid wheel's pitch circle from its pilot (half its run-out)")


class Phases(Section):
    """Directions of the deviations at phi_h = phi_g = 0, counter-clockwise seen from the cam side."""

    xi_g: float | None = _direction("phase (or mark, see mounting.mark_kind) of the flexspline")
    xi_b: float | None = _direction("phase (or mark, see mounting.mark_kind) of the rigid wheel")
    phi_hb: float | None = _direction("direction of e_hb")
    phi_hh: float | None = _direction("direction of e_hh, from the minor axis of the cam")
    phi_hg: float | None = _direction("direction of e_hg")
    phi_eb: float | None = _direction("direction of e_b, the mark of its greatest run-out")


def _amplitude(order: int, whose: str) -> Any:
    return _size(f"amplitude of order {order} of {whose}")


def _phase(size: str) -> Any:
    return _direction(f"phase of {size}, as xi_b of the first harmonic")


class Harmonics(Section):
    """Deviations of the teeth of higher order, along the pitch circle."""

    a_g2: float | None = _amplitude(2, "the flexspline's teeth")
    a_g3: float | None = _amplitude(3, "the flexspline's teeth")
    a_g4: float | None = _amplitude(4, "the flexspline's teeth")
    a_b2: float | None = _amplitude(2, "the rigid wheel's teeth (ovality)")
    a_b3: float | None = _amplitude(3, "the rigid wheel's teeth")
    a_b4: float | None = _amplitude(4, "the rigid wheel's teeth")
    a_s2: float | None = _amplitude(2, "the rigid wheel's teeth, pressed on them by its seat")
    xi_g2: float | None = _phase("a_g2")
    xi_g3: float | None = _phase("a_g3")
    xi_g4: float | None = _phase("a_g4")
    xi_b2: float | None = _phase("a_b2")
    xi_b3: float | None = _phase("a_b3")
    xi_b4: float | None = _phase("a_b4")
    xi_s2: float | None = _phase("a_s2")
