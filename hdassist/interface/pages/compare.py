"""Reports of the comparison of a recording with its prediction, and of drives with each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from operator import attrgetter
from string import ascii_uppercase

import numpy as np

from hdassist.belief.statistics import Probability
from hdassist.drive.model.deviations import unknown_names, unknown_notes, unknowns
from hdassist.drive.model.geometry import Kinematics
from hdassist.drive.preset.fields import UNKNOWN as NOT_KNOWN
from hdassist.drive.preset.fields import ResolvedField, value_text
from hdassist.features.preset_comparison import DriveChanges, DrivesComparison, DriveSheet, ErrorChange
from hdassist.features.record_comparison.compare import (
    UNIDENTIFIABLE_ANGLE,
    Comparison,
    Explanation,
    VectorChange,
    equally_good,
)
from hdassist.features.record_comparison.record import ERROR_SIGNS, SENSES, Alignment, OrderAmplitude
from hdassist.features.report import (
    NO_VALUE,
    CsvTable,
    Curve,
    Fact,
    Facts,
    Json,
    Quantity,
    Report,
    Table,
    as_object,
    csv_columns,
    quantity_table,
    to_error_digit,
)
from hdassist.interface.pages.card import hole_place
from hdassist.interface.pages.check import check_report, influence_at, median_words, percentile_error, range_words
from hdassist.interface.pages.curves import stiffness_warnings
from hdassist.interface.pages.mount import mount_warnings
from hdassist.interface.terminal.output import report_object
from hdassist.interface.terminal.words import again, named, not_known, on_what
from hdassist.run.errors import SURE
from hdassist.run.files import STDIN

_PLOTTED_ROWS = 4
_PLOTTED_TURNS = 1.0  # number of input revolutions plotted before and after the largest difference
_TABLED_ORDERS = 12  # number of orders in the table, chosen by amplitude
_SHORT_PAGE = 5  # number of compared quantities on a short page
_VERDICT_WORDS = {
    "agrees": "agrees; the preset needs no change",
    "mirrored": "mirrored; the recording agrees clearly better with the opposite sign or direction",
    "one": "explained by one deviation",
    "several": "explained by several deviations together",
    "unexplained": "unexplained",
}

_COMPARED_NUMBERS = quantity_table(
    "compare.numbers",
    predicted_range=lambda result: float(np.ptp(result.predicted_curve)),
    largest_deg=lambda result: 360 * result.largest[1],
    residual_rms=lambda result: float(np.std(result.residual_arcsec)),
    residual_range=lambda result: float(np.ptp(result.residual_arcsec)),
    is_full_cycle=lambda result: not result.sweep.is_bound,
)


def _plus_minus(
    value: float | None,
    uncertainty: float | None,
    digits: int = 1,
) -> str:
    """Return a value with its standard uncertainty (k = 1) as text; a dash replaces an unknown value."""
    # a value may be known without an uncertainty
    spread = "" if uncertainty is None else f" ± {uncertainty:.{digits}f}"
    return NO_VALUE if value is None else f"{value:z.{digits}f}{spread}"


def _amplitude(found: OrderAmplitude) -> str:
    return _plus_minus(found.amplitude_arcsec, found.uncertainty_arcsec, 2)


_COMPARED_ORDERS = quantity_table("compare.orders", amplitude=_amplitude)
_FILE: Quantity[Comparison] = Quantity("file", value="measurement.trace.file")


def _residuals_csv(result: Comparison) -> CsvTable:
    """Return the CSV table of the measured error, the predicted error and their difference, one row per bin."""
    bins = result.sweep.bins
    return csv_columns(
        file=[result.measurement.trace.file for _ in bins.turns],
        sweep=bins.sweep,
        cam_deg=360 * bins.turns,
        measured_arcsec=result.predicted_arcsec + result.residual_arcsec,
        predicted_arcsec=result.predicted_arcsec,
        residual_arcsec=result.residual_arcsec,
    )


def comparison_report(result: Comparison) -> Report:
    """Return the report on the comparison of a recording with its prediction."""
    trace = result.measurement.trace
    measured, *other_numbers = _COMPARED_NUMBERS[:_SHORT_PAGE]
    uncertainty, *numbers = [replace(quantity, unit="") for quantity in other_numbers]  # all share the unit of measured
    return Report(
        command="compare",
        drive=result.drive,
        head=f"{trace.file} compared with {result.drive.name} at {result.M_g:g} N·m",
        verdict=_VERDICT_WORDS[result.conclusion.kind],
        why=(_why(result),),
        blocks=(
            Table.by_row("", [measured, replace(uncertainty, label="u"), *numbers], [result]),
            Facts.of(_facts(result)),
            _curves(result),
        ),
        details=(
            Table.by_column("", (_FILE, *_COMPARED_NUMBERS), [result]),
            *_tables(result),
            Facts.of(_starts(result)),
        ),
        certificate=result.certificate,
        values=_values(result),
        csv=_residuals_csv(result),
        line=" ".join([result.conclusion.kind, *_options(result)]),
        warnings=(
            *result.drive.origin.warnings,
            *unknown_notes(result.drive),
            *(f"{trace.file}: {text}" for text in result.warnings),
        ),
    )


def _conventions(alignment: Alignment) -> Json:
    """Return the sign of the error and the sense of the input angle in a file, by the name of the option."""
    return {"error_is": ERROR_SIGNS[alignment.sign], "cam_sense": SENSES[alignment.sense]}


def _options(result: Comparison) -> list[str]:
    """Return the command-line options that follow from the conclusion.

    They correct the sign or the sense in which the file was read, or they set new values of deviations.
    """
    best = result.conclusion.best
    if result.mirror:
        # options that already have the right value are omitted
        changed = _conventions(result.mirror.asked).items() - _conventions(result.asked).items()
        return [word for key, value in sorted(changed) for word in (f"--{key.replace('_', '-')}", value)]
    # the best fit is not recommended if it does not explain the recording
    sets = best.overrides if best and result.conclusion.kind != "unexplained" else ()
    return [word for text in sets for word in ("--set", text)]


def _angles(result: Comparison) -> Iterator[tuple[str, float, float | None]]:
    """Yield the start and the zero of a recording, each as a name, an angle and an uncertainty.

    The angle lies between -180 and 180 deg. The standard uncertainty [deg] is None if the angle is given.
    """
    alignment = result.unchanged.alignment
    start = "phi_g0" if Kinematics.of(result.drive).fixed == "rigid" else "phi_b0"
    angles = alignment.start_deg, alignment.zero_deg
    for name, angle, u in zip((start, "cam_zero"), angles, result.uncertainties_deg, strict=True):
        # between -180 and 180 deg, an angle slightly below 0 is not printed as almost 360 deg
        yield name, (angle + 180) % 360 - 180, u


def _why(result: Comparison) -> str:
    """Return a sentence that gives the reason for the conclusion."""
    best = result.conclusion.best
    kind = result.conclusion.kind
    # single teeth may cause the difference only if the roughness of the teeth is unknown
    if kind == "agrees":
        rough = any(field.path in ("harmonics.xi_g6", "harmonics.xi_b6") for field in unknowns(result.drive))
        single_teeth = ", deviations of single teeth" if rough else ""
        return f"Noise{single_teeth} and small errors of the stiffnesses explain the difference."
    if mirror := result.mirror:
        rms_arcsec = result.difference_rms_arcsec
        return (
            f"The difference is {rms_arcsec:.2f}″ rms, and {mirror.rms_arcsec:.2f}″ rms with "
            f"{' '.join(_options(result))}."
        )
    if best is None:
        return "No deviation explains the difference."
    explained = best.explained_share
    share = "a clear part of the difference" if explained is None else f"{100 * explained:.1f} % of the difference"
    if kind == "several":
        deviations = f"{len(best.deviations)} deviations together explain {share}, and no single deviation does."
        return f"{deviations} The residual is consistent with noise."
    fitted = named(best.deviations[0])
    # size and direction are omitted if the recording does not determine them
    if best.changes:
        size, direction = _size_and_direction(best.changes[0])
        fitted += f", {size} um"
        if direction != NO_VALUE:
            fitted += f" at {direction}°"
    if kind == "unexplained":
        return f"The best single deviation, {fitted}, explains {share}. The residual exceeds the noise."
    return f"{fitted}, explains {share}. The residual is consistent with noise."


def _facts(result: Comparison) -> Iterator[Fact]:
    """Yield fitted angles, other explanations, residual orders and the next command, each as a label and a text."""
    best = result.conclusion.best
    joint = result.joint
    yield from (row for row in _starts(result) if not row[1].endswith("given"))
    if best and result.conclusion.kind == "one":
        equal_deviations = [fit.deviations[0] for fit in equally_good(best, result.singles)]
        equally_good_words = ""
        if equal_deviations:
            equally_good_words = f"{', '.join(equal_deviations)}; the recording does not distinguish these deviations"
        yield "or", equally_good_words
    if joint and joint.not_told_apart:
        yield (
            "together",
            (f"the recording does not distinguish between {'; '.join(map(' and '.join, joint.not_told_apart))}"),
        )
    if explanation := joint if joint and joint.orders_left else best:
        order_texts = [
            f"order {p.per_cam_rev:.2f}: {p.difference.amplitude_arcsec:.2f}″" for p in explanation.orders_left
        ]
        yield "residual", "; ".join(order_texts)
    cycle = Kinematics.of(result.drive).cycle_cam_revolutions
    turns = result.sweep.bins.span
    advice = f"the full mesh cycle of {cycle} input revolutions; the recording covers {turns:.2f}"
    yield "measure", advice if result.sweep.is_bound else ""
    yield "assumed", on_what(result.drive)
    yield "unknown", not_known(result.drive)
    file = result.measurement.trace.file
    command, *files = ("compare", "-" if file == STDIN else file) if result.mirror else ("mount",)
    yield "next", again(command, result.drive, *files, *_options(result))


def _starts(result: Comparison) -> Iterator[Fact]:
    """Yield the start and the zero of the recording, each as a name and a text."""
    for name, angle, u in _angles(result):
        origin = "given" if u is None else f"fitted, u = {u:.1f}°"
        is_known = u is None or u < UNIDENTIFIABLE_ANGLE
        yield name, f"{angle:.4g}°, {origin}" if is_known else "not determined by the recording"


def _curves(result: Comparison) -> Curve:
    """Return the plot of the measured and the predicted error around their largest difference."""
    bins = result.sweep.bins
    worst = result.largest[1]
    sweep = bins.sweep == bins.sweep[abs(bins.turns - worst).argmin()]
    shown = sweep & (abs(bins.turns - worst) <= _PLOTTED_TURNS)
    predicted = result.predicted_arcsec[shown]
    return Curve(
        bins.turns[shown],
        predicted + result.residual_arcsec[shown],
        x_label="input angle around the largest difference, revolutions",
        y_label="kinematic error, ″",
        second=predicted,
        names=("measured", "predicted"),
        rows=_PLOTTED_ROWS,
    )


def _tables(result: Comparison) -> Iterator[Table]:
    """Yield the table of the largest orders and, if deviations were fitted, the table of the fits."""
    by_size = sorted(result.orders, key=lambda p: -max(p.measured.amplitude_arcsec, p.predicted.amplitude_arcsec))
    shown = sorted(by_size[:_TABLED_ORDERS], key=lambda pair: pair.per_cam_rev)
    title = (
        f"amplitude·cos(order·angle + phase), ″ and deg: the {_TABLED_ORDERS} largest of {len(result.orders)} orders"
    )
    yield Table.by_row(title, _COMPARED_ORDERS, shown)
    if result.singles:
        title = (
            "deviations fitted one at a time, the best first, and all together; ±: k = 1; residual: chi-square per "
            "degree of freedom"
        )
        columns = ("deviation", "size, um", "direction, °", "explains", "residual", "F'_ior, ″")
        fits = [result.unchanged, *sorted(result.singles, key=lambda single: single.chi_square)]
        yield Table(
            title,
            columns,
            tuple(row for explanation in (*fits, result.joint) if explanation for row in _rows(explanation)),
        )


def _size_and_direction(change: VectorChange | None) -> tuple[str, str]:
    """Return the table cells of size [um] and direction [deg] of a change; dashes if there is no change."""
    if change is None:
        return NO_VALUE, NO_VALUE
    size = _plus_minus(change.size_um, change.size_uncertainty_um)
    return size, _plus_minus(change.direction_deg, change.direction_uncertainty_deg)


def _rows(found: Explanation) -> Iterator[tuple[str, ...]]:
    """Yield the table rows of a fit, one for each deviation.

    Unless the fit has exactly one deviation, a row for the whole fit comes first.
    """
    chi_square = f"{found.chi_square / found.degrees_of_freedom:.2f}"
    F_ior = _plus_minus(found.F_ior_arcsec, None, 2)
    share = NO_VALUE if found.explained_share is None else f"{100 * max(found.explained_share, 0):.1f} %"
    numbers: tuple[str, ...] = (share, chi_square, F_ior)
    if len(found.deviations) != 1:
        yield "all together" if found.deviations else "none (the preset)", "", "", *numbers
        numbers = ("", "", "")
    changes = {change.size: change for change in found.changes if found.clear}
    for path in found.deviations:
        yield path.split(".")[1], *_size_and_direction(changes.get(path)), *numbers


def _values(result: Comparison) -> Json:
    trace = result.measurement.trace
    best = result.conclusion.best
    mirror = result.mirror
    place = _conventions(result.unchanged.alignment if trace.sense else result.asked)
    for name, angle, u in _angles(result):
        place |= {f"{name}_deg": angle, f"{name}_uncertainty_deg": u, f"{name}_fitted": u is not None}
    return {
        "file": {"name": trace.file, "sha256": trace.sha256, "rows": len(trace.line)},
        "notes": list(result.measurement.notes),
        "M_g_Nm": result.M_g,
        "place": place,
        **as_object(_COMPARED_NUMBERS, result),
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


_NAMED_PATHS = 6  # largest number of fields named in a line
_NO_ERROR = 1e-9  # arcsec; smallest F'_ior of A in a ratio, which avoids division by zero
_LARGEST_SHARE = 100.0  # largest difference shown as a multiple of F'_ior of A; if it is larger, A has almost no error
_DRIVE_HEADS = ("", "torque", "as assembled", "best hole", "change from A", "P(better)")


def drives_report(result: DrivesComparison, seed: int) -> Report:
    """Return the report on the comparison of drives with the first drive; seed: seed of the samples."""
    names = ", ".join(f"{letter} {sheet.drive.origin.file}" for letter, sheet in _lettered(result).items())
    verdict = _verdict(result)
    probability = _probability_words(result)
    differing = ((f"{row[0].path}, {row[0].unit}".removesuffix(", "), *map(_cell, row)) for row in result.differing)
    return Report(
        command="compare-presets",
        drive=result.sheets[0].drive,
        head=names,
        verdict=verdict,
        why=(probability,) if probability else (),
        blocks=(
            Table(
                "F'_ior, ″: median (5 to 95 %); change from A: of the medians, as assembled; P: probability",
                (*_DRIVE_HEADS, *_limit_heads(result)),
                tuple(_drive_rows(result)),
            ),
            Facts.of(_drives_facts(result)),
        ),
        details=(
            *_changes(result),
            Table("fields that differ", ("", *_lettered(result)), tuple(differing)),
        ),
        certificate=result.certificate,
        cross_checks=tuple(cross for sheet in result.sheets for cross in sheet.cross_checks),
        values=_drives_values(result, seed),
        line="; ".join(filter(None, (verdict, probability))),
        about=", ".join(sheet.drive.name for sheet in result.sheets),
    )


def comparison_warnings(result: DrivesComparison) -> tuple[str, ...]:
    """Return the warnings about all drives, each only once."""
    return tuple(
        dict.fromkeys(f"{sheet.drive.name}: {text}" for sheet in result.sheets for text in sheet_warnings(sheet))
    )


def sheet_warnings(sheet: DriveSheet) -> tuple[str, ...]:
    """Return the warnings from check, mounting and stiffness of a drive, each only once."""
    stiff = stiffness_warnings(sheet.drive, sheet.stiffness)
    return tuple(dict.fromkeys((*sheet.check.warnings, *mount_warnings(sheet.advice), *stiff)))


def _lettered(result: DrivesComparison) -> dict[str, DriveSheet]:
    """Return the sheet of each drive by the letter of the drive: A, B, and so on."""
    return {ascii_uppercase[k] if k < 26 else f"#{k + 1}": sheet for k, sheet in enumerate(result.sheets)}


def _drive_rows(result: DrivesComparison) -> Iterator[tuple[str, ...]]:
    """Yield the cells of the table row of each drive, torque by torque."""
    for k in range(len(result.torques)):
        for (letter, sheet), changes in zip(_lettered(result).items(), (None, *result.changes), strict=True):
            odds = changes.probability_better[k] if changes else None
            change = _change(result, sheet, changes, k) if changes else NO_VALUE
            better = NO_VALUE if odds is None else f"{100 * odds.value:.0f} %"
            best = sheet.advice.chosen
            point = sheet.check.points[k]
            ends = range_words(point, "-")
            spread = f" ({ends})" if ends else ""
            where = hole_place(best) if sheet.advice.names_hole else "any hole"
            built = f"{median_words(point, 1)}{spread}"
            mounted = f"{to_error_digit(best.F_ior_arcsec[k], percentile_error(50, point), 1)}, {where}"
            row = (letter, f"{point.M_g:g} N·m", built, mounted, change, better)
            yield (*row, *_met_cells(sheet, k)) if _limit_heads(result) else row


def _limit_heads(result: DrivesComparison) -> tuple[str, ...]:
    """Return the column heads for the probabilities of meeting a limit; empty if no drive has a limit."""
    places = range(len(result.torques))
    has_limit = any(sheet.probabilities_met(place) is not None for sheet in result.sheets for place in places)
    return ("P(met), %", "P(met), best hole, %") if has_limit else ()


def _met_cells(sheet: DriveSheet, torque: int) -> tuple[str, str]:
    """Return the cells for the probability of meeting the limit, as assembled and in the best hole [%].

    torque: index of the torque.
    """
    probabilities = sheet.probabilities_met(torque)
    if probabilities is None:
        return NO_VALUE, NO_VALUE
    as_assembled, in_best_hole = probabilities
    return _probability_cell(as_assembled), _probability_cell(in_best_hole)


def _probability_cell(probability: Probability) -> str:
    """Return the table cell of a probability [%] with its interval."""
    return probability.text().replace(" %", "").replace(" to ", "-")


def _most_by(result: DrivesComparison, changes: DriveChanges) -> str:
    """Return as text, for each torque, the differing field that changes F'_ior most if it is changed alone.

    The text is empty if no field can be changed alone.
    """
    differing = {row[0].path for row in result.differing}
    single = [change for change in changes.single if change.field in differing]
    greatest = (max(single, key=lambda c: abs(c.change_arcsec[k])) for k in range(len(result.torques)))
    places = zip(greatest, _loads(result), strict=True) if single else ()
    return "; ".join(f"{named(change.field or '')} at {load}" for change, load in places)


def _change(
    result: DrivesComparison,
    sheet: DriveSheet,
    changes: DriveChanges,
    k: int,
) -> str:
    """Return the change of the median of F'_ior from A in per cent, or in words; k: index of the torque."""
    sense = changes.F_ior_is[k]
    before = result.sheets[0].check.points[k].F_ior_or_error
    share = sheet.check.points[k].F_ior_or_error / max(before, _NO_ERROR) - 1
    if sense == NOT_KNOWN and changes.probability_better[k] is None:
        return "open"
    return sense if sense == "the same" else "larger" if share > _LARGEST_SHARE else f"{100 * share:+.0f} %"


def _loads(result: DrivesComparison) -> list[str]:
    """Return the torques at which the drives are compared, or their shares of the rated torque, as texts."""
    if shares := result.rated_shares:
        return [f"{100 * share:.3g} % of the rated torque" for share in shares]
    return [f"{M_g:g} N·m" for M_g in result.torques]


def _verdict(result: DrivesComparison) -> str:
    """Return the recommended drive, and the change of each drive from A at each torque."""
    letters = [*_lettered(result)]
    verdicts = []
    has_torques = len(result.torques) > 1
    loads = [f" at {load}" if has_torques else "" for load in _loads(result)]
    for letter, sheet, changes in zip(letters[1:], result.sheets[1:], result.changes, strict=True):
        sentences = (_change(result, sheet, changes, k) + load for k, load in enumerate(loads))
        verdicts.append(f"{letter} {', '.join(sentences)}")
    choice = f"{result.word.lower()} {letters[result.best]}"
    if result.word == "ANY":
        reason = "all are equal" if result.all_alike else "the difference is not significant"
        choice = f"any drive, because {reason}"
    return f"{choice}: F'_ior of {'; '.join(verdicts)}"


def _probability_words(result: DrivesComparison) -> str:
    """Return a text with the probability that the best drive is better than A, or that A is the best drive."""
    odds = result.probability_best
    is_sampled = any(sheet.check.samples for sheet in result.sheets)
    if odds is None or not is_sampled or result.all_alike:
        return ""
    event = (
        f"{[*_lettered(result)][result.best]} is better than A" if result.best else "no other drive is better than A"
    )
    return f"Probability that {event}, as assembled: {odds.text()}"


def _changes(result: DrivesComparison) -> Iterator[Table]:
    """Yield a table for each drive except A: the change of F'_ior if each differing field is changed alone."""
    torques = [f"{M_g:g} N·m" for M_g in result.torques]  # torques of drive A
    for letter, changes in zip([*_lettered(result)][1:], result.changes, strict=True):
        title = f"change of F'_ior if a single field is changed from A to {letter}, ″"
        rows = [
            (change.field or "all together", *_change_cells(change)) for change in (*changes.single, changes.together)
        ]
        notes = []
        if changes.pairs > 1:
            notes.append(f"median (5 to 95 %) over {changes.pairs} pairs of sampled drives")
        paths = _some(changes.not_alone)
        if paths:
            notes.append(
                f"not changed alone, because most drives would then be impossible or have more unknown inputs: {paths}"
            )
        yield Table(
            title,
            ("", *torques),
            tuple(rows),
            notes=tuple(notes),
        )


def _cell(field: ResolvedField) -> str:
    """Return the table cell of a field: its value with the origin and, if it is assumed, the range."""
    bounds = f" {' to '.join(map(value_text, field.range))}" if field.range and field.kind == "assumed" else ""
    return NOT_KNOWN if field.kind == NOT_KNOWN else f"{value_text(field.value)} ({field.kind}{bounds})"


def _change_cells(change: ErrorChange) -> Iterator[str]:
    """Yield the cell of a change at each torque: median, 5th and 95th percentile over sampled pairs of drives."""
    for median, low, high in zip(change.change_arcsec, change.p5_arcsec, change.p95_arcsec, strict=True):
        yield f"{median:+.2f}" + (f" ({low:+.2f} to {high:+.2f})" if low < high else "")


def _drives_facts(result: DrivesComparison) -> Iterator[Fact]:
    """Yield unknown inputs, contributions, differences and the next command, each as a label and a text."""
    for letter, sheet in _lettered(result).items():
        yield f"{letter} unknown", unknown_names(sheet.check.unknown)
        yield f"{letter} contributions", influence_at(sheet.check)
    for letter, changes in zip([*_lettered(result)][1:], result.changes, strict=True):
        yield f"{letter} main cause", _most_by(result, changes)
    if result.rated_shares:
        yield (
            "torques",
            (f"the presets have no torque in common; each drive is computed at {' and '.join(_loads(result))}"),
        )
    yield "differs", _some([row[0].path for row in result.differing])
    cells = [
        (change.F_ior_is[k], change.probability_better[k], f" at {M_g:g} N·m" if len(result.torques) > 1 else "")
        for change in result.changes
        for k, M_g in enumerate(result.torques)
    ]
    if open_ := [(odds, load_words) for sense, odds, load_words in cells if sense == NOT_KNOWN]:
        likelier = [
            (max(odds, odds.complement, key=attrgetter("value")), load_words) for odds, load_words in open_ if odds
        ]
        least, load_words = min(
            likelier,
            key=lambda each: each[0].low,
            default=(None, ""),
        )
        sure = f"; probability of the likelier sign: {least.text(SURE, outcome='a decision')}" if least else ""
        yield "open", f"unknown inputs may reverse the sign of the change{load_words}{sure}"
    yield "next", again("report", result.sheets[result.best].drive, "-o", "report.html")


def _some(paths: Sequence[str]) -> str:
    """Return the first paths of a list as text, followed by the number of omitted paths."""
    unnamed = f" and {len(paths) - _NAMED_PATHS} more" if len(paths) > _NAMED_PATHS else ""
    return ", ".join(dict.fromkeys(paths[:_NAMED_PATHS])) + unnamed


def _drives_values(result: DrivesComparison, seed: int) -> Json:
    odds = result.probability_best
    return {
        "warnings": list(comparison_warnings(result)),
        "presets": [_drive_object(sheet, seed) for sheet in result.sheets],
        "M_g_Nm": list(result.torques),
        "share_of_rated": result.rated_shares,
        "best": {"word": result.word, "preset": result.best, "probability_better": odds and odds.value},
        "differences": [
            {
                "field": row[0].path,
                "unit": row[0].unit,
                "values": [
                    {"value": cell.value, "origin": cell.kind, "reference": cell.ref, "range": cell.range}
                    for cell in row
                ],
            }
            for row in result.differing
        ],
        "changes": [
            {"from": 0, "to": k, **asdict(changes)}
            | {"probability_better": [odds and odds.value for odds in changes.probability_better]}
            for k, changes in enumerate(result.changes, 1)
        ],
        "seed": seed,
    }


def _drive_object(sheet: DriveSheet, seed: int) -> Json:
    """Return the part of the JSON results of `check` and `mount` that a comparison of drives needs."""
    check = report_object(check_report(sheet.check, seed))
    best = sheet.advice.chosen
    is_one = sheet.advice.names_hole
    probabilities = [sheet.probabilities_met(k) for k in range(len(best.F_ior_arcsec))]
    in_best_hole = [of_torque and of_torque[1] for of_torque in probabilities]
    ordered = {
        "hole": best.hole if is_one else None,
        "rotation_deg": best.rotation_deg if is_one else None,
        "F_ior_arcsec": list(best.F_ior_arcsec),
        "probability": [probability and probability.value for probability in in_best_hole],
        "probability_low": [probability and probability.low for probability in in_best_hole],
        "probability_high": [probability and probability.high for probability in in_best_hole],
    }
    return {
        **check["preset"],
        "file": sheet.drive.origin.file,
        **{key: check[key] for key in ("operating_points", "unknown", "influence")},
        "word": sheet.advice.word,
        "order": sheet.advice.order,
        "best": ordered,
    }
