"""The design check of a drive as a report, with the steps that would keep its limit or lessen F'_ior."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from hdassist.belief.evidence import evidence_of
from hdassist.belief.options import Outcome, Step
from hdassist.belief.prior import DrivePrior
from hdassist.belief.samples import Samples
from hdassist.belief.statistics import shares_below
from hdassist.design import DesignCheck, OperatingPoint, accuracy_words
from hdassist.errors import Verdict
from hdassist.model.deviations import unknown_names
from hdassist.model.geometry import Kinematics
from hdassist.pages.card import wheel
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.knowledge import SIZE_20, SMALL_ACCURACY, USUAL_ACCURACY
from hdassist.report import (
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
    unknown_objects,
)
from hdassist.run.system import command_line
from hdassist.terminal.words import (
    again,
    field_unit,
    heading,
    influence_words,
    samples_words,
    thousands,
)

_ANGLES = ("phi_h", "phi_g", "phi_b")
_UNKNOWN_AT_ZERO = "F_ior_shown_arcsec, at_max and at_min take what is not known as 0"


def _angle_deg(end: str, angle: str, point: OperatingPoint) -> float | None:
    """An angle of the state with the greatest or the least error (at_max, at_min) [deg]."""
    return (
        None
        if point.error is None
        else float(np.degrees(getattr(point.error.states, angle)[getattr(point.error, end)]))
    )


def _percentile_error(percent: int, point: OperatingPoint) -> float | None:
    """Monte Carlo standard error of a percentile of F'_ior [arcsec]."""
    if not (belief := point.belief):
        return None
    return belief.samples.of_ranges.percentile_error(percent / 100, belief.torque)


POINT_QUANTITIES = quantity_table(
    "check.points",
    turns=lambda angle_deg: f"{angle_deg / 360:.2f}",
    **{f"{end}.{angle}": partial(_angle_deg, end, angle) for end in ("at_max", "at_min") for angle in _ANGLES},
)
BELIEF = quantity_table("check.belief")
_MONTE_CARLO = quantity_table("check.monte_carlo", **{f"error_{p}": partial(_percentile_error, p) for p in (5, 50, 95)})
_OVER_BELIEF = {"F_ior_arcsec", "F_ior_upper_arcsec", "verdict"}  # of the unknown inputs too

_ON_PAGE = quantity_table(
    "check.page",
    range=lambda belief: f"{belief.p5:.1f} to {belief.p95:.1f}",
    verdict_of_limit=lambda point: point.verdict if point.limit_arcsec is not None else None,
)


def check_report(check: DesignCheck, seed: int) -> Report:
    """A design check; seed, of its sample that was solved again."""
    least_sure = check.points[check.least_sure]
    first = _spread_curve(check, check.samples) if check.samples and check.prior else _error_curve(check, least_sure)
    others = [point for point in check.points if check.samples or point is not least_sure]
    k, fixed = Kinematics.of(check.drive), wheel(check.drive)
    return Report(
        command="check",
        drive=check.drive,
        head=f"{check.drive.name}, {k.z_g}/{k.z_b} teeth, {fixed} fixed{heading(check.measured)}",
        verdict=str(check.verdict),
        why=tuple(filter(None, map(_verdict_reason, check.points))) or tuple(_undrawn(check)),
        blocks=(F_ior_table(check), Facts.of(_facts(check)), first),
        details=(
            *steps_tables(check),
            *error_tables(check),
            Facts.of(check_facts(check)),
            *(_error_curve(check, each) for each in others),
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
    """The largest influences at the torque that decides, in words; empty without any."""
    result = f"F'_ior at {check.points[check.least_sure].M_g:g} N·m" if check.influences else ""
    return influence_words(check.influences, result)


def F_ior_table(check: DesignCheck) -> Table:
    """F'_ior by torque, with its range over all that is not known exactly and its limit where there are such."""
    title = "kinematic error F'_ior over the full cycle, ″" + ", unknown as 0" * bool(check.unknown)
    if check.samples and check.prior:
        fitted = f" ({len(check.prior.fitted)} others as fitted)" if check.prior.fitted else ""
        title = f"F'_ior, ″: median and range over {len(check.prior.fields)} uncertain inputs{fitted}"
    return Table.by_row(title, _ON_PAGE, check.points)


def _verdict_reason(point: OperatingPoint) -> str:
    """Why the verdict at a torque is as it is; empty where there is no limit, or no probability."""
    if not (found := point.probability):
        return ""
    words = found.text(point.sure if point.verdict is Verdict.INCONCLUSIVE else None)
    return f"{point.M_g:g} N·m: F'_ior + self error ≤ {point.limit_arcsec:g}″: {words}"


def _undrawn(check: DesignCheck) -> Iterator[str]:
    """Why a verdict without samples is open, and the remedy."""
    if check.verdict is Verdict.INCONCLUSIVE and check.prior and not check.samples:
        count = len(check.prior.fields)
        drawn = "no samples of them were drawn (that takes --draws, smooth teeth, locked balls)"
        yield f"{count} inputs are not known exactly, and {drawn}; a measured F'_ior decides"


def _facts(check: DesignCheck) -> Iterator[Fact]:
    """Possible steps, inputs taken as 0, and the next command, a label and a text each."""
    if tuple(_undrawn(check)):
        yield "measure", again("accept", check.drive, "--measured", f"{check.points[check.least_sure].M_g:g}=FILE")
    yield from steps_facts(check)
    yield "unknown", "" if check.samples or not check.unknown else f"taken as 0: {unknown_names(check.unknown)}"
    step = "tolerance" if check.verdict is Verdict.PASS else "mount"
    yield "next", again(step, check.drive)


def check_facts(check: DesignCheck) -> Iterator[Fact]:
    """More to be known beside the numbers, a label and a text each."""
    k = Kinematics.of(check.drive)
    yield "cycle", f"ratio {k.u:g}, {k.cycle_cam_revolutions} cam turns, {thousands(k.cycle_states)} states"
    yield "catalogue", accuracy_words(check.drive.catalogue.accuracy, check.points)
    yield "influence", influence_at(check)
    if check.samples:
        yield "accuracy", _unstated_accuracy(check.drive, check.samples)
        yield "unknown", unknown_names(check.unknown)
        yield "inputs", uncertain_inputs_words(check.samples.prior)
        yield "samples", samples_words(check.samples)
        yield "evidence", _evidence_words(check.drive)
        yield "exact", fitted_words(check.samples.prior)


def uncertain_inputs_words(prior: DrivePrior) -> str:
    """Return the number of uncertain inputs, and of each kind of them, in words."""
    words = {"assumed": "assumed within a range", "default": "left to a default within a range"}
    kinds = ", ".join(f"{count} {words.get(kind, kind)}" for kind, count in prior.counts().items() if count)
    return f"{len(prior.fields)} uncertain: {kinds}"


def _unstated_accuracy(drive: Drive, samples: Samples) -> str:
    """The range at the least load if the seller keeps the usual accuracy; empty where it is stated."""
    if drive.catalogue.accuracy is not None or drive.catalogue.play is None:
        return ""
    accuracy = USUAL_ACCURACY if drive.gears.pitch_diameter > SIZE_20 else SMALL_ACCURACY
    k = min(range(len(samples.torques)), key=lambda k: abs(samples.torques[k]))
    low, high = (samples.of_ranges.keeping(accuracy, k).percentile(share, k) for share in (0.05, 0.95))
    kept = f"if the seller keeps the usual {accuracy:g}″, {low:.1f} to {high:.1f}″ at {samples.torques[k]:g} N·m"
    return f"catalogue.accuracy is not given; {kept}"


def _evidence_words(drive: Drive) -> str:
    """The figures that weigh samples, and how to leave a figure out; empty without any."""
    paths = [each.path for each in evidence_of(drive)]
    return f"{', '.join(paths)}; --set {paths[-1]}= leaves that one out" if paths else ""


def fitted_words(prior: DrivePrior) -> str:
    """Identified fields that samples take as exact."""
    paths = prior.fitted
    more = f" and {len(paths) - 3} more" if len(paths) > 3 else ""
    return f"identified, as fitted: {', '.join(paths[:3])}{more}" if paths else ""


def _error_curve(check: DesignCheck, point: OperatingPoint) -> Curve:
    """The error over the full cycle at a torque: of the drive, or of one near the median of what it may be."""
    assert point.error
    zero = ", unknown as 0" * bool(check.unknown and not check.samples)
    of = f" of a drive of {point.error.F_ior_arcsec:.1f}″, near the median" if check.samples else zero
    return Curve(
        point.error.states.phi_h / (2 * np.pi),
        point.error.error_arcsec,
        x_label="cam angle phi_h, turns",
        y_label=f"error at {point.M_g:g} N·m{of}, ″: least and greatest around each cam turn",
        over=1.0,
    )


def _spread_curve(check: DesignCheck, samples: Samples) -> Curve:
    """Percentiles of F'_ior over samples, at the torque that is least sure."""
    point = check.points[check.least_sure]
    held = "" if point.left_arcsec is None else "; line: limit less self error"
    return Curve(
        *shares_below(samples.F_ior_arcsec[:, check.least_sure], samples.weights),
        x_label="percentile",
        y_label=f"F'_ior at {point.M_g:g} N·m, ″: over the unknown inputs{held}",
        limit=point.left_arcsec,
        rows=2,
    )


def error_tables(check: DesignCheck) -> Iterator[Table]:
    """All figures of the error by torque, and of the drive's geometry."""
    torque, *others = (q for q in POINT_QUANTITIES if q.key not in _OVER_BELIEF)
    still = "phi_b" if Kinematics.of(check.drive).fixed == "rigid" else "phi_g"
    shown = [q for q in others if still not in q.key]
    of = ", of a drive near the median" if check.samples else ", unknown as 0" * bool(check.unknown)
    yield Table.by_column("over the full cycle" + of, (torque, *shown), check.points)
    yield Table.by_column("F'_ior over all that is not known exactly", (torque, *BELIEF, *_MONTE_CARLO), check.points)


def _values(check: DesignCheck, seed: int) -> Json:
    k = Kinematics.of(check.drive)
    return {
        "warnings": [*check.warnings, *[_UNKNOWN_AT_ZERO] * bool(check.unknown and not check.samples)],
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
        "least_sure_M_g_Nm": check.points[check.least_sure].M_g,
        "samples": samples_object(check.samples),
        "seed": seed,
        "verdict": check.verdict,
    }


def _line(check: DesignCheck) -> str:
    """Torque, F'_ior, verdict."""
    return "\n".join(
        f"{p.M_g:g} N*m: F'_ior "
        + (f"{p.belief.p5:.2f} to {p.belief.p95:.2f}" if p.belief else _ON_PAGE[1].text(p))
        + f" arcsec, {p.verdict}"
        for p in check.points
    )


_SHOWN_OPTIONS, _SHOWN_QUESTIONS = 3, 1  # on a short page
_COUPLING_ANSWERS = {"oldham": "Oldham coupling", "solid": "solid hub"}


def steps_tables(check: DesignCheck) -> Iterator[Table]:
    """Yield the options at the governing torque, and the questions that could be answered, with their outcomes."""
    if not check.steps:
        return
    point, words, now = _before_steps(check)
    options = [step for step in check.steps if not step.is_question]
    questions = [step for step in check.steps if step.is_question]
    title = f"{words} at {point.M_g:g} N·m, now {now}"
    if options:
        rows = [
            (_step_words(step, check.drive), _outcome_words(step, point), _carried_out(step, check)) for step in options
        ]
        yield Table(title, ("option", f"{words.partition(',')[0]} then", "how"), tuple(rows))
    if questions:
        asked = tuple((_step_words(step, check.drive), _outcome_words(step, point)) for step in questions)
        yield Table(title, ("to clarify", f"{words.partition(',')[0]} then"), asked)


def steps_facts(check: DesignCheck) -> Iterator[Fact]:
    """Yield the best options in lines under a label, and the first questions under another."""
    if not check.steps:
        return
    options = [step for step in check.steps if not step.is_question]
    questions = [step for step in check.steps if step.is_question]
    point, words, now = _before_steps(check)
    if options:
        lines = [f"{words} at {point.M_g:g} N·m, now {now}:"]
        lines += [
            f"{_step_words(step, check.drive)}: {_outcome_words(step, point)}" for step in options[:_SHOWN_OPTIONS]
        ]
        yield "options", "\n".join(lines)
    if questions:
        lines = [
            f"{_step_words(step, check.drive)} {_outcome_words(step, point)}" for step in questions[:_SHOWN_QUESTIONS]
        ]
        yield "to clarify", "\n".join(lines)


def _before_steps(check: DesignCheck) -> tuple[OperatingPoint, str, str]:
    """Return the governing torque, the quantity that steps change there, and its value before any, in words."""
    point = check.points[check.least_sure]
    if point.limit_arcsec is None:
        return point, "F'_ior", f"{point.F_ior_or_error:.1f}″"
    if point.probability:
        return point, f"probability to meet {point.limit_arcsec:g}″", f"{100 * point.probability.value:.0f} %"
    return point, f"F'_ior + self error, limit {point.limit_arcsec:g}″,", f"{point.F_ior_upper_arcsec:.1f}″"


_COUNTS = {2: "two", 3: "three", 4: "four"}  # holes that a step tries


def _step_words(step: Step, drive: Drive) -> str:
    """Return a step in words."""
    holes = drive.mounting.holes
    if step.kind == "question":
        field = field_table()[step.of]
        return f"{field.question or f'what is the {field.meaning}?'} ({step.of})"
    if step.kind == "hole":
        place = f"hole {step.of}" if holes else f"{30 * int(step.of)}°"
        return f"put the {wheel(drive)} in {place}"
    if step.kind == "trials":
        places = "holes" if holes else "directions"  # which ones, mount says
        count = _COUNTS[len(step.of.split(","))]
        return f"measure F'_ior in {count} {places}, keep the best"
    return {
        "correction": f"record the full cycle, then correct {step.of} terms",
        "tolerance": f"a third less of {step.of}, with all that follows",
        "coupling": f"an Oldham coupling (cam.coupling={step.of})",
        "accuracy": f"a drive of accuracy {step.of}″ (catalogue.accuracy)",
    }[step.kind]


def _carried_out(step: Step, check: DesignCheck) -> str:
    """Return the command or the edit that carries a step out now."""
    drive = check.drive
    if step.kind == "correction":
        return f"{again('plan', drive)}, then {again('compensate', drive)} RECORDING"
    if step.kind in ("hole", "trials"):
        return again("mount", drive)
    return command_line([word for text in step.edit for word in ("--set", text)])


def _outcome_words(step: Step, point: OperatingPoint) -> str:
    """Return the outcome of a step at a torque, or with each answer to a question."""
    if step.kind != "question":
        return _value(step.outcomes[0], point)
    unit = "" if step.of == "cam.coupling" else f" {field_unit(step.of)}"
    return ", ".join(
        f"{_COUPLING_ANSWERS.get(each.answer) or each.answer + unit} {_value(each, point)}" for each in step.outcomes
    )


def _value(found: Outcome, point: OperatingPoint) -> str:
    """Return F'_ior after a step; with a limit the probability that it is met, or the value compared with it."""
    if found.probability is None:
        return f"{found.p50:.1f}″" + (f" ({found.p5:.1f} to {found.p95:.1f})" if found.p5 < found.p95 else "")
    if found.p5 == found.p95:
        return f"{found.p50 + point.self_error.range_arcsec:.1f}″, {'met' if found.probability else 'not met'}"
    interval = f" ({100 * (found.probability_low or 0):.0f} to {100 * (found.probability_high or 0):.0f})"
    return f"{100 * found.probability:.0f} %{interval}"
