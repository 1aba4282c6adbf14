"""The design check of a drive as a report, with the options that would meet its limit or reduce F'_ior."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from textwrap import wrap

import numpy as np

from hdassist.belief.evidence import evidence_of, is_error_measured
from hdassist.belief.options import Outcome, Step
from hdassist.belief.prior import DrivePrior
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import shares_below
from hdassist.drive.model.deviations import unknown_names
from hdassist.drive.model.geometry import Kinematics
from hdassist.drive.preset.fields import Drive, field_table
from hdassist.drive.preset.knowledge import SIZE_20, SMALL_ACCURACY, USUAL_ACCURACY
from hdassist.features.design import DesignCheck, OperatingPoint, accuracy_words
from hdassist.features.report import (
    Curve,
    Fact,
    Facts,
    Json,
    Quantity,
    Report,
    Table,
    as_json,
    as_objects,
    attributes,
    csv_table,
    influence_objects,
    pitch_object,
    quantity_table,
    samples_object,
    to_error_digit,
    unknown_objects,
)
from hdassist.interface.terminal.words import (
    ENVELOPE,
    again,
    field_unit,
    heading,
    influence_words,
    samples_words,
    texts,
    thousands,
)
from hdassist.run.errors import Verdict
from hdassist.run.system import command_line

_ANGLES = ("phi_h", "phi_g", "phi_b")
_UNKNOWN_AT_ZERO = "F_ior_shown_arcsec, at_max and at_min are computed with unknown inputs set to 0"


def _angle_deg(
    end: str,
    angle: str,
    point: OperatingPoint,
) -> float | None:
    """Return an angle [deg] of the mesh position with the largest or the smallest error; None without an error.

    end: at_max or at_min.
    angle: name of the angle.
    """
    return (
        None
        if point.error is None
        else float(np.degrees(getattr(point.error.states, angle)[getattr(point.error, end)]))
    )


def percentile_error(percent: int, point: OperatingPoint) -> float | None:
    """Return the Monte Carlo standard error of a percentile of F'_ior [arcsec]."""
    if not (belief := point.belief):
        return None
    return belief.samples.of_ranges.percentile_error(percent / 100, belief.torque)


POINT_QUANTITIES = quantity_table(
    "check.points",
    turns=lambda angle_deg: f"{angle_deg / 360:.2f}",
    **{f"{end}.{angle}": partial(_angle_deg, end, angle) for end in ("at_max", "at_min") for angle in _ANGLES},
)
BELIEF = quantity_table("check.belief")
_MONTE_CARLO = quantity_table("check.monte_carlo", **{f"error_{p}": partial(percentile_error, p) for p in (5, 50, 95)})
_OVER_BELIEF = {"F_ior_arcsec", "F_ior_upper_arcsec", "verdict"}  # quantities over uncertain inputs


def median_words(point: OperatingPoint, most: int = 2) -> str:
    """Return F'_ior [arcsec] at a torque as text; for samples, the median, rounded to the digit of its standard error.

    most: largest number of decimals.
    """
    return to_error_digit(point.F_ior_or_error, percentile_error(50, point), most)


def range_words(point: OperatingPoint, between: str = " to ") -> str | None:
    """Return the 5th and 95th percentile of F'_ior [arcsec] as text, each rounded by its standard error."""
    if not (belief := point.belief):
        return None
    low = to_error_digit(belief.p5, percentile_error(5, point), 1)
    high = to_error_digit(belief.p95, percentile_error(95, point), 1)
    return f"{low}{between}{high}"


_ON_PAGE = quantity_table(
    "check.page",
    median=median_words,
    range=range_words,
    verdict_of_limit=lambda point: point.verdict if point.limit_arcsec is not None else None,
)


def check_report(check: DesignCheck, seed: int) -> Report:
    """Return the report of a design check; seed: seed for choosing the mesh positions that are solved again."""
    governing = check.points[check.governing]
    # with samples, the page shows their distribution; for a single drive, the error curve
    first = _spread_curve(check, check.samples) if check.samples and check.prior else _error_curve(check, governing)
    # without samples, the short page already shows the curve at the governing torque
    other_points = [point for point in check.points if check.samples or point is not governing]
    k = Kinematics.of(check.drive)
    fixed = texts().fixed_wheel(check.drive)
    return Report(
        command="check",
        drive=check.drive,
        head=f"{check.drive.name}, {k.z_g}/{k.z_b} teeth, {fixed} fixed{heading(check.measured)}",
        verdict=str(check.verdict),
        why=tuple(_verdict_reasons(check)) or tuple(_undrawn(check)),
        blocks=(F_ior_table(check), Facts.of(_facts(check)), first),
        details=(
            *steps_tables(check),
            *error_tables(check),
            Facts.of(check_facts(check)),
            *(_error_curve(check, point) for point in other_points),
        ),
        certificate=check.certificate,
        cross_checks=check.cross_checks,
        values=_values(check, seed),
        csv=csv_table(check.drive.name, (*POINT_QUANTITIES, *BELIEF), check.points),
        line=_line(check),
        warnings=check.warnings,
        exit_code=check.verdict.exit_code,
    )


def influence_at(check: DesignCheck) -> str:
    """Return the largest contributions at the governing torque as text; empty if there are none."""
    result = f"F'_ior at {check.points[check.governing].M_g:g} N·m" if check.influences else ""
    return influence_words(check.influences, result)


def F_ior_table(check: DesignCheck) -> Table:
    """Return the table of F'_ior by torque, with its range over the uncertain inputs and its limit, if any."""
    # percentiles need samples
    if not (check.samples and check.prior):
        zeros = ", unknown inputs set to 0" if check.unknown else ""
        return Table.by_row(f"F'_ior (peak-to-peak kinematic error){zeros}, ″", _ON_PAGE, check.points)
    fitted = f" ({len(check.prior.fitted)} others at fitted values)" if check.prior.fitted else ""
    title = f"F'_ior (peak-to-peak kinematic error) over {len(check.prior.fields)} uncertain inputs{fitted}, ″"
    # with samples, F'_ior is a median
    columns = [replace(column, label="median") if column.key == "F_ior_arcsec" else column for column in _ON_PAGE]
    return Table.by_row(title, columns, check.points)


def _verdict_reasons(check: DesignCheck) -> Iterator[str]:
    """Yield the probability of meeting the limit at each torque that has the verdict of the check.

    If the verdict is INCONCLUSIVE, the first line also states the probability that is required for PASS.
    """
    is_first = True
    for point in check.points:
        # torques with another verdict do not decide
        if point.verdict is not check.verdict or not (probability := point.probability):
            continue
        # only the first line states the required probability
        is_stated = is_first and check.verdict is Verdict.INCONCLUSIVE
        chance = probability.text(point.sure if is_stated else None)
        is_first = False
        yield f"{point.M_g:g} N·m: probability that F'_ior + self error ≤ {point.limit_arcsec:g}″: {chance}"


def _undrawn(check: DesignCheck) -> Iterator[str]:
    """Yield the reason and the remedy if the verdict is INCONCLUSIVE because nothing was sampled."""
    if check.verdict is Verdict.INCONCLUSIVE and check.prior and not check.samples:
        count = len(check.prior.fields)
        yield (
            f"{count} inputs are uncertain and were not sampled. Sampling needs --draws above 0, no pitch files and "
            "bearing.ball_motion: locked. A measured F'_ior also decides the verdict."
        )


def _facts(check: DesignCheck) -> Iterator[Fact]:
    """Yield options, questions, inputs set to 0 and the next command, each as a label and a text."""
    if tuple(_undrawn(check)):
        yield "measure", again("accept", check.drive, "--measured", f"{check.points[check.governing].M_g:g}=FILE")
    yield from steps_facts(check, _lines_for_steps(check))
    yield "unknown", "" if check.samples or not check.unknown else f"set to 0: {unknown_names(check.unknown)}"
    # after PASS, random drives come next; otherwise the hole of the fixed wheel
    step = "tolerance" if check.verdict is Verdict.PASS else "mount"
    yield "next", again(step, check.drive)


def check_facts(check: DesignCheck) -> Iterator[Fact]:
    """Yield further facts about the results, each as a label and a text."""
    k = Kinematics.of(check.drive)
    revolutions = f"{k.cycle_cam_revolutions} input revolutions"
    yield "cycle", f"ratio {k.u:g}; full mesh cycle: {revolutions}, {thousands(k.cycle_states)} mesh positions"
    yield "catalogue", accuracy_words(check.drive.catalogue, check.points)
    yield "contributions", influence_at(check)
    if check.samples:
        yield "accuracy", _unstated_accuracy(check.drive, check.samples)
        yield "unknown", unknown_names(check.unknown)
        yield "inputs", uncertain_inputs_words(check.samples.prior)
        yield "samples", samples_words(check.samples)
        yield "reference data", _evidence_words(check.drive)
        yield "exact", fitted_words(check.samples.prior)


def uncertain_inputs_words(prior: DrivePrior) -> str:
    """Return the number of uncertain inputs as text, in total and by kind."""
    origin_words = {"assumed": "assumed with a range", "default": "default with a range"}
    kinds = ", ".join(f"{count} {origin_words.get(kind, kind)}" for kind, count in prior.counts().items() if count)
    return f"{len(prior.fields)} uncertain: {kinds}"


def _unstated_accuracy(drive: Drive, samples: Samples) -> str:
    """Return a sentence with the range of F'_ior at the smallest torque if the drive has the usual accuracy.

    The text is empty if the catalogue data of the preset state the accuracy, or do not state the backlash.
    """
    # only drives with catalogue data have a usual accuracy
    if drive.catalogue.accuracy is not None or drive.catalogue.play is None:
        return ""
    accuracy = USUAL_ACCURACY if drive.gears.pitch_diameter > SIZE_20 else SMALL_ACCURACY
    # manufacturers test the accuracy at a small torque
    k = min(range(len(samples.torques)), key=lambda k: abs(samples.torques[k]))
    # keeping() weights the samples as if the catalogue stated the accuracy
    low, high = (samples.of_ranges.keeping(accuracy, k).percentile(share, k) for share in (0.05, 0.95))
    return (
        f"catalogue.accuracy is not given. With an accuracy of {accuracy:g}″, which is usual for this size, F'_ior at "
        f"{samples.torques[k]:g} N·m is {low:.1f} to {high:.1f}″"
    )


def _evidence_words(drive: Drive) -> str:
    """Return a text on the reference data that weight the samples, and how to omit a value; empty without data."""
    paths = [item.path for item in evidence_of(drive)]
    return f"{', '.join(paths)}; to omit the last one, use --set {paths[-1]}=" if paths else ""


def fitted_words(prior: DrivePrior) -> str:
    """Return a text on the identified fields, which keep their fitted values in all samples; empty if none exist."""
    paths = prior.fitted
    unnamed = f" and {len(paths) - 3} more" if len(paths) > 3 else ""
    return f"at fitted values: {', '.join(paths[:3])}{unnamed}" if paths else ""


def _error_curve(check: DesignCheck, point: OperatingPoint) -> Curve:
    """Return the curve of the error over the full cycle at a torque, for the drive or a sample near the median."""
    assert point.error
    zero = ", unknown inputs set to 0" if check.unknown and not check.samples else ""
    sample_words = f" of a sampled drive with F'_ior {point.error.F_ior_arcsec:.1f}″" if check.samples else zero
    return Curve(
        point.error.states.phi_h / (2 * np.pi),
        point.error.error_arcsec,
        x_label="input angle phi_h, revolutions",
        y_label=f"kinematic error at {point.M_g:g} N·m{sample_words}, ″: {ENVELOPE}",
        over=1.0,
    )


def _spread_curve(check: DesignCheck, samples: Samples) -> Curve:
    """Return the percentiles of F'_ior over the samples at the governing torque as a curve."""
    point = check.points[check.governing]
    line = "" if point.left_arcsec is None else "; line: limit minus self error"
    return Curve(
        *shares_below(samples.sets_arcsec[:, :, check.governing].ravel(), samples.set_weights.ravel()),
        x_label="",
        y_label=f"F'_ior at {point.M_g:g} N·m by percentile of the drives, ″{line}",
        limit=point.left_arcsec,
        rows=2,
    )


def error_tables(check: DesignCheck) -> Iterator[Table]:
    """Yield the tables of all figures of the error by torque."""
    torque, *other_quantities = (q for q in POINT_QUANTITIES if q.key not in _OVER_BELIEF)
    # the angle of the fixed wheel is omitted, because it is always 0
    still = "phi_b" if Kinematics.of(check.drive).fixed == "rigid" else "phi_g"
    shown = [q for q in other_quantities if still not in q.key]
    title = "over the full mesh cycle"
    if check.samples:
        title += ", of a sampled drive near the median"
    elif check.unknown:
        title += ", unknown inputs set to 0"
    yield Table.by_column(title, (torque, *shown), check.points)
    yield Table.by_column("F'_ior over the uncertain inputs", (torque, *BELIEF, *_MONTE_CARLO), check.points)


def _values(check: DesignCheck, seed: int) -> Json:
    k = Kinematics.of(check.drive)
    return {
        "warnings": [*check.warnings, *([_UNKNOWN_AT_ZERO] if check.unknown and not check.samples else [])],
        "kinematics": {
            "u_hg" if k.fixed == "rigid" else "u_hb": k.u,
            **attributes(k, "fixed", "cycle_states", "cycle_cam_revolutions"),
        },
        "pitch": pitch_object(check.measured),
        "operating_points": as_objects(
            (*POINT_QUANTITIES, *BELIEF, *_MONTE_CARLO, Quantity("held_arcsec")), check.points
        ),
        "unknown": unknown_objects(check.unknown),
        "identified_as_exact": check.prior.fitted if check.prior else [],
        "influence": influence_objects(check.influences),
        "steps": as_json(check.steps),
        "least_sure_M_g_Nm": check.points[check.governing].M_g,
        "samples": samples_object(check.samples),
        "seed": seed,
        "verdict": check.verdict,
    }


def _line(check: DesignCheck) -> str:
    """Return the text for -q: one line per torque with F'_ior and the verdict."""
    return "\n".join(
        f"{p.M_g:g} N*m: F'_ior "
        + (f"{p.belief.p5:.2f} to {p.belief.p95:.2f}" if p.belief else _ON_PAGE[1].text(p))
        + f" arcsec, {p.verdict}"
        for p in check.points
    )


_SHOWN_OPTIONS = 3  # largest number of options on a short page
_SCREEN_LINES = 24
_SCREEN_COLUMNS = 80
_LABEL_COLUMNS = len("to clarify  ")
_LINES_OF_OTHERS = 15  # number of lines for head, table heads, next command, plot, verification and gaps
_DERIVED = "reducing a tolerance also reduces the deviations derived from it"
_NOT_LISTED = (
    "F'_ior of this drive was measured, so two options are not listed: another hole (hdassist mount gives F'_ior in "
    "each hole), and a drive with a better accuracy"
)
_COUPLING_ANSWERS = {"oldham": "Oldham coupling", "solid": "solid hub"}


def steps_tables(check: DesignCheck) -> Iterator[Table]:
    """Yield the table of options at the governing torque and the table of questions to clarify, with their outcomes."""
    if not check.steps:
        return
    point, purpose, value, outcome = _before_steps(check)
    # options and questions have separate tables, because a question is not an action
    options = [step for step in check.steps if not step.is_question]
    questions = [step for step in check.steps if step.is_question]
    if options:
        rows = [
            (_step_words(step, check.drive), _outcome_words(step, point), _carried_out(step, check)) for step in options
        ]
        notes = [_DERIVED] if any(step.kind == "tolerance" for step in options) else []
        if check.samples and is_error_measured(check.drive):
            notes.append(_NOT_LISTED)
        yield Table(
            f"options {purpose} ({value})",
            ("option", outcome, "how"),
            tuple(rows),
            notes=tuple(notes),
        )
    if questions:
        question_rows = tuple((_step_words(step, check.drive), _outcome_words(step, point)) for step in questions)
        title = f"questions to clarify, at {point.M_g:g} N·m ({value})"
        yield Table(title, ("to clarify", f"{outcome}, for each answer"), question_rows)


def steps_facts(check: DesignCheck, most_lines: int = _SCREEN_LINES) -> Iterator[Fact]:
    """Yield the fact with the best options, and the fact with the first question.

    If there is no room for everything, the third option is omitted first, then the question, then the second option.
    The first option is always shown.

    most_lines: largest number of lines that both facts may take on a page of 80 columns.
    """
    if not check.steps:
        return
    options = [step for step in check.steps if not step.is_question]
    questions = [step for step in check.steps if step.is_question]
    point, purpose, value, _ = _before_steps(check)
    lines = [f"{_step_words(step, check.drive)}: {_outcome_words(step, point)}" for step in options[:_SHOWN_OPTIONS]]
    question_lines = [f"{_step_words(step, check.drive)} {_outcome_words(step, point)}" for step in questions[:1]]
    head = [f"{purpose} ({value}):"] if lines else []
    # the first of these contents that fits on the screen is shown
    contents = [(lines, question_lines), (lines[:2], question_lines), (lines, []), (lines[:2], []), (lines[:1], [])]
    fitting = [content for content in contents if _wrapped_lines([*head, *content[0], *content[1]]) <= most_lines]
    lines, question_lines = fitting[0] if fitting else contents[-1]
    if lines:
        yield "options", "\n".join([*head, *lines])
    if question_lines:
        yield "to clarify", "\n".join(question_lines)


def _wrapped_lines(texts: Sequence[str], columns: int = _SCREEN_COLUMNS - _LABEL_COLUMNS) -> int:
    """Return the number of lines that the texts need next to a label; columns: width of a line."""
    return sum(len(wrap(text, columns)) for text in texts)


def _lines_for_steps(check: DesignCheck) -> int:
    """Return the number of lines on a screen that remain for options and questions."""
    reasons = _wrapped_lines([*_verdict_reasons(check)], _SCREEN_COLUMNS)
    taken = _LINES_OF_OTHERS + len(check.points) + reasons
    return _SCREEN_LINES - taken


def _before_steps(check: DesignCheck) -> tuple[OperatingPoint, str, str, str]:
    """Return the governing torque, the purpose of the steps, the value before them, and the column head of outcomes."""
    point = check.points[check.governing]
    torque = f"{point.M_g:g} N·m"
    limit = point.limit_arcsec
    # without a limit, options reduce F'_ior itself
    if limit is None:
        statistic = "median now" if point.belief else "now"
        return point, f"to reduce F'_ior at {torque}", f"{statistic} {median_words(point, 1)}″", "F'_ior"
    purpose = f"to meet {limit:g}″ at {torque}"
    # with samples, options raise the probability of meeting the limit
    if point.probability:
        probability = f"probability now {100 * point.probability.value:.0f} %"
        return point, purpose, probability, f"P(F'_ior + self error ≤ {limit:g}″)"
    return point, purpose, f"F'_ior + self error now {point.F_ior_upper_arcsec:.1f}″", "F'_ior + self error"


_COUNTS = {2: "two", 3: "three", 4: "four"}  # number words for the holes in which a step measures


def _step_words(step: Step, drive: Drive) -> str:
    """Return the description of a step."""
    holes = drive.mounting.holes
    if step.kind == "question":
        field = field_table()[step.of]
        return f"{field.question or f'what is the {field.meaning}?'} ({step.of})"
    if step.kind == "hole":
        place = f"hole {step.of}" if holes else f"{step.of}°"
        return f"put the {texts().fixed_wheel(drive)} in {place}"
    if step.kind == "trials":
        # a seat with free angle has no holes
        places = "holes" if holes else "angles"  # the mount command names them
        count = _COUNTS[len(step.of.split(","))]
        return f"measure F'_ior in {count} {places} and use the best"
    return {
        "correction": f"record the full cycle, store {step.of} correction terms",
        "tolerance": f"reduce {step.of} by a third",
        "coupling": f"use an Oldham coupling (cam.coupling={step.of})",
        "accuracy": f"use a drive with an accuracy of {step.of}″ (catalogue.accuracy)",
    }[step.kind]


def _carried_out(step: Step, check: DesignCheck) -> str:
    """Return the command or the change of the preset that carries out a step."""
    drive = check.drive
    if step.kind == "correction":
        return f"{again('plan', drive)}, then {again('compensate', drive)} RECORDING"
    # the command need not name the hole, because mount finds it
    if step.kind in ("hole", "trials"):
        return again("mount", drive)
    return command_line([word for text in step.edit for word in ("--set", text)])


def _outcome_words(step: Step, point: OperatingPoint) -> str:
    """Return the outcome of a step at a torque; for a question, the outcome of each reply."""
    if step.kind != "question":
        return _value(step.outcomes[0], point)
    unit = "" if step.of == "cam.coupling" else f" {field_unit(step.of)}"
    return "; ".join(
        f"{_COUPLING_ANSWERS.get(outcome.answer) or outcome.answer + unit}: {_value(outcome, point)}"
        for outcome in step.outcomes
    )


def _percentiles_after(found: Outcome, point: OperatingPoint) -> str:
    """Return the median of F'_ior after a step with its 5th and 95th percentile, as text.

    The relative standard error of each is assumed to be the largest of those of the percentiles before the step.
    """
    # without uncertain inputs, all percentiles are equal
    if found.p5 >= found.p95 or not point.belief:
        return f"{found.p50:.1f}″"
    before = {5: point.belief.p5, 50: point.belief.p50, 95: point.belief.p95}
    # the relative Monte Carlo error is assumed to be the same before and after the step
    error_share = max((percentile_error(percent, point) or 0.0) / value for percent, value in before.items())
    low, middle, high = (
        to_error_digit(value, error_share * found.p50, 1) for value in (found.p5, found.p50, found.p95)
    )
    return f"{middle}″ ({low} to {high})"


def _value(found: Outcome, point: OperatingPoint) -> str:
    """Return F'_ior after a step as text; with a limit, the probability of meeting it, or whether it is met."""
    if found.probability is None:
        return _percentiles_after(found, point)
    # without a range, the value either meets the limit or does not
    if found.p5 == found.p95:
        return f"{found.p50 + point.self_error.range_arcsec:.1f}″, {'met' if found.probability else 'not met'}"
    interval = f" ({100 * (found.probability_low or 0):.0f} to {100 * (found.probability_high or 0):.0f})"
    return f"{100 * found.probability:.0f} %{interval}"
