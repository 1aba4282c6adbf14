"""Corrections of the kinematic error by a controller as a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from hdassist.correction.correct import (
    HALVED,
    IN_PLACE,
    Correction,
    ErrorPart,
    FormResiduals,
    VerifiedCorrection,
    correction_curve,
)
from hdassist.correction.forms import ExpectedResidual, correction_columns, line_orders
from hdassist.error.waves import POINTS_A_TURN
from hdassist.errors import Verdict
from hdassist.model.deviations import unknown_notes, unknowns
from hdassist.model.geometry import Array
from hdassist.report import Curve, Fact, Facts, Report, Table, csv_columns, samples_object
from hdassist.terminal.words import again

UNPROVEN = "no real drive has been corrected with this yet: record the first one corrected"
_TOLD_NOISE_CYCLES = 1.5  # full cycles in a record that tells its noise
_OTHER_DIRECTION = "other_direction_arcsec"  # whose torque has rows of its own
_SHORT_FORM = "output turn, 256 points"  # that many controllers keep


def compensate_report(result: Correction, *, is_written: bool = False, warnings: Sequence[str] = ()) -> Report:
    """How much of the error a stored correction takes off, in which form.

    Arguments: is_written, whether a file has it; warnings, of a record alone.
    """
    drive, chosen, notes = result.drive, result.chosen, tuple[str, ...]()
    if drive:
        is_open = not (result.samples or result.misfit)
        notes = (*drive.origin.warnings, *(unknown_notes(drive) if is_open else ()))
        notes += result.samples.remarks if result.samples else ()
    refused = (f"{chosen.form.name}: refused, {_percent(chosen)} % would be left",) if chosen.is_refused else ()
    names = {_SHORT_FORM, chosen.form.name, result.forms[0].form.name}
    forms = [each for each in result.forms if each.form.name in names]
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
        values={
            "M_g_Nm": result.M_g,
            "parts": result.parts,
            "forms": [_form_object(each) for each in result.forms],
            "refused": chosen.is_refused,
            "recorded_Nm": list(result.records),
            "misfit": result.misfit,
            "fewest_points": result.fewest_points,
            "phasors": result.phasors,
            "correction": None if refused else result.correction,
            "corrections": [] if refused else list(result.corrections.values()),
            "samples": samples_object(result.samples),
        },
        csv=None if refused else csv_columns(**_columns(result)),
        line=_verdict(result),
        about=result.correction.preset,
        warnings=(*warnings, *notes, *refused),
        exit_code=5 if refused else 0,
    )


def verified_report(result: Correction, found: VerifiedCorrection) -> Report:
    """What a record with the correction on shows, and what was promised."""
    promised, (low, high) = found.promised, found.interval_arcsec
    came = f"at least {low:.1f}" if high is None else f"{low:.1f}-{high:.1f}"
    rows: list[tuple[str, ...]] = [("F'_ior", f"{promised.uncorrected_p50:.1f}", _range(promised), came)]
    parts = zip(result.parts, found.promised_parts, found.parts, strict=False)  # loads and directions are not compared
    rows += [(before.name, *map(_range, (before, *others))) for before, *others in parts]
    why = [f"{found.F_ior_arcsec:.1f}″ came ({came}), promised at most {promised.p95:.1f}″"]
    measure = []
    if found.verdict is Verdict.FAIL:
        why.append(f"likely cause: {found.cause or 'none of sign, zero and turns; has load, hole or drive changed?'}")
    elif found.verdict is Verdict.INCONCLUSIVE:
        measure = [("measure", "the full cycle with the correction on, twice or more: that shows the noise")]
    return Report(
        command="compensate",
        drive=result.drive,
        head=f"{result.correction.preset}, {result.chosen.form.name} on at {result.M_g:g} N·m",
        verdict=str(found.verdict),
        why=tuple(why),
        blocks=(Table("", ("arcsec", "before", "promised", "came"), tuple(rows)), Facts.of(measure)),
        certificate=result.certificate,
        values={"M_g_Nm": result.M_g, "form": result.chosen.form.name, "verified": found},
        line=str(found.verdict),
        warnings=result.drive.origin.warnings if result.drive else (),
        exit_code=found.verdict.exit_code,
    )


def _columns(result: Correction) -> dict[str, Array]:
    """Columns of the correction; where each load has one, their rows one torque after the other."""
    if not result.chosen.form.each_load:
        return correction_columns(result.correction)
    tables = [correction_columns(each) for each in result.corrections.values()]
    joined = {name: np.concatenate([each[name] for each in tables]) for name in tables[0] if name != _OTHER_DIRECTION}
    return {"M_g_Nm": np.repeat([*result.corrections], len(next(iter(tables[0].values())))), **joined}


def _verdict(result: Correction) -> str:
    form, residual = result.chosen.form, result.chosen.residuals[0]
    if not result.chosen.is_refused:
        noise = ", with noise of the record" if result.M_g in result.records else ""
        left = f"{_range(residual)} of {residual.uncorrected_p50:.1f}″ ({_percent(result.chosen)} %)"
        return f"{form.name} leave {left}{noise}"
    if any(each.is_refused for each in result.forms if each.form == form):
        return f"no: {form.name} may make it worse; {_enough(result)}"
    best = min(result.forms, key=lambda each: each.left[1])
    return f"record it first: {best.form.name} then leave {_percent(best)} %, from the preset alone it may get worse"


def _why(result: Correction) -> Iterator[str]:
    cam = next(each for each in result.forms if each.form.turn == "cam")
    if cam.left[1] <= HALVED:
        yield f"the error repeats with the cam, as of an oval wheel: a cam-turn table leaves {_percent(cam)} %"
    else:
        often = ", ".join(f"{each:g}" for each in result.strong_lines)
        yield f"the error comes {often} times an output turn: a cam-turn table leaves {_percent(cam)} %"
    yield UNPROVEN


def _facts(result: Correction, is_written: bool) -> Iterator[Fact]:
    yield "parts", "; ".join(f"{each.name} {_range(each)}" for each in result.parts)
    refused = "; ".join(each.form.name for each in result.forms if each.is_refused)
    yield "points", _enough(result) + (f"; refused, as they may make it worse: {refused}" if refused else "")
    yield "phasors", "left by their number: " + ", ".join(f"{n}: {left:.2g}″" for n, left in result.phasors.items())
    yield from _record_facts(result)
    missing = [f"{M_g:g}" for M_g in result.errors if M_g not in result.corrections]
    if result.chosen.form.each_load and missing:
        yield "stored", f"none at {', '.join(missing)} N·m, where it may make it worse"
    if result.misfit or (result.chosen.is_refused and result.M_g not in result.records):
        yield "next", again("compensate", result.drive, "record.csv")
    elif not (is_written or result.records):
        yield "next", again("compensate", result.drive, "--csv", "correction.csv")


def _record_facts(result: Correction) -> Iterator[Fact]:
    recorded = ", ".join(f"{M_g:g}" for M_g in result.records)
    turns = [float(np.ptp(each.cam_turns)) for each in result.records.values()]
    cycle = result.errors[result.M_g].lines.kinematics.cycle_cam_revolutions
    if result.misfit and result.drive:
        cycle_turns = f"{', '.join(f'{each:.3g}' for each in turns)} of {cycle} turns"
        yield "record", f"{cycle_turns} at {recorded} N·m; the correction has the preset's angles"
        fitted = ", ".join([*(each.path for each in unknowns(result.drive)), "values in doubt (docs/correct.md)"])
        yield "fitted", f"{fitted}; misfit {100 * result.misfit:.0f} % of the error"
        yield "measure", "the full cycle: it needs no fit"
    elif ends := result.recorded_deg:
        words = (
            f"{ends[0]:z.1f} to {ends[1]:z.1f}° of the output; beyond its ends the correction goes on without a promise"
        )
        yield "record", f"at {recorded} N·m, {words}"
    elif recorded and _is_of_part(result):
        words = f"{turns[0]:.3g} of {cycle} input revolutions at {recorded} N·m, whose angles the correction has"
        yield "record", words
        words = "sidebands and slow waves of the output that a part of the cycle does not determine are in what is left"
        yield "open", words
        yield "measure", "more of the cycle: it reduces the upper end of what is left"
    elif recorded:
        yield "record", f"at {recorded} N·m, whose angles the correction has"
    if not result.drive and not _is_of_part(result) and turns[0] < _TOLD_NOISE_CYCLES * cycle:
        yield "noise", "one cycle does not tell it from error: the upper end of what is left has all of it"
        yield "measure", "the cycle twice or more: noise averages out, error does not"


def _is_of_part(result: Correction) -> bool:
    """Return whether the correction is that of a recording alone of a part of the cycle, or of a travel."""
    return result.drive is None and any(record.is_part for record in result.records.values())


def _enough(result: Correction) -> str:
    points = result.fewest_points
    return f"{points} points over an output turn halve it" if points else "no table over an output turn halves it"


def _percent(each: FormResiduals) -> str:
    return " to ".join(dict.fromkeys(f"{100 * left:.0f}" for left in each.left[::2]))


def _range(each: ErrorPart | ExpectedResidual) -> str:
    return "-".join(dict.fromkeys(f"{end:.1f}" for end in (each.p5, each.p95)))


def _residual_table(forms: Sequence[FormResiduals], *, short: bool = False) -> Table:
    cases = list(range(len(forms[0].residuals)))
    if short:  # two torques, the zero off by more, and the turn lost
        cases = sorted({*cases[:2], *cases[-2:]} - {cases[-3]})
    heads = [forms[0].residuals[k] for k in cases]
    words = tuple(f"{each.M_g:g} N·m" if each.case == IN_PLACE else each.case.replace(" deg", "°") for each in heads)
    none = ("none", *(f"{each.uncorrected_p50:.1f}" for each in heads))
    rows = [(each.form.name, *(_range(each.residuals[k]) for k in cases)) for each in forms]
    return Table("", ("arcsec left with", *words), (none, *rows))


def _lines_table(result: Correction) -> Table:
    """The strong lines of the drive nearest to the median, before and after."""
    lines = result.errors[result.M_g].lines
    before, after = (2 / len(curve) * np.abs(np.fft.rfft(curve)[lines.per_cycle]) for curve in _curves(result))
    often, strongest = line_orders(lines)[0], np.argsort(-before)[:12]
    rows = tuple((f"{often[k]:g}", f"{before[k]:.2f}", f"{after[k]:.2f}") for k in strongest)
    heads = ("times an output turn", "before, ″", "after, ″")
    return Table("lines of the error of a drive in the middle of all", heads, rows)


def _curves(result: Correction) -> tuple[Any, Any]:
    """Error [arcsec] of the drive nearest to the median over the cycle, before and after."""
    error = result.errors[result.M_g]
    before = error.actual[np.argsort(error.ranges)[len(error.ranges) // 2]]
    return before, before - correction_curve(result.correction, error.lines.kinematics).reshape(-1)


def _before_and_after(result: Correction) -> Curve:
    before, after = _curves(result)
    turns, names = np.arange(len(before)) / POINTS_A_TURN, ("before", "after")
    title = "error, ″, least and greatest around each cam turn"
    return Curve(
        turns, before, "turns of the cam over the full cycle", title, over=1.0, second=after, names=names, rows=3
    )


def _form_object(each: FormResiduals) -> dict[str, Any]:
    return {
        "form": each.form.name, "left": dict(zip(("p5", "p50", "p95"), each.left, strict=True)),
        "refused": each.is_refused, "residuals": each.residuals,
    }  # fmt: skip
