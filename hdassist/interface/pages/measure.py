"""Reports of a recording, of approached positions or torque loops, and of the history of a drive."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import date
from typing import Any

import numpy as np

from hdassist.drive.preset.fields import Drive
from hdassist.features.acceptance.limits import CHECKS
from hdassist.features.measuring.archive import ArchiveEntry, DriveHistory, histories
from hdassist.features.measuring.bench import (
    LoopRecord,
    PlaceLoop,
    PositionRecord,
    SeenRange,
    StatedQuantity,
    loop_quantities,
    place_loops,
    position_quantities,
    seen_range,
)
from hdassist.features.measuring.fit import COVERAGE_FACTOR, SLOWEST_ORDER
from hdassist.features.measuring.iso230 import FEWEST_APPROACHES, PositioningTest, positioning_test
from hdassist.features.measuring.measure import DIRECTION_NAMES, Measurement, SweepResult
from hdassist.features.measuring.orders import (
    FULL_SHARE,
    GAP_PERIODS,
    STATED,
    FullCycle,
    Gearing,
    MeasuredOrder,
    UncertaintySource,
    likely_image,
)
from hdassist.features.measuring.slopes import RecordedTorque, Reversal
from hdassist.features.report import (
    NO_VALUE,
    CsvTable,
    Curve,
    Fact,
    Facts,
    Json,
    Lines,
    Quantity,
    Report,
    ReportSection,
    Table,
    as_json,
    as_object,
    as_objects,
    quantity_table,
)
from hdassist.interface.pages.curves import curve_of_turns, slope_words
from hdassist.interface.terminal.words import again
from hdassist.recording.waves import ALWAYS_ORDER
from hdassist.run.files import STDIN
from hdassist.run.system import command_line

_NAMED_SLOW = 0.1  # smallest size of the slow terms that a line on the page names, as a share of F'_ior
_LISTED_ORDERS = 12  # number of orders in the table, chosen by amplitude
_NAMED_IMAGE = 0.1  # smallest order that may be a higher one and is named, as a share of the largest order
_NAMED_ORDERS = 3  # number of orders that a line on the page names, chosen by amplitude


def _ends_text(interval: Sequence[float]) -> str:
    """Return the ends of an interval as text for a table."""
    return "{:.2f} to {:.2f}".format(*interval)


FORMATS: dict[str, Any] = {"direction_name": DIRECTION_NAMES.__getitem__, "ends": _ends_text}  # functions by name
_ORDER_COLUMNS = quantity_table("measure.orders", cause_or_none=lambda order: order.cause or None)
_CYCLE = quantity_table("measure.cycle")
_BUDGET = quantity_table("measure.budget")
_SHAFTS = quantity_table("measure.shafts", missing_or_none=lambda component: component.missing or None)
_SWEEP_QUANTITIES = quantity_table(
    "measure.sweep",
    yes_or_no={True: "yes", False: "no"}.__getitem__,
    percent=lambda share: f"{100 * share:.1f}",
    rows=lambda sweep: int(sweep.bins.rows.sum()),
    drift=lambda sweep: 0.0 if sweep.is_part else float(sweep.fit.drift.sum()),
    residual_rms=lambda sweep: float(np.std(sweep.fit.residual)),
    **FORMATS,
)
_ON_PAGE = quantity_table("measure.page", percent_sign=lambda share: f"{100 * share:.1f} %", **FORMATS)


def _columns(found: SweepResult) -> Sequence[Quantity[SweepResult]]:
    """Return the columns of the short table; for a lower bound, the column of F'_ior is labelled "range"."""
    # F'_ior is defined as the range over a whole cycle
    if not found.is_bound:
        return _ON_PAGE
    label = "range"
    return [replace(column, label=label) if column.key == "F_ior_arcsec" else column for column in _ON_PAGE]


def _verdict(sweep: SweepResult, gearing: Gearing | None) -> str:
    """Return F'_ior of a direction as text, or its lower bound if the recording does not determine F'_ior."""
    if sweep.is_bound:
        return f"F'_ior at least {sweep.interval_arcsec[0]:.2f}″ (lower bound)"
    travel = f" over {gearing.travel_deg:.4g}° of travel" if gearing and gearing.travel else ""
    return f"F'_ior {sweep.F_ior_arcsec:.2f}″{travel}"


def _slope_facts(result: Measurement) -> list[Fact]:
    """Return a list of one fact, the steepest slope of the error; the list is empty if no slope is known."""
    slope = result.slope_arcsec_per_deg
    if not slope:
        return []
    return [("slope", slope_words(*slope, None, is_least=result.directions[0].is_scale_bound))]


def measure_report(
    result: Measurement,
    drive: Drive | None,
    options: Sequence[str] = (),
    speed: float | None = None,
) -> Report:
    """Return the report of a recording: F'_ior with its uncertainty for each direction.

    result: measurement.
    drive: drive of the recording, None if it is unknown.
    options: options with which the file was read, to be repeated in the next command.
    speed: output speed [arcsec/s] that converts the slope to a rate; None if it is not given.
    """
    first_sweep, *further_sweeps = result.directions
    trace = result.trace
    gearing = result.gearing
    return Report(
        command="measure",
        drive=drive,
        head=f"{trace.file}, {len(trace.line)} rows" + (f", {drive.name}" if drive else ""),
        verdict=_verdict(first_sweep, gearing),
        why=(*_lower_bound(result, first_sweep), *_full_cycle_words(result, first_sweep)),
        blocks=(
            Table.by_row("", _columns(first_sweep), result.directions),
            *([_shaft_table(first_sweep)] if first_sweep.shafts else []),
            Facts.of(_facts(result, drive, options, speed)),
            _curve(first_sweep),
        ),
        details=(
            Table.by_column("full mesh cycle", _CYCLE, [gearing] if gearing else []),
            Table.by_column("all numbers", _SWEEP_QUANTITIES, result.directions),
            *(block for sweep in result.directions for block in _details(sweep)),
            *map(_curve, further_sweeps),
            Facts.of(_slope_facts(result)),
        ),
        values=_measurement_object(result, speed),
        csv=_csv(result),
        line=_line(first_sweep),
        about=trace.file,
        warnings=result.warnings,
    )


def _measurement_object(result: Measurement, speed: float | None) -> Json:
    """Return a measurement as JSON; speed: output speed [arcsec/s] that converts the slope to a rate, or None."""
    trace = result.trace
    return {
        "file": {"name": trace.file, "sha256": trace.sha256, "rows": len(trace.line)},
        "notes": list(result.notes),
        "cycle": result.gearing and as_object(_CYCLE, result.gearing),
        "F_ior_arcsec": result.F_ior_arcsec,
        "directions": [_sweep(sweep) for sweep in result.directions],
        "reversal_error": result.reversal and asdict(result.reversal),
        "encoder_lag": result.lag and asdict(result.lag),
        "torque": result.torque and asdict(result.torque),
        **_slope_object(result, speed),
        "seed": result.seed,
    }


def _lower_bound(result: Measurement, found: SweepResult) -> Iterator[str]:
    """Yield the reasons why F'_ior is a lower bound; none if the recording covers the full mesh cycle."""
    # without a ratio, the length of the cycle is unknown
    if found.coverage is None or result.gearing is None:
        yield (
            f"The recording covers {found.bins.span:.2f} input revolutions; without --drive or --ratio, the full mesh "
            "cycle is unknown."
        )
        return
    covered = f"The recording covers {100 * found.coverage.share:.1f} %"
    if found.is_scale_bound:
        yield "The declination is unknown; state it with --declination DEG."
    elif found.is_bound and result.gearing.travel:
        yield f"{covered} of the travel of {result.gearing.travel_deg:.4g}°."
        # in separate sweeps, slow terms cannot be distinguished from differences between the levels of the sweeps
        if found.coverage.share >= FULL_SHARE:
            yield "The travel was recorded in several sweeps; record it in one sweep."
    elif found.is_bound:
        cycle = result.gearing.cycle
        output = result.gearing.cycle_output
        outputs = f" ({output} output revolutions)" if output > 1 else ""
        yield f"{covered} of the full mesh cycle of {cycle} input revolutions{outputs}."
        if found.coverage.share >= FULL_SHARE:
            yield "Slow terms were removed, because only readings over a whole output revolution determine them."
        # the recording is long enough, so rows are missing within it
        elif found.bins.span >= FULL_SHARE * cycle:
            gap = 360 * GAP_PERIODS / float(found.fit.orders[-1])
            yield f"Readings are missing: gaps of more than {gap:.3g}° between readings count as not covered."


def _full_cycle_words(result: Measurement, direction: SweepResult) -> Iterator[str]:
    """Yield the predicted F'_ior over the full mesh cycle, and the part of the cycle to record next.

    Yield nothing for a whole cycle, or if no model extends the recorded part.
    """
    cycle = direction.by_model
    # for a whole cycle, the table already shows the interval
    if cycle is None or result.gearing is None or not direction.is_bound:
        return
    low, high = cycle.interval_arcsec
    yield f"Predicted F'_ior over the full mesh cycle: {low:.1f} to {high:.1f}″ (95 % interval)."
    if cycle.record_next_rev:
        first, last = (360 * turns / result.gearing.ratio for turns in cycle.record_next_rev)
        yield f"To narrow this interval, record output angles from {first:.0f} to {last:.0f}° next."


def _directions_facts(result: Measurement) -> Iterator[Fact]:
    """Yield a statement on the intervals of both directions if one model describes both."""
    if len(result.directions) < 2:
        return
    from hdassist.features.measuring.full_cycle import is_joint  # imported here because scipy.linalg takes time

    if is_joint(result):
        yield "model", "one model of both directions gives a separate interval for each direction"


def _facts(
    result: Measurement,
    drive: Drive | None,
    options: Sequence[str],
    speed: float | None,
) -> Iterator[Fact]:
    """Yield the largest orders, further results, notes on the file and the next command, each as a label and a text."""
    first_sweep = result.directions[0]
    file = result.trace.file
    yield "orders", _orders_words(first_sweep)
    yield "images", _image_words(first_sweep)
    yield "slow", _slow(first_sweep)
    if speed and (slope := result.slope_arcsec_per_deg):
        yield "slope", slope_words(*slope, speed, is_least=first_sweep.is_scale_bound)
    yield from _line_facts(first_sweep)
    yield from _directions_facts(result)
    if reversal := result.reversal:
        yield "reversal", _reversal_words(reversal)
    if torque := result.torque:
        yield "torque", _torque(torque)
        yield "at torques", _at_torques(first_sweep)
    if lag := result.lag:
        reach = COVERAGE_FACTOR * lag.uncertainty_ms
        yield (
            "lag",
            (
                f"the output is read {lag.ms:.3g} ± {reach:.2g} ms (k = {COVERAGE_FACTOR:g}) after the input. "
                "Speed-dependent friction may contribute to this lag. The lag has been removed"
            ),
        )
    missing = [source.name for source in first_sweep.sources if source.arcsec is None]
    yield "not in u", f"{', '.join(missing)} (--budget NAME=U)" if missing else ""
    yield "read as", "; ".join(result.notes)
    # standard input cannot be read again by a further command
    if file != STDIN:
        yield "next", _next_command(result, drive, options)


def _orders_words(found: SweepResult) -> str:
    """Return the largest orders of a direction as text, each with its amplitudes with and without sidebands.

    The amplitude without sidebands is omitted if it is unknown.
    """
    largest = sorted(found.orders_of_cam, key=lambda order: -order.amplitude_arcsec)[:_NAMED_ORDERS]
    # amplitudes over whole output revolutions may be much larger; if none is known, a single note replaces the others
    of_recording = all(order.is_of_record for order in largest)
    named = []
    for order in largest:
        spread = f" ± {COVERAGE_FACTOR * order.uncertainty_arcsec:.2f}" if not order.is_of_record else ""
        place = " in this recording" if order.is_of_record and not of_recording else ""
        # only whole output revolutions determine the amplitude without sidebands
        alone = None if order.is_of_record else found.order_alone(order.per_cam_rev)
        without = f" ({alone.amplitude_arcsec:.2f}″)" if alone else ""
        named.append(f"order {order.per_cam_rev:g}: {order.amplitude_arcsec:.2f}{spread}″{place}{without}")
    if of_recording:
        return f"{', '.join(named)}; amplitudes in this recording, sidebands included"
    brackets = " (without)" if any("(" in text for text in named) else ""
    return f"{', '.join(named)}; amplitudes with{brackets} sidebands, k = {COVERAGE_FACTOR:g}"


def _image_words(found: SweepResult) -> str:
    """Return the orders of a direction that may be higher ones with the same readings, as text; empty if none."""
    if not found.orders_of_cam:
        return ""
    largest = max(order.amplitude_arcsec for order in found.orders_of_cam)
    images = {
        order.per_cam_rev: likely_image(found.fit, order.per_cam_rev)
        for order in found.orders_of_cam
        if order.amplitude_arcsec >= _NAMED_IMAGE * largest
    }
    named = [f"order {order:g} may be order {image}" for order, image in images.items() if image]
    if not named:
        return ""
    return (
        f"{', '.join(named)}, which gives the same readings. More than {2 * ALWAYS_ORDER} readings per revolution, "
        "or uneven angles, distinguish the two"
    )


def _line_facts(found: SweepResult) -> Iterator[Fact]:
    """Yield the spectral lines between the orders, and the stated shafts without a component, as labelled texts."""
    if found.lines:
        lines = ", ".join(_line_words(line, found) for line in found.lines)
        rise = f". In another cycle they may add up to {found.range.rise:.2f}″ to F'_ior" if found.range.rise else ""
        yield "lines", f"between the orders, per input revolution: {lines}{rise}"
    yield "shafts", _shaft_words(found)


def _line_words(line: MeasuredOrder, found: SweepResult) -> str:
    """Return the order and amplitude of a spectral line as text, with the names of the stated shafts that cause it."""
    shafts = [component.shaft for component in found.shafts if component.is_line(line.per_cam_rev)]
    return f"{line.per_cam_rev:.3f} ({', '.join([f'{line.amplitude_arcsec:.2f}″', *shafts])})"


def _shaft_table(found: SweepResult) -> Table:
    """Return the table of the components of the stated shafts, without the column of reasons for missing components."""
    title = "components of stated shafts: amplitude·cos(order·angle + phase)"
    return Table.by_row(title, [column for column in _SHAFTS if column.key != "missing"], found.shafts)


def _shaft_words(found: SweepResult) -> str:
    """Return the stated shafts whose component is missing, with the reasons, as text; empty if none is missing."""
    missing = [component for component in found.shafts if component.missing]
    return "; ".join(f"{component.shaft}: {component.missing}" for component in missing)


def _next_command(
    result: Measurement,
    drive: Drive | None,
    options: Sequence[str],
) -> str:
    """Return the next command after a recording.

    If the recording covers a part of the cycle, the command compares it with the prediction. If it covers the full
    cycle of a drive, the command finds the hole of the fixed wheel. For a joint with a travel, or without a preset, the
    command computes a correction.
    """
    file = result.trace.file
    gearing = result.gearing
    # a recording of a part of the cycle can be compared, but gives no correction
    if not gearing or result.directions[0].is_bound:
        return again("compare", drive, file, *options)
    travel = ["--travel", f"{gearing.travel_deg:.6g}"] if gearing.travel else []
    # mount reads the recording as the value measured in hole 0
    if drive or result.trace.angle_of == "output":  # a recording of the output angle needs a preset for a correction
        command, record = ("compensate", [file, *travel]) if travel else ("mount", [f"h0={file}"])
        return again(command, drive, *record, *options)
    ratio = ["--ratio", f"{gearing.ratio:.10g}"]
    return command_line(["hdassist", "compensate", file, *ratio, *travel, "--torque", "TORQUE", *options])


def _reversal_words(reversal: Reversal) -> str:
    """Return the lost motion between both directions of a recording as text, with a note on any included lag."""
    reach = COVERAGE_FACTOR * reversal.lost_motion_standard_uncertainty_arcsec
    text = (
        f"lost motion {reversal.lost_motion_arcsec:.2f} ± {reach:.2f}″ (k = {COVERAGE_FACTOR:g}) at reversal "
        "(backlash, friction, hysteresis)"
    )
    # friction and lag cannot be distinguished at a single speed
    if reversal.by == "one speed":
        size = f"{reversal.arcsec_per_ms:.3g}″ per ms; " if reversal.arcsec_per_ms else ""
        text += f", including any encoder lag ({size}record at two speeds to remove it)"
    departure = f"up to {reversal.greatest_departure_arcsec:.2f}″ from the mean"
    return f"{text}. Difference between the directions: mean {reversal.mean_arcsec:.2f}″, {departure}"


def _slope_object(result: Measurement, speed: float | None) -> Json:
    """Return the largest slope with its standard uncertainty, and the rate, as JSON.

    speed: output speed [arcsec/s] that converts the slope to a rate; None if it is not given.
    """
    slope, uncertainty = result.slope_arcsec_per_deg or (None, None)
    rate = None if slope is None or speed is None else slope * speed / 3600
    return {
        "slope_arcsec_per_deg": slope,
        "slope_standard_uncertainty_arcsec_per_deg": uncertainty,
        "rate_arcsec_per_s": rate,
    }


def _torque(torque: RecordedTorque) -> str:
    """Return the torque of a recording as text, with the removed wind-up and the stiffness by which it was computed."""
    text = f"mean {torque.mean_Nm:.4g} N·m, {torque.least_Nm:.4g} to {torque.greatest_Nm:.4g} N·m"
    if not torque.by:
        return text
    size = f"{torque.wind_up_arcsec:.3g} ± {COVERAGE_FACTOR * torque.uncertainty_arcsec:.2g}″"
    by = "K_1 to K_3 of the preset's catalogue"
    if fitted := torque.stiffness_Nm_rad:
        by = f"the stiffness in the recording, {fitted[0]:.3g} ± {COVERAGE_FACTOR * fitted[1]:.2g} N·m/rad"
    where = "the mean torque" if fitted else "the recorded torque"
    return f"{text}; wind-up of {size} removed with {by} (± k = {COVERAGE_FACTOR:g}). F'_ior refers to {where}"


def _at_torques(found: SweepResult) -> str:
    """Return F'_ior at each torque as text; empty if the recording does not show how the orders change with torque."""
    if not found.torques:
        return ""
    texts = (
        f"{t.F_ior_arcsec:.2f} ± {COVERAGE_FACTOR * t.standard_uncertainty_arcsec:.2f}″ at {t.M_g_Nm:.4g} N·m"
        for t in found.torques
    )
    miss = found.torque_miss_arcsec
    error = NO_VALUE if miss is None else f"at most {miss:.2g}″"
    return f"{', '.join(texts)} (± k = {COVERAGE_FACTOR:g}); interpolated linearly between these torques, error {error}"


def _slow(found: SweepResult) -> str:
    """Return the size and the possible cause of the slow terms, and F'_ior without these terms, as text.

    The text is empty if the slow terms are small.
    """
    # small terms appear in the details only
    if found.slow_arcsec < _NAMED_SLOW * found.range.value:
        return ""
    slow = [order for order in found.orders if order.per_cam_rev < SLOWEST_ORDER]
    size = f"{found.slow_arcsec:.2f}″"
    # a part of an output revolution does not determine the cause of slow terms, so they were removed
    if found.is_part:
        return (
            f"slow terms of {size} removed, because part of a revolution does not distinguish drive, drift and test rig"
        )
    largest = max(slow, key=lambda order: order.amplitude_arcsec)
    low, high = found.cam.interval
    cause = f" ({largest.cause})" if largest.cause else ""
    terms = f"slow terms of {size}, mainly {largest.per_cam_rev:.3g} per input revolution{cause}"
    return f"{terms}. F'_ior without slow terms: {low:.2f} to {high:.2f}″"


def _curve(found: SweepResult) -> Curve:
    """Return the curve of the error in the first sweep of a direction; the removed terms are not part of the curve."""
    first = found.bins.sweep == 0
    title = f"kinematic error, ″, {DIRECTION_NAMES[found.direction]} input angle"
    turns = found.bins.turns[first]
    return curve_of_turns(turns, found.fit.error[first], title)


def _details(found: SweepResult) -> Iterator[ReportSection]:
    """Yield the section with the orders and the uncertainty budget of a direction."""
    shown = _ORDER_COLUMNS[:5] if any(order.cause for order in found.orders) else _ORDER_COLUMNS[:4]
    greatest = sorted(found.orders, key=lambda o: -o.amplitude_arcsec)[:_LISTED_ORDERS]
    title = f"orders: amplitude·cos(order·angle + phase), the {len(greatest)} largest of {len(found.orders)}"
    orders = Table.by_row(title, shown, sorted(greatest, key=lambda o: o.per_cam_rev))
    stated = all(source.arcsec is not None for source in found.budget if source.name in STATED)
    together = UncertaintySource(
        "combined", found.uncertainty_arcsec, "" if stated else f"without the sources marked {NO_VALUE}"
    )
    title = f"standard uncertainty of F'_ior (95 % intervals: k = {COVERAGE_FACTOR:g})"
    budget = Table.by_row(title, _BUDGET, [*found.budget, together])
    title = "orders of the input, each with its sidebands"
    together_with_beats = Table.by_row(title, (*_ORDER_COLUMNS[:3], *shown[4:]), found.orders_of_cam)
    yield ReportSection(f"{DIRECTION_NAMES[found.direction]} input angle", (together_with_beats, orders, budget))


def _sweep(found: SweepResult) -> Json:
    """Return the results of one direction as JSON, with the full cycle or the reason why it is missing."""
    cycle = found.full_cycle
    return {
        **as_object(_SWEEP_QUANTITIES, found),
        **{name: as_objects(_ORDER_COLUMNS, getattr(found, name)) for name in ("orders", "orders_of_cam", "lines")},
        "shafts": as_objects(_SHAFTS, found.shafts),
        "budget": as_objects(_BUDGET, found.budget),
        "torques": [asdict(torque) for torque in found.torques],
        "torque_miss_arcsec": found.torque_miss_arcsec,
        "full_cycle": asdict(cycle) if isinstance(cycle, FullCycle) else None,
        "full_cycle_missing": cycle if isinstance(cycle, str) else None,
    }


def _line(found: SweepResult) -> str:
    """Return F'_ior with its 95 % interval as text; for a lower bound, only the lower end of the interval."""
    if found.is_bound:
        return f">= {found.interval_arcsec[0]:.2f}″"
    low, high = found.interval_arcsec
    # the half-widths are compared after rounding, because equal printed values need one sign ± only
    upper_reach = f"{high - found.F_ior_arcsec:.2f}"
    lower_reach = f"{found.F_ior_arcsec - low:.2f}"
    spread = f"± {lower_reach}" if upper_reach == lower_reach else f"+{upper_reach} -{lower_reach}"
    return f"{found.F_ior_arcsec:.2f} {spread}″"


def _csv(result: Measurement) -> CsvTable:
    """Return the CSV table with one row per angle step and direction.

    Each row contains the error after the removal of level and drift, and the fitted error.
    """
    rows: list[list[Any]] = []
    for of_direction in result.directions:
        error = of_direction.fit.error
        columns = np.column_stack(
            [of_direction.bins.sweep, 360 * of_direction.bins.turns, error, error - of_direction.fit.residual]
        )
        rows += [[result.trace.file, of_direction.direction, int(sweep), *step] for sweep, *step in columns.tolist()]
    return ["file", "direction", "sweep", "cam_deg", "error_arcsec", "fitted_arcsec"], rows


def repeats(results: Sequence[Measurement]) -> tuple[Json, list[str]]:
    """Return the mean and standard deviation of F'_ior over repeat runs, as JSON and as a list of one line.

    Both are empty for a single file.
    """
    values = [result.F_ior_arcsec for result in results]
    if len(values) < 2:
        return {}, []
    mean = float(np.mean(values))
    spread = float(np.std(values, ddof=1))
    repeatability = {"files": len(values), "mean_arcsec": mean, "standard_deviation_arcsec": spread}
    line = f"{len(values)} files: mean F'_ior {mean:.2f}″, standard deviation {spread:.2f}″"
    return {"repeat_runs": repeatability}, [line]


def joint_lines(reports: Sequence[Report], results: Sequence[Measurement]) -> list[str]:
    """Return the lines of a text table with F'_ior of each joint of a log."""
    measured = iter(results)
    rows = [("joint", "F'_ior, ″", "95 % interval, ″", "covered, %")]
    for report in reports:
        if "joint" not in report.values:
            continue
        first_sweep = next(measured).directions[0]
        share = f"{100 * first_sweep.coverage.share:.1f}" if first_sweep.coverage else NO_VALUE
        value = f"{first_sweep.F_ior_arcsec:.2f}"
        if first_sweep.is_bound:
            value = f"at least {first_sweep.interval_arcsec[0]:.2f}"
        rows.append((str(report.values["joint"]), value, _ends_text(first_sweep.interval_arcsec), share))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


_CHECKS = {check.field: check for check in CHECKS}


def _interval(quantity: StatedQuantity) -> list[float] | None:
    return None if quantity.interval_arcsec is None else list(quantity.interval_arcsec)


_QUANTITIES = quantity_table("bench.stated", interval=_interval, **FORMATS)
_STATED_COLUMNS = quantity_table(
    "bench.page", words=lambda found: _CHECKS[found.name].words, interval=_interval, **FORMATS
)
_PLACES = quantity_table("bench.places")
_ISO230_COLUMNS = quantity_table("bench.iso230")
_SEEN_RANGE = quantity_table(
    "bench.seen",
    median=lambda found: found.estimates_arcsec[1] if found.seen else None,
    at_most=lambda found: found.estimates_arcsec[2] if found.seen else None,
    seen=lambda found: list(found.seen),
)


@dataclass(frozen=True)
class _BenchResults:
    """Results of approached positions or of torque loops."""

    quantities: Sequence[StatedQuantity]
    places: tuple[PlaceLoop, ...] = ()  # torque loops at each output angle; empty for approached positions
    positions: SeenRange | None = None  # range of F'_ior; None for loops, or if approached positions do not give one
    iso230: PositioningTest | None = None  # figures of ISO 230-2; None for loops, or if positions do not give them

    @classmethod
    def of(
        cls,
        record: PositionRecord | LoopRecord,
        drive: Drive | None,
        seed: int,
    ) -> _BenchResults:
        """Return the results of a record.

        record: approached positions or torque loops.
        drive: tested drive, whose rated torque is used; None if it is unknown.
        seed: seed of the simulated approaches.
        """
        if isinstance(record, PositionRecord):
            quantities = position_quantities(record, seed=seed)
            positions = seen_range(record, quantities)
            return cls(
                quantities=quantities,
                positions=positions,
                iso230=positioning_test(record),
            )
        places = place_loops(record, _rated_torque(record, drive))
        return cls(quantities=loop_quantities(places), places=places)

    @property
    def with_uncertainty(self) -> list[StatedQuantity]:
        """The quantities whose uncertainty is known."""
        return [quantity for quantity in self.quantities if quantity.uncertainty_arcsec is not None]

    @property
    def has_reversal_verdict(self) -> bool:
        """Whether the main result is the reversal value of ISO 230-2, because F'_ior has no range."""
        return self.positions is None and self.iso230 is not None and bool(self.iso230.figure("B"))

    @property
    def verdict(self) -> str:
        """The main result, at the head of the page."""
        if self.has_reversal_verdict and self.iso230:
            return _reversal_verdict(self.iso230)
        first = self.quantities[0]
        return f"{_CHECKS[first.name].words} {first.arcsec:.2f}″"

    @property
    def line(self) -> str:
        """The result of -q in one line: all quantities, each with its expanded uncertainty if it is known."""
        lines = [self.verdict] if self.has_reversal_verdict else []
        for quantity in self.quantities:
            is_known = quantity.uncertainty_arcsec is not None
            expanded = f" ± {quantity.expanded_arcsec:.2f}" if is_known else ""
            lines.append(f"{quantity.name} {quantity.arcsec:.2f}{expanded}″")
        return ", ".join(lines)


def _bench_object(
    record: PositionRecord | LoopRecord,
    results: _BenchResults,
    seed: int,
) -> Json:
    """Return the results of approached positions or of torque loops, by the keys of the JSON result."""
    table = record.table
    return {
        "file": {"name": table.file, "sha256": table.sha256, "rows": len(table.lines)},
        "notes": list(table.notes),
        "quantities": as_objects(_QUANTITIES, results.quantities),
        "F_ior": results.positions and as_object(_SEEN_RANGE, results.positions),
        "iso230_2": results.iso230 and _iso230_object(results.iso230),
        "places": as_objects(_PLACES, results.places),
        "seed": seed,
    }


def bench_report(
    record: PositionRecord | LoopRecord,
    drive: Drive | None,
    seed: int,
    options: Sequence[str] = (),
) -> Report:
    """Return the report of the quantities from approached positions or from torque loops.

    Args:
        record: approached positions or torque loops.
        drive: tested drive, whose rated torque is used; None if it is unknown.
        seed: seed of the simulated approaches.
        options: options with which the file was read, to be repeated in the next command.
    """
    table = record.table
    results = _BenchResults.of(record, drive, seed)
    positions = results.positions
    iso230 = results.iso230
    quantities = results.quantities
    facts = [
        ("F'_ior", _seen_words(positions) if positions else ""),
        ("read as", "; ".join(table.notes)),
        ("next", _accept_command(table.file, drive, results.with_uncertainty, positions, options)),
    ]
    places = [Table.by_row("places", _PLACES, results.places)] if len(results.places) > 1 else []
    once = "each position was approached only once, so the uncertainty is unknown and scatter widens the range"
    has_unknown_uncertainty = len(results.with_uncertainty) < len(quantities)
    return Report(
        command="measure",
        drive=drive,
        head=f"{table.file}, {len(table.lines)} rows" + (f", {drive.name}" if drive else ""),
        verdict=results.verdict,
        blocks=(
            Table.by_row("", _STATED_COLUMNS, quantities),
            *([_iso230_table(iso230)] if iso230 else []),
            *places,
            Facts.of(facts),
        ),
        details=(Lines("definitions", tuple(f"{_CHECKS[q.name].words}: {_CHECKS[q.name].tests}" for q in quantities)),),
        values=_bench_object(record, results, seed),
        line=results.line,
        about=table.file,
        warnings=(once,) if has_unknown_uncertainty else (),
    )


def _rated_torque(record: LoopRecord, drive: Drive | None) -> float:
    """Return the rated torque [N*m] of the drive, or the largest torque of the loops, and add a note to the record."""
    rated = drive.operation.rated if drive else None
    basis = "from the preset"
    # loops usually reach the rated torque
    if rated is None:
        hint = f"{drive.name} has no operation.rated" if drive else "state another with --drive PRESET"
        rated = float(abs(record.torque_Nm).max())
        basis = f"the largest torque of the loop; {hint}"
    record.table.notes.append(f"rated torque {rated:g} N·m: {basis}")
    return rated


def _accept_command(
    file: str,
    drive: Drive | None,
    quantities: Sequence[StatedQuantity],
    positions: SeenRange | None,
    options: Sequence[str],
) -> str:
    """Return the command that accepts a drive by its measured quantities.

    The text is empty if there are no quantities, or if the record came from standard input.

    Args:
        file: file of the record.
        drive: tested drive, None if it is unknown.
        quantities: quantities with a known uncertainty.
        positions: range of F'_ior from approached positions, None if there is none.
        options: options with which the file was read.
    """
    # accept reads the quantities from the file, so no values are passed on
    if positions and positions.M_g and file != STDIN:
        budget = ["--budget", "encoder=U,coupling=U,reseating=U,temperature=U"]
        arguments = ["--measured", f"{positions.M_g:.15g}={file}", "--measured-only", *options, *budget]
    else:
        arguments = []
        for quantity in quantities:
            value = f"{quantity.name}={quantity.arcsec:.3g}±{quantity.expanded_arcsec:.2g}"
            arguments += ["--value", value]
    for quantity in quantities:
        if drive is None or getattr(drive.acceptance, quantity.name) is None:
            arguments += ["--limit", f"{quantity.name}=LIMIT"]
    return again("accept", drive, *arguments) if arguments and file != STDIN else ""


def _reversal_verdict(test: PositioningTest) -> str:
    """Return the mean reversal value as text, with its expanded uncertainty if the scatter is known."""
    reversal = test.figure("B_mean")
    value = reversal.arcsec if reversal else 0.0
    if test.reversal_uncertainty_arcsec is None:
        return f"reversal value {value:.2f}″, forward minus backward"
    reach = COVERAGE_FACTOR * test.reversal_uncertainty_arcsec
    return f"reversal value {value:.2f} ± {reach:.2f}″ (k = {COVERAGE_FACTOR:g}), forward minus backward"


def _iso230_table(test: PositioningTest) -> Table:
    """Return the table of the figures defined in ISO 230-2; the title states the number of approaches."""
    required = "" if test.is_complete else f" (the standard requires {FEWEST_APPROACHES})"
    noun = "approach" if test.approaches == 1 else "approaches"
    number = f"{test.approaches} {noun} from each side{required}"
    return Table.by_row(f"quantities of ISO 230-2 from {number}; + forward, - backward", _ISO230_COLUMNS, test.figures)


def _iso230_object(test: PositioningTest) -> Json:
    """Return the figures defined in ISO 230-2 as JSON."""
    return {
        "positions": test.positions,
        "approaches": test.approaches,
        "reversal_standard_uncertainty_arcsec": test.reversal_uncertainty_arcsec,
        "figures": as_objects(_ISO230_COLUMNS, test.figures),
    }


def _seen_words(found: SeenRange) -> str:
    least = f"at least {found.at_least_arcsec:.2f}″ from these positions"
    if found.uncertainty_arcsec is None and not found.expanded_arcsec:
        return f"unknown: scatter may be part of the {found.arcsec:.2f}″; approach each position at least twice"
    # the captured shares of the plan are valid only if all planned positions were measured
    if found.is_cut:
        return f"{least}; planned positions or sides are missing, so the shares of the plan do not apply"
    if not found.seen:
        return f"{least}; hdassist plan computes the share of F'_ior that these positions capture"
    _, middle, high = found.estimates_arcsec
    share = f"{100 * found.seen[0]:.0f} to {100 * found.seen[2]:.0f} %"
    return f"{least}, which capture {share} of F'_ior: median {middle:.1f}″, up to {high:.1f}″ in 95 of 100 drives"


_ENTRY_COLUMNS = quantity_table(
    "archive.entries",
    F_ior=lambda entry: f"≥ {entry.low_arcsec:.2f}" if entry.F_ior_is_lower_bound else f"{entry.F_ior_arcsec:.2f}",
    interval=lambda entry: _ends_text((entry.low_arcsec, entry.high_arcsec)),
    **FORMATS,
)


def history_report(
    serial: str,
    archive: str,
    entries: Sequence[ArchiveEntry],
) -> Report:
    """Return the report on the history of a drive, which compares changes of F'_ior with their uncertainty.

    serial: serial number of the drive.
    archive: name of the archive.
    entries: entries of the drive in the archive.
    """
    histories_of_drives = histories(entries)
    verdict = "no change beyond its uncertainty" if histories_of_drives else "nothing to compare"
    verdict = (
        "changed by more than its uncertainty"
        if any(history.is_changed for history in histories_of_drives)
        else verdict
    )
    objects = [as_json(entry) for entry in entries]
    return Report(
        command="measure-history",
        drive=None,
        head=f"{serial} in {archive}, measured {len(entries)} times",
        verdict=verdict,
        why=tuple(map(_sentence, histories_of_drives)),
        blocks=(
            Table.by_row("F'_ior in ″, torque in N·m", _ENTRY_COLUMNS, entries),
            Facts.of(_history_facts(entries)),
            *(
                _history_curve(history)
                for history in sorted(histories_of_drives, key=lambda each: -len(each.entries))[:1]
            ),
        ),
        values={
            "serial": serial,
            "archive": archive,
            "verdict": verdict,
            "entries": objects,
            "histories": histories_of_drives,
        },
        csv=(
            [*objects[0]],
            [[*(columns | {"unstated": " ".join(columns["unstated"])}).values()] for columns in objects],
        ),
        line=verdict,
    )


def _sentence(found: DriveHistory) -> str:
    """Return a sentence with the range of F'_ior in a history and the probability of such a spread without a change."""
    values = [entry.F_ior_arcsec for entry in found.entries]
    first, *_ = found.entries
    hole, torque = (quantity.text(first) for quantity in _ENTRY_COLUMNS[1:3])
    where = f"hole {hole}, {torque} N·m, {DIRECTION_NAMES[first.direction]} input angle"
    spread = f"probability of such a spread without a change: {100 * found.probability:.2g} %"
    return f"{where}: {min(values):.2f} to {max(values):.2f}″; {spread}"


def _history_facts(entries: Sequence[ArchiveEntry]) -> Iterator[Fact]:
    """Yield the number of omitted entries, and the sources missing in the uncertainty, each as a label and a text."""
    parts = sum(entry.F_ior_is_lower_bound for entry in entries)
    results = "1 result that is" if parts == 1 else f"{parts} results that are"
    yield "left out", f"{results} only a lower bound, from part of the cycle" if parts else ""
    missing = dict.fromkeys(name for entry in entries for name in entry.unstated)
    yield "not in u", f"{', '.join(missing)}; these sources may cause a change (--budget NAME=U)" if missing else ""


def _history_curve(found: DriveHistory) -> Curve:
    """Return the curve of F'_ior, with its intervals, over the days since the first measurement."""
    first, *_ = dates = [date.fromisoformat(entry.date) for entry in found.entries]
    days = np.array([(day - first).days for day in dates], dtype=float)
    ends = [(day, entry.low_arcsec, entry.high_arcsec) for day, entry in zip(days, found.entries, strict=True)]
    y = np.array([entry.F_ior_arcsec for entry in found.entries])
    label = "F'_ior, ″"
    return Curve(
        x=days,
        y=y,
        x_label=f"days since {first}",
        y_label=label,
        whiskers=tuple(ends),
        points=True,
        rows=6,
    )
