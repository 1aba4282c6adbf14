"""A comparison of a measured trace with a drive as a report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, replace

import numpy as np

from hdassist.comparing.compare import UNIDENTIFIABLE_ANGLE, Comparison
from hdassist.comparing.explanations import Explanation, VectorChange, equally_good
from hdassist.comparing.record import ERROR_SIGNS, SENSES, Alignment, OrderAmplitude, OrderPair
from hdassist.json_parts import Json
from hdassist.model.kinematics import Kinematics
from hdassist.model.unknown import unknown_notes
from hdassist.report import NO_VALUE, Curve, Facts, Quantity, Report, Table, as_object, csv_columns
from hdassist.terminal.words import again, named, not_known, on_what
from hdassist.textfile import STDIN

_PLOTTED_ROWS = 6
PLOTTED_TURNS = 1.0  # of the cam, to either side of the largest difference
TABLED_ORDERS = 12  # the greatest
SHORT_PAGE = 5  # numbers on a short page
_VERDICT_WORDS = {
    "agrees": "agrees, no change of the preset is needed",
    "mirrored": "mirrored, the file fits clearly better read the other way round",
    "one": "explained by one deviation",
    "several": "explained by several deviations together",
    "unexplained": "unexplained",
}

COMPARED_NUMBERS: tuple[Quantity[Comparison], ...] = (
    Quantity("measured.range_arcsec", "measured range", "″", ".2f", "sweep.range.value"),
    Quantity("measured.standard_uncertainty_arcsec", "  uncertainty u", "″", ".2f", "sweep.uncertainty_arcsec"),
    Quantity("predicted.range_arcsec", "predicted range", "″", ".2f", lambda r: float(np.ptp(r.predicted_curve))),
    Quantity("difference.rms_arcsec", "difference, rms", "″", ".2f", "difference_rms_arcsec"),
    Quantity("difference.largest_arcsec", "  largest", "″", "z.2f", lambda r: r.largest[0]),
    Quantity("difference.largest_at_cam_deg", "  at cam angle", "deg", ".1f", lambda r: 360 * r.largest[1]),
    Quantity("residual.rms_arcsec", "beyond orders, rms", "″", ".2f", lambda r: float(np.std(r.residual_arcsec))),
    Quantity("residual.range_arcsec", "  range", "″", ".2f", lambda r: float(np.ptp(r.residual_arcsec))),
    Quantity("predicted.F_ior_arcsec", "F'_ior, predicted", "″", ".2f", "unchanged.F_ior_arcsec"),
    Quantity("cam_revolutions", "record", "cam turns", ".2f", "sweep.bins.span"),
    Quantity("measured.is_full_cycle", "  is the full cycle", value=lambda r: not r.sweep.is_bound),
    Quantity("chi_square", "chi-square", "", ".1f", "unchanged.chi_square"),
    Quantity("degrees_of_freedom", "  degrees of freedom", value="unchanged.degrees_of_freedom"),
)  # fmt: skip


def _plus_minus(value: float | None, uncertainty: float | None, digits: int = 1) -> str:
    """A value with its standard uncertainty, as far as there are such."""
    spread = "" if uncertainty is None else f" ± {uncertainty:.{digits}f}"
    return NO_VALUE if value is None else f"{value:z.{digits}f}{spread}"


def _amplitude(found: OrderAmplitude) -> str:
    return _plus_minus(found.amplitude_arcsec, found.uncertainty_arcsec, 2)


COMPARED_ORDERS: tuple[Quantity[OrderPair], ...] = (
    Quantity("per_cam_rev", "order", "", ".2f"),
    Quantity("measured", "measured", "", _amplitude),
    Quantity("measured.phase_deg", "phase", "", ".0f"),
    Quantity("predicted", "predicted", "", _amplitude),
    Quantity("predicted.phase_deg", "phase", "", ".0f"),
    Quantity("difference", "difference", "", _amplitude),
    Quantity("cause", "cause"),
)
FILE: Quantity[Comparison] = Quantity("file", value="measurement.trace.file")


def comparison_report(result: Comparison) -> Report:
    """A measured trace over the predicted one."""
    trace, bins = result.measurement.trace, result.sweep.bins
    numbers = [replace(quantity, unit="") for quantity in COMPARED_NUMBERS[:SHORT_PAGE]]
    return Report(
        command="compare",
        drive=result.drive,
        head=f"{trace.file} over {result.drive.name} at {result.M_g:g} N·m",
        verdict=_VERDICT_WORDS[result.conclusion.kind],
        why=(_why(result),),
        blocks=(Table.by_row("", numbers, [result], words=()), Facts.of(_facts(result)), _curves(result)),
        details=(Table.by_column("", (FILE, *COMPARED_NUMBERS), [result]), *_tables(result), Facts.of(_starts(result))),
        certificate=result.certificate,
        values=_values(result),
        csv=csv_columns(
            file=[trace.file] * len(bins),
            sweep=bins.sweep,
            cam_deg=360 * bins.turns,
            measured_arcsec=result.predicted_arcsec + result.residual_arcsec,
            predicted_arcsec=result.predicted_arcsec,
            residual_arcsec=result.residual_arcsec,
        ),
        line=" ".join([result.conclusion.kind, *_options(result)]),
        warnings=(
            *result.drive.origin.warnings,
            *unknown_notes(result.drive),
            *(f"{trace.file}: {text}" for text in result.warnings),
        ),
    )


def _conventions(alignment: Alignment) -> Json:
    """How error and cam angle of a file count, by the names of the options without dashes."""
    return {"error_is": ERROR_SIGNS[alignment.sign], "cam_sense": SENSES[alignment.sense]}


def _options(result: Comparison) -> list[str]:
    """Options that follow from the conclusion: how else to read the file, or the new values of deviations."""
    best = result.conclusion.best
    if result.mirror:
        changed = _conventions(result.mirror.asked).items() - _conventions(result.asked).items()
        return [word for key, value in sorted(changed) for word in (f"--{key.replace('_', '-')}", value)]
    sets = best.overrides if best and result.conclusion.kind != "unexplained" else ()
    return [word for text in sets for word in ("--set", text)]


def _angles(result: Comparison) -> Iterator[tuple[str, float, float | None]]:
    """Start and zero of a record: name, angle from -180 to 180 deg, standard uncertainty [deg], None where given."""
    alignment = result.unchanged.alignment
    start = "phi_g0" if Kinematics.of(result.drive).fixed == "rigid" else "phi_b0"
    angles = alignment.start_deg, alignment.zero_deg
    for name, angle, u in zip((start, "cam_zero"), angles, result.uncertainties_deg, strict=True):
        yield name, (angle + 180) % 360 - 180, u


def _why(result: Comparison) -> str:
    """The grounds of the conclusion, in a sentence."""
    best, kind = result.conclusion.best, result.conclusion.kind
    if kind == "agrees":
        return "noise and stiffnesses that are a little off explain the difference"
    if mirror := result.mirror:
        now = result.difference_rms_arcsec
        return f"difference {now:.2f}″ rms, {mirror.rms_arcsec:.2f} with {' '.join(_options(result))}"
    if best is None:
        return "no deviation explains the difference"
    explained = best.explained_share
    share = "a clear part of the difference" if explained is None else f"{100 * explained:.1f} % of the difference"
    if kind == "several":
        return f"{len(best.deviations)} deviations explain {share}, no single one does; no more than noise is left"
    fitted = named(best.deviations[0])
    if best.changes:
        size, direction = _size_and_direction(best.changes[0])
        fitted += f", {size} um" + f" at {direction}°" * (direction != NO_VALUE)
    if kind == "unexplained":
        return f"{fitted}, the best single one, explains {share}; the rest is clear of noise"
    return f"{fitted}: {share}; no more than noise is left"


def _facts(result: Comparison) -> Iterator[tuple[str, str]]:
    """Where the record begins, other explanations, the residual and the next command, a label and a text each."""
    best, joint = result.conclusion.best, result.joint
    yield from (row for row in _starts(result) if not row[1].endswith("given"))
    if best and result.conclusion.kind == "one":
        others = [other.deviations[0] for other in equally_good(best, result.singles)]
        yield "or", f"{', '.join(others)} alone: the record does not decide between them" if others else ""
    if joint and joint.not_told_apart:
        yield "together", f"the record cannot tell apart: {'; '.join(map(', '.join, joint.not_told_apart))}"
    if rest := joint if joint and joint.orders_left else best:
        left = [f"order {p.per_cam_rev:.2f}: {p.difference.amplitude_arcsec:.2f}″" for p in rest.orders_left]
        yield "left", "; ".join(left)
    cycle, turns = Kinematics.of(result.drive).cycle_cam_revolutions, result.sweep.bins.span
    yield "measure", f"the full cycle, {cycle} cam turns: the record has {turns:.2f}" if result.sweep.is_bound else ""
    yield "assumed", on_what(result.drive)
    yield "unknown", not_known(result.drive)
    file = result.measurement.trace.file
    command, *files = ("compare", "-" if file == STDIN else file) if result.mirror else ("mount",)
    yield "next", again(command, result.drive, *files, *_options(result))


def _starts(result: Comparison) -> Iterator[tuple[str, str]]:
    """Angles where the record begins, a name and a text each."""
    for name, angle, u in _angles(result):
        sure = "given" if u is None else f"fitted, u = {u:.1f}"
        is_known = u is None or u < UNIDENTIFIABLE_ANGLE
        yield name, f"{angle:.4g}°, {sure}" if is_known else "the record does not determine it"


def _curves(result: Comparison) -> Curve:
    """Both curves around the largest difference."""
    bins, worst = result.sweep.bins, result.largest[1]
    sweep = bins.sweep == bins.sweep[abs(bins.turns - worst).argmin()]
    shown = sweep & (abs(bins.turns - worst) <= PLOTTED_TURNS)
    predicted = result.predicted_arcsec[shown]
    return Curve(
        bins.turns[shown], predicted + result.residual_arcsec[shown],
        x_label="cam angle, turns: around the largest difference", y_label="error, ″",
        second=predicted, names=("measured", "predicted"), rows=_PLOTTED_ROWS,
    )  # fmt: skip


def _tables(result: Comparison) -> Iterator[Table]:
    """The greatest orders, and all fits."""
    by_size = sorted(result.orders, key=lambda p: -max(p.measured.amplitude_arcsec, p.predicted.amplitude_arcsec))
    shown = sorted(by_size[:TABLED_ORDERS], key=lambda pair: pair.per_cam_rev)
    title = f"amplitude·cos(order·angle + phase), ″ and deg: the {TABLED_ORDERS} greatest of {len(result.orders)}"
    yield Table.by_row(title, COMPARED_ORDERS, shown, words=(0, 6))
    if result.singles:
        title = (
            "deviations fitted alone, the best first, and together; ±: standard; left: chi-square per degree of freedom"
        )
        columns = ("deviation", "size, um", "direction, °", "explains", "left", "F'_ior, ″")
        fits = [result.unchanged, *sorted(result.singles, key=lambda single: single.chi_square)]
        yield Table(title, columns, tuple(row for found in (*fits, result.joint) if found for row in _rows(found)))


def _size_and_direction(change: VectorChange | None) -> tuple[str, str]:
    """Cells of size [um] and direction [deg]; dashes without a change."""
    if change is None:
        return NO_VALUE, NO_VALUE
    size = _plus_minus(change.size_um, change.size_uncertainty_um)
    return size, _plus_minus(change.direction_deg, change.direction_uncertainty_deg)


def _rows(found: Explanation) -> Iterator[tuple[str, ...]]:
    """Rows of a fit: a line of its own where it has not just one deviation, and each of its deviations."""
    left, F_ior = f"{found.chi_square / found.degrees_of_freedom:.2f}", _plus_minus(found.F_ior_arcsec, None, 2)
    share = NO_VALUE if found.explained_share is None else f"{100 * max(found.explained_share, 0):.1f} %"
    numbers: tuple[str, ...] = (share, left, F_ior)
    if len(found.deviations) != 1:
        yield "all together" if found.deviations else "none: as the preset", "", "", *numbers
        numbers = ("", "", "")
    changes = {change.size: change for change in found.changes if found.clear}
    for path in found.deviations:
        yield path.split(".")[1], *_size_and_direction(changes.get(path)), *numbers


def _values(result: Comparison) -> Json:
    trace, best, mirror = result.measurement.trace, result.conclusion.best, result.mirror
    place = _conventions(result.unchanged.alignment)
    for name, angle, u in _angles(result):
        place |= {f"{name}_deg": angle, f"{name}_uncertainty_deg": u, f"{name}_fitted": u is not None}
    return {
        "file": {"name": trace.file, "sha256": trace.sha256, "rows": len(trace.line)},
        "notes": list(result.measurement.notes),
        "M_g_Nm": result.M_g,
        "place": place,
        **as_object(COMPARED_NUMBERS, result),
        "orders": [asdict(pair) for pair in result.orders],
        "finding": {
            "kind": result.conclusion.kind,
            "deviations": best.deviations if best else (),
            "overrides": best.overrides if best else (),
            "F_ior_arcsec": best and best.F_ior_arcsec,
        },
        "mirrored": mirror and {"option": " ".join(_options(result)), "difference_rms_arcsec": mirror.rms_arcsec},
        "singles": [asdict(single) for single in result.singles],
        "joint": result.joint and asdict(result.joint),
        "seed": result.measurement.seed,
    }
