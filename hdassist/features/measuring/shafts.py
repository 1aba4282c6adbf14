"""Components of a recording that repeat with shafts outside the drive, such as belts, pulleys and motors.

A shaft makes f revolutions per input revolution. Its component a cos(2 pi f x + phase) over the input angle x is fitted
together with the orders of the drive, the slow terms and the lines of the recording, so that these do not absorb any
part of it. A shaft gets no component if the recording does not distinguish it from an order of the drive, from another
shaft or from slow terms, or if the readings are too far apart.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hdassist.drive.model.geometry import Array
from hdassist.features.measuring.fit import RESOLVED_GAP, TraceFit, distance, fit_orders
from hdassist.features.measuring.orders import Gearing
from hdassist.features.measuring.terms import bins_of
from hdassist.readers.trace import MeasuredTrace
from hdassist.readers.words import TIMES
from hdassist.run.errors import DataError, UsageError
from hdassist.run.files import number_of

_FEWEST_PERIODS = 3.0  # minimum number of shaft revolutions in a recording; with fewer, the component looks like drift
_READINGS_PER_PERIOD = 2.5  # minimum number of readings per revolution of a shaft
_UNEVEN_REVOLUTION = 0.1  # largest departure of a shaft's angle from constant speed, as a share of its revolution
_SAME_LINE = 1e-6  # relative rounding error of an order
_LARGEST = 1e6  # largest number of shaft revolutions per input or output revolution, and largest period in seconds
_SHAFT_HINT = (
    "state a period, or revolutions per revolution of the input or output: belt=288s, motor=12/input, pulley=5/output"
)


@dataclass(frozen=True)
class Shaft:
    """A shaft outside the drive.

    name: name of the component.
    text: period or speed as entered.
    period_s: time of one revolution, None if it was not stated.
    per_rev: revolutions per revolution of the input or output, None if a period was stated.
    is_of_output: whether per_rev refers to the output.
    """

    name: str
    text: str
    period_s: float | None = None
    per_rev: float | None = None
    is_of_output: bool = False


@dataclass(frozen=True)
class ShaftComponent:
    """Component of a shaft in one direction of a recording: amplitude cos(per_cam_rev angle + phase).

    shaft: name of the shaft.
    stated: period or speed of the shaft as entered.
    per_cam_rev: shaft revolutions per input revolution.
    period_s: time of one revolution, None in a recording without times.
    measured_per_cam_rev: per_cam_rev measured in the recording, None if no line is found there.
    amplitude_arcsec, uncertainty_arcsec, phase_deg: amplitude with its standard uncertainty, and phase; None if the
    recording does not determine the component.
    missing: reason why the recording does not determine the component, empty if it does.
    """

    shaft: str
    stated: str
    per_cam_rev: float
    period_s: float | None
    measured_per_cam_rev: float | None = None
    amplitude_arcsec: float | None = None
    uncertainty_arcsec: float | None = None
    phase_deg: float | None = None
    missing: str = ""

    def is_line(self, per_cam_rev: float) -> bool:
        """Return whether the line of the recording at an order is that of the shaft."""
        line = self.measured_per_cam_rev
        return line is not None and abs(line - per_cam_rev) < _SAME_LINE * line


def parse_shafts(text: str | None) -> tuple[Shaft, ...]:
    """Return the shafts in a text such as "belt=288s,motor=12/input", or an empty tuple if the text is None.

    Raises UsageError if the text does not have this form, or if a name occurs twice.
    """
    shafts = list[Shaft]()
    for part in text.split(",") if text is not None else ():
        name, _, stated = part.strip().partition("=")
        # a period with a unit of time, or the number of shaft revolutions per input or output revolution
        match = re.fullmatch(r"\s*([^\s/a-zA-Z]+)\s*(?:/\s*(input|output)|([a-z]+))\s*", stated)
        amount = number_of(match[1]) if match else 0.0
        unit = match[3] if match else None
        if not name.strip() or match is None or not 0 < amount <= _LARGEST or (unit and unit not in TIMES):
            raise UsageError(f"invalid --shafts {part}: expected NAME=PERIOD or NAME=N/input", _SHAFT_HINT)
        if any(shaft.name == name for shaft in shafts):
            raise UsageError(f"invalid --shafts {text}: {name} is stated twice", "state each shaft once")
        # conversion of a period to an order requires the speed of the recording
        if unit:
            shafts.append(
                Shaft(
                    name,
                    stated.strip(),
                    period_s=amount * TIMES[unit],
                )
            )
        else:
            shafts.append(
                Shaft(
                    name,
                    stated.strip(),
                    per_rev=amount,
                    is_of_output=match[2] == "output",
                )
            )
    return tuple(shafts)


@dataclass(frozen=True)
class _Place:
    """The position of a shaft among the orders of a recording.

    shaft: shaft as entered.
    order: revolutions of the shaft per input revolution, from the stated period or speed.
    line: order of the fitted line that is not resolved from this order, None if there is no such line.
    """

    shaft: Shaft
    order: float
    line: float | None

    @property
    def shown_order(self) -> float:
        """The order of the line, or the stated order if there is no line."""
        return self.order if self.line is None else self.line


def shaft_components(
    trace: MeasuredTrace,
    fit: TraceFit,
    shafts: Sequence[Shaft],
    gearing: Gearing | None,
) -> tuple[ShaftComponent, ...]:
    """Return the component of each shaft in one direction of a recording.

    trace: recording in this direction, to which the fit was made.
    fit: fit with the lines that were found.
    shafts: shafts as entered.
    gearing: gearing of the drive, None if it is unknown.
    Raises DataError for a period if the recording has no times or its speed varies.
    Raises UsageError for revolutions per output revolution if the ratio is unknown.
    """
    speed = _input_speed(trace)
    places = []
    for shaft in shafts:
        order = _order_of(shaft, trace, gearing, speed)
        places.append(_Place(shaft, order, _line_near(fit, order)))
    _require_even_speed(trace, places)
    reasons = [_missing(place, places, trace, fit) for place in places]
    resolved = [place.shown_order for place, reason in zip(places, reasons, strict=True) if not reason]
    joint_fit = _fitted(trace, fit, np.array(resolved)) if resolved else fit
    components = []
    for place, reason in zip(places, reasons, strict=True):
        period = place.shaft.period_s or (1 / (place.order * speed) if speed else None)
        component = ShaftComponent(
            shaft=place.shaft.name,
            stated=place.shaft.text,
            per_cam_rev=place.order,
            period_s=period,
            measured_per_cam_rev=place.line,
            missing=reason,
        )
        components.append(component if reason else _with_wave(component, joint_fit, place.shown_order))
    return tuple(components)


def _with_wave(
    component: ShaftComponent,
    fit: TraceFit,
    order: float,
) -> ShaftComponent:
    """Return a component with the amplitude and phase of an order of a fit."""
    index = int(np.abs(fit.orders - order).argmin())
    wave = fit.wave(np.array([index]))
    return replace(
        component,
        amplitude_arcsec=wave.amplitude_arcsec,
        uncertainty_arcsec=wave.uncertainty_arcsec,
        phase_deg=wave.phase_deg,
    )


def _input_speed(trace: MeasuredTrace) -> float | None:
    """Return the mean speed of the input [revolutions/s], or None for a recording without times."""
    if trace.turns_per_s:
        return trace.turns_per_s
    if trace.time_s is None:
        return None
    sweeps = zip(
        trace.by_sweep(trace.cam_deg),
        trace.by_sweep(trace.time_s),
        strict=True,
    )
    turned, lasted = np.sum([(abs(angle[-1] - angle[0]) / 360, time[-1] - time[0]) for angle, time in sweeps], axis=0)
    return float(turned / lasted)


def _order_of(
    shaft: Shaft,
    trace: MeasuredTrace,
    gearing: Gearing | None,
    speed: float | None,
) -> float:
    """Return the revolutions of a shaft per input revolution. Raises the errors of `shaft_components`."""
    if shaft.per_rev is not None and not shaft.is_of_output:
        return shaft.per_rev
    if shaft.per_rev is not None:
        if gearing is None:
            raise UsageError(
                f"--shafts {shaft.name}={shaft.text} needs the ratio of the drive",
                "state the ratio with --ratio, or name the drive with --drive",
            )
        return shaft.per_rev / gearing.ratio
    if speed is None:
        message = f"{trace.file}: --shafts {shaft.name}={shaft.text} states a time, but the recording contains no times"
        raise DataError(message, _revolutions_hint(shaft.name))
    return 1 / (float(shaft.period_s or 0.0) * speed)


def _revolutions_hint(name: str) -> str:
    """Return the hint to state the revolutions of a shaft instead of its period."""
    return f"state the revolutions of the shaft per input revolution: --shafts {name}=N/input"


def _require_even_speed(trace: MeasuredTrace, places: Sequence[_Place]) -> None:
    """Raise DataError if the input speed varies too much to convert a period into revolutions per input revolution."""
    if trace.turns_per_s or trace.time_s is None:
        return
    speed = _input_speed(trace) or 0.0
    departure = 0.0  # largest departure of the input angle from the angle at constant speed, in revolutions
    for angle, time in zip(trace.by_sweep(trace.cam_deg), trace.by_sweep(trace.time_s), strict=True):
        off_turns = np.abs(angle - angle[0]) / 360 - speed * (time - time[0])
        departure = max(departure, float(np.ptp(off_turns)) / 2)
    for place in places:
        name = place.shaft.name
        if place.shaft.period_s and departure * place.order > _UNEVEN_REVOLUTION:
            message = (
                f"{trace.file}: the input speed varies, so the angle of {name} is uncertain by "
                f"{departure * place.order:.2g} revolutions"
            )
            raise DataError(message, _revolutions_hint(name))


def _line_near(fit: TraceFit, order: float) -> float | None:
    """Return the order of the fitted line that is not resolved from a given order, or None if there is none."""
    within = RESOLVED_GAP / fit.bins.span
    candidates = [line for line in np.asarray(fit.lines).tolist() if abs(line - order) <= within]
    return min(
        candidates,
        key=lambda line: abs(line - order),
        default=None,
    )


def _missing(
    place: _Place,
    places: Sequence[_Place],
    trace: MeasuredTrace,
    fit: TraceFit,
) -> str:
    """Return the reason why a recording does not determine the component of a shaft, empty if it does."""
    order = place.shown_order
    span = fit.bins.span
    recording = f"over {span:.4g} input revolutions"
    if order * span < max(_FEWEST_PERIODS, fit.design.slow.periods):
        return f"{order * span:.2g} revolutions are not distinguished from slow terms {recording}"
    steps = np.concatenate([np.diff(angles) for angles in trace.by_sweep(trace.cam_deg)]) / 360
    highest = 1 / (_READINGS_PER_PERIOD * float(np.quantile(np.abs(steps[steps != 0]), 0.75)))
    if order > highest:
        return f"the readings resolve up to {highest:.3g} revolutions per input revolution, not {order:.4g}"
    drive_orders = fit.orders[~fit.is_line]
    nearest = float(drive_orders[np.abs(drive_orders - order).argmin()])
    if abs(nearest - order) < RESOLVED_GAP / span:
        declared = max(1, round(nearest))
        sidebands = "" if abs(nearest - declared) < 1e-9 else " and its sidebands"
        return f"not distinguished from order {declared:g} of the drive{sidebands} {recording}"
    for neighbour in places:
        if neighbour is not place and abs(neighbour.shown_order - order) < RESOLVED_GAP / span:
            return f"not distinguished from {neighbour.shaft.name} {recording}"
    return ""


def _fitted(
    trace: MeasuredTrace,
    fit: TraceFit,
    orders: Array,
) -> TraceFit:
    """Return the fit to a recording in which orders of shafts replace the lines that are not resolved from them."""
    within = RESOLVED_GAP / fit.bins.span
    lines = np.asarray(fit.lines, dtype=float)
    if len(lines):
        lines = lines[distance(lines, np.sort(orders)) > within]
    drive_orders = fit.orders[~fit.is_line]
    bins = bins_of(trace, max(float(drive_orders[-1]), float(orders.max())))
    return fit_orders(bins, drive_orders, fit.design.slow, np.concatenate([lines, orders]))
