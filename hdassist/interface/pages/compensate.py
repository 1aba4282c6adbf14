"""Reports of corrections of the kinematic error that a controller stores."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from hdassist.drive.error.waves import POINTS_A_TURN
from hdassist.drive.model.deviations import unknown_notes, unknowns
from hdassist.drive.model.geometry import Array
from hdassist.features.correction.correct import (
    HALVED,
    IN_PLACE,
    TURN_LOST,
    Correction,
    DirectionResidual,
    ErrorPart,
    FormResiduals,
    VerifiedCorrection,
    correction_curve,
)
from hdassist.features.correction.forms import ExpectedResidual, correction_columns, form_words, line_orders
from hdassist.features.measuring.measure import DIRECTION_NAMES
from hdassist.features.report import Curve, Fact, Facts, Json, Report, Table, csv_columns, samples_object
from hdassist.interface.terminal.words import ENVELOPE, again
from hdassist.run.errors import Verdict

UNPROVEN = "No correction was tested on a real drive yet. Record the corrected error."
_TOLD_NOISE_CYCLES = 1.5  # smallest number of full cycles in a recording from which its noise can be determined
_PART_WORDS = {  # parts of the error, by their names in JSON
    "with the cam": "repeats every input revolution",
    "beats": "sidebands",
    "once an output turn": "once per output revolution",
    "with load": "changes with load",
    "with direction": "changes with direction",
}
_OTHER_DIRECTION = "other_direction_arcsec"  # column for the torque of the other direction, which has its own rows
_SHORT_FORM = "output turn, 256 points"  # form of correction that many controllers can store


def compensate_report(
    result: Correction,
    *,
    is_written: bool = False,
    warnings: Sequence[str] = (),
) -> Report:
    """Return the report of the residual error with a stored correction, for each form of correction.

    result: correction.
    is_written: whether the correction was written to a file.
    warnings: warnings of a recording without a preset.
    """
    drive = result.drive
    chosen = result.chosen
    refused: tuple[str, ...] = ()
    if chosen.is_refused:
        refused = (f"{form_words(chosen.form.name)}: refused, because {_percent(chosen)} % of the error would remain",)
    names = {_SHORT_FORM, chosen.form.name, result.forms[0].form.name}
    forms = [residual for residual in result.forms if residual.form.name in names]
    return Report(
        command="compensate",
        drive=drive,
        head=f"{result.correction.preset}, correction at {result.M_g:g} N·m",
        verdict=_verdict(result),
        why=tuple(_why(result)),
        blocks=(
            _residual_table(forms, short=True),
            Facts.of(_facts(result, is_written)),
            _before_and_after(result),
        ),
        details=(
            _residual_table(result.forms),
            _lines_table(result),
        ),
        certificate=result.certificate,
        values=_correction_object(result),
        csv=None if refused else csv_columns(**_columns(result)),
        line=_verdict(result),
        about=result.correction.preset,
        warnings=(*warnings, *_notes_of_drive(result), *refused),
        exit_code=5 if refused else 0,
    )


def _notes_of_drive(result: Correction) -> tuple[str, ...]:
    """Return the warnings about the drive of a correction and about the samples; empty if no drive is known."""
    drive = result.drive
    if drive is None:
        return ()
    notes = drive.origin.warnings
    if not (result.samples or result.misfit):
        notes = (*notes, *unknown_notes(drive))
    return (*notes, *result.samples.remarks) if result.samples else (*notes,)


def _correction_object(result: Correction) -> Json:
    """Return a correction and its residuals as JSON; the correction itself is omitted if it is refused."""
    is_refused = result.chosen.is_refused
    return {
        "M_g_Nm": result.M_g,
        "parts": result.parts,
        "directions": result.directions,
        "between_directions": result.between_directions,
        "forms": [_form_object(residual) for residual in result.forms],
        "refused": is_refused,
        "recorded_Nm": list(result.records),
        "misfit": result.misfit,
        "fewest_points": result.fewest_points,
        "phasors": result.phasors,
        "correction": None if is_refused else result.correction,
        "corrections": [] if is_refused else list(result.corrections.values()),
        "samples": samples_object(result.samples),
    }


def verified_report(result: Correction, found: VerifiedCorrection) -> Report:
    """Return the report that compares a recording, made with the correction on, with the predicted residual."""
    promised = found.promised
    low, high = found.interval_arcsec
    measured = f"at least {low:.1f}" if high is None else f"{low:.1f}-{high:.1f}"
    rows: list[tuple[str, ...]] = [("F'_ior", f"{promised.uncorrected_p50:.1f}", _range(promised), measured)]
    parts = zip(
        result.parts,
        found.promised_parts,
        found.parts,
        strict=False,
    )  # the recording has no parts by load and direction
    rows += [(_part_words(before), *map(_range, (before, *further_parts))) for before, *further_parts in parts]
    why = [
        f"Measured residual F'_ior: {found.F_ior_arcsec:.1f}″ ({measured}); predicted: at most {promised.p95:.1f}″ "
        "(95th percentile)."
    ]
    measure = []
    if found.verdict is Verdict.FAIL:
        unknown = (
            "Neither a wrong sign nor a wrong zero nor a lost revolution explains this: check "
            "whether load, hole or drive has changed."
        )
        why.append(f"Probable cause: {found.cause}." if found.cause else unknown)
    elif found.verdict is Verdict.INCONCLUSIVE:
        measure = [("measure", "the full mesh cycle twice or more with the correction on, to determine the noise")]
    return Report(
        command="compensate",
        drive=result.drive,
        head=f"{result.correction.preset}, {form_words(result.chosen.form.name)}, correction on at {result.M_g:g} N·m",
        verdict=str(found.verdict),
        why=tuple(why),
        blocks=(
            Table("", ("error, ″", "uncorrected", "predicted residual", "measured residual"), tuple(rows)),
            Facts.of(measure),
        ),
        certificate=result.certificate,
        values={"M_g_Nm": result.M_g, "form": result.chosen.form.name, "verified": found},
        line=str(found.verdict),
        warnings=result.drive.origin.warnings if result.drive else (),
        exit_code=found.verdict.exit_code,
    )


def _columns(result: Correction) -> dict[str, Array]:
    """Return the columns of the correction by name; for a correction at each load, with the rows of all torques."""
    if not result.chosen.form.each_load:
        return correction_columns(result.correction)
    tables = [correction_columns(correction) for correction in result.corrections.values()]
    joined = {name: np.concatenate([table[name] for table in tables]) for name in tables[0] if name != _OTHER_DIRECTION}
    return {"M_g_Nm": np.repeat([*result.corrections], len(next(iter(tables[0].values())))), **joined}


def _verdict(result: Correction) -> str:
    form = result.chosen.form
    residual = result.chosen.residuals[0]
    if not result.chosen.is_refused:
        noise = ", including noise of the recording" if result.M_g in result.records else ""
        residual_text = f"{_range(residual, ' to ')}″ ({_percent(result.chosen)} % of {residual.uncorrected_p50:.1f}″)"
        return f"residual F'_ior {residual_text} with {form_words(form.name)}{noise}"
    if any(residual.is_refused for residual in result.forms if residual.form == form):
        return f"refused: {form_words(form.name)} may increase the error; {_enough(result)}"
    best = min(result.forms, key=lambda each: each.left[1])
    residual_words = f"with a recording, {form_words(best.form.name)} would leave {_percent(best)} % of the error"
    return f"record the error first: {residual_words}; a correction from the preset alone may increase the error"


def _why(result: Correction) -> Iterator[str]:
    table = next(residual for residual in result.forms if residual.form.turn == "cam")
    table_words = f"a table over one input revolution would leave {_percent(table)} %"
    if table.left[1] <= HALVED:
        yield f"The error repeats every input revolution, as with an oval wheel; {table_words}."
    else:
        *first_lines, last_line = [f"{line:g}" for line in result.strong_lines]
        often = f"{', '.join(first_lines)} and {last_line}" if first_lines else last_line
        yield f"The error repeats mainly {often} times per output revolution; {table_words}."
    yield from _other_loads(result)
    yield UNPROVEN


def _other_loads(result: Correction) -> Iterator[str]:
    """Yield a warning for each torque at which the chosen correction increases the error in the median."""
    for residual in result.chosen.residuals:
        is_elsewhere = residual.case == IN_PLACE and residual.M_g != result.M_g
        if is_elsewhere and residual.p50 > residual.uncorrected_p50:
            statistic = "the median of F'_ior" if result.samples else "F'_ior"
            change = f"{residual.uncorrected_p50:.1f} → {residual.p50:.1f}″"
            yield f"At {residual.M_g:g} N·m this correction increases {statistic}: {change}."


def _part_words(part: ErrorPart) -> str:
    """Return the name of a part of the error on pages."""
    return _PART_WORDS.get(part.name, part.name)


def _facts(result: Correction, is_written: bool) -> Iterator[Fact]:
    parts = "; ".join(f"{_part_words(part)}: {_range(part)}" for part in result.parts)
    yield "parts, ″", parts
    refused = "; ".join(form_words(residual.form.name) for residual in result.forms if residual.is_refused)
    yield "table", _enough(result) + (f"; refused, because they may increase the error: {refused}" if refused else "")
    residuals = ", ".join(f"{n}: {amplitude_arcsec:.2g}″" for n, amplitude_arcsec in result.phasors.items())
    yield "terms", f"residual with {residuals.replace(':', ' terms:', 1)}"
    yield from _record_facts(result)
    yield from _direction_facts(result)
    missing = [f"{M_g:g}" for M_g in result.errors if M_g not in result.corrections]
    if result.chosen.form.each_load and missing:
        yield "stored", f"no correction for {', '.join(missing)} N·m, where it may increase the error"
    if result.misfit or (result.chosen.is_refused and result.M_g not in result.records):
        yield "next", again("compensate", result.drive, "record.csv")
    elif not (is_written or result.records):
        yield "next", again("compensate", result.drive, "--csv", "correction.csv")


def _record_facts(result: Correction) -> Iterator[Fact]:
    recorded = ", ".join(f"{M_g:g}" for M_g in result.records)
    turns = [float(np.ptp(record.cam_turns)) for record in result.records.values()]
    cycle = result.errors[result.M_g].lines.kinematics.cycle_cam_revolutions
    if result.misfit and result.drive:
        turn_counts = ", ".join(f"{count:.3g}" for count in turns)
        recording = f"{turn_counts} of {cycle} input revolutions"
        yield "recording", f"{recording} at {recorded} N·m; the correction uses the angles of the preset"
        stiffnesses = "supports, contacts, deflection and clearance (docs/correct.md)"
        fitted = ", ".join([*(field.path for field in unknowns(result.drive)), stiffnesses])
        yield "fitted", f"{fitted}; misfit {100 * result.misfit:.0f} % of the error"
        yield "measure", "the full mesh cycle, which needs no fit"
    elif ends := result.recorded_deg:
        range_words = (
            f"{ends[0]:z.1f} to {ends[1]:z.1f}° of the output; outside this range the residual is not predicted"
        )
        yield "recording", f"at {recorded} N·m, {range_words}"
    elif recorded and _is_of_part(result):
        recording = f"{turns[0]:.3g} of {cycle} input revolutions at {recorded} N·m"
        yield "recording", f"{recording}; the correction uses the angles of the recording"
        slow = "sidebands and slow terms of the output, which part of the cycle does not determine"
        yield "open", f"{slow}; the residual includes these terms"
        yield "measure", "more of the cycle, which reduces the upper bound of the residual"
    elif recorded:
        yield "recording", f"at {recorded} N·m; the correction uses the angles of the recording"
    if not result.drive and not _is_of_part(result) and turns[0] < _TOLD_NOISE_CYCLES * cycle:
        yield "noise", "one cycle does not distinguish noise from error; the upper bound of the residual includes noise"
        yield "measure", "the full mesh cycle twice or more, so that noise averages out"


def _direction_facts(result: Correction) -> Iterator[Fact]:
    """Yield the residual in each direction of rotation, which one correction for both directions leaves."""
    if not result.between_directions or result.chosen.is_refused:
        return
    residuals = "; ".join(
        f"{DIRECTION_NAMES[residual.direction]} input angle: {_range(residual)}″" for residual in result.directions
    )
    difference = f"the two error curves differ by {_range(result.between_directions)}″"
    yield "directions", f"{residuals}; {difference}, and one correction serves both"
    yield "not corrected", "the lost motion at reversal, which hdassist measure reports"


def _is_of_part(result: Correction) -> bool:
    """Return whether the correction has no preset and comes from a recording of a part of the cycle or of a travel."""
    return result.drive is None and any(record.is_part for record in result.records.values())


def _enough(result: Correction) -> str:
    points = result.fewest_points
    if points:
        return f"{points} points over one output revolution would halve the error"
    return "no table over one output revolution halves the error"


def _percent(each: FormResiduals) -> str:
    return " to ".join(dict.fromkeys(f"{100 * share:.0f}" for share in each.left[::2]))


def _range(each: ErrorPart | ExpectedResidual | DirectionResidual, separator: str = "-") -> str:
    """Return the 5th and 95th percentile [arcsec] as text, or one number if they are equal."""
    return separator.join(dict.fromkeys(f"{end:.1f}" for end in (each.p5, each.p95)))


def _residual_table(forms: Sequence[FormResiduals], *, short: bool = False) -> Table:
    cases = list(range(len(forms[0].residuals)))
    if short:  # the short table has two torques, the larger zero error and the lost revolution
        cases = sorted({*cases[:2], *cases[-2:]} - {cases[-3]})
    heads = [forms[0].residuals[k] for k in cases]
    cases_in_words = tuple(_case_words(residual) for residual in heads)
    none = ("uncorrected", *(f"{residual.uncorrected_p50:.1f}" for residual in heads))
    rows = [(form_words(residual.form.name), *(_range(residual.residuals[k]) for k in cases)) for residual in forms]
    title = f"residual F'_ior, ″; last columns: with a wrong zero or one revolution lost, at {heads[-1].M_g:g} N·m"
    return Table(title, ("correction", *cases_in_words), (none, *rows))


def _case_words(residual: ExpectedResidual) -> str:
    """Return the column head of a residual: its torque, or the fault in applying the correction."""
    if residual.case == IN_PLACE:
        return f"{residual.M_g:g} N·m"
    return "rev. lost" if residual.case == TURN_LOST else residual.case.replace(" deg", "°")


def _lines_table(result: Correction) -> Table:
    """Return the table of the strongest lines of the drive nearest to the median, before and after the correction."""
    lines = result.errors[result.M_g].lines
    before, after = (2 / len(curve) * np.abs(np.fft.rfft(curve)[lines.per_cycle]) for curve in _curves(result))
    often = line_orders(lines)[0]
    strongest = np.argsort(-before)[:12]
    rows = tuple((f"{often[k]:g}", f"{before[k]:.2f}", f"{after[k]:.2f}") for k in strongest)
    heads = ("periods per output revolution", "before, ″", "after, ″")
    return Table("spectral lines of the error of a drive near the median", heads, rows)


def _curves(result: Correction) -> tuple[Any, Any]:
    """Return the error [arcsec] of the drive nearest to the median over the cycle, before and after correction."""
    error = result.errors[result.M_g]
    before = error.actual[np.argsort(error.ranges)[len(error.ranges) // 2]]
    return before, before - correction_curve(result.correction, error.lines.kinematics).reshape(-1)


def _before_and_after(result: Correction) -> Curve:
    before, after = _curves(result)
    turns = np.arange(len(before)) / POINTS_A_TURN
    names = ("before", "after")
    title = f"kinematic error, ″, {ENVELOPE}"
    x_label = "input angle over the full mesh cycle, revolutions"
    return Curve(
        x=turns,
        y=before,
        x_label=x_label,
        y_label=title,
        over=1.0,
        second=after,
        names=names,
        rows=3,
    )


def _form_object(each: FormResiduals) -> dict[str, Any]:
    return {
        "form": each.form.name,
        "left": dict(
            zip(
                ("p5", "p50", "p95"),
                each.left,
                strict=True,
            )
        ),
        "refused": each.is_refused,
        "residuals": each.residuals,
    }
