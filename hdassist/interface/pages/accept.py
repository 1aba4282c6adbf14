"""Reports of the acceptance of a drive or a lot and of its replay, and the checks in words, CSV and JUnit XML."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from math import floor, log10
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from hdassist import __version__
from hdassist.drive.model.geometry import Kinematics
from hdassist.drive.preset.fields import Drive
from hdassist.drive.preset.text import convert, shown
from hdassist.features.acceptance.answer import (
    LOT_VERDICTS,
    AcceptAnswer,
    ErrorRecord,
    answer_differences,
    answer_json,
    lot_summary,
    provenance,
)
from hdassist.features.acceptance.decision import Belief, DecidedCheck, Predictions
from hdassist.features.acceptance.limits import CODES, F_IOR, Limit, LimitText
from hdassist.features.acceptance.request import Lot, Request, torque_and_file
from hdassist.features.measuring.orders import STATED, parse_stated
from hdassist.features.report import NO_VALUE, Fact, Facts, Quantities, Quantity, Report, Table, attributes, four_digits
from hdassist.interface.pages.check import fitted_words, influence_at, steps_facts, steps_tables
from hdassist.interface.terminal.output import csv_text, together
from hdassist.interface.terminal.words import WHEEL_WORDS, again, samples_words
from hdassist.readers.table import shortened
from hdassist.run.errors import GUARD, SEVERITY, DataError, percent_text, worst_exit_code
from hdassist.run.files import number_of, visible
from hdassist.run.system import command_line

_RULE_WORDS = {
    "guard": f"guard band of {GUARD:g} u on each side of the limit",
    "simple": "simple acceptance, without a guard band",
}
_CHECK_FIGURES: Quantities[DecidedCheck | None] = tuple(  # columns of the CSV file with the figures of checks
    Quantity(name)
    for name in (
        *(field.name for field in fields(DecidedCheck) if field.name not in ("unstated", "belief", "full_cycle")),
        *(f"belief.{field.name}" for field in fields(Belief)),
    )
)
FIGURES_HEAD = ",".join(("serial", "preset", *(figure.key for figure in _CHECK_FIGURES), "exit_code", "error", ""))
_BASIS_WORDS = {"stated": "reported value"}  # name of a basis on pages, if it differs from the key
_NARROWER = (  # action for a measured value within the guard band
    "measure again with a smaller uncertainty: record longer, repeat the measurement, or reduce noise or --budget"
)
_NAMED_CHECKS = 2  # largest number of checks or drives named in a text


def number(value: float, limit: Limit) -> str:
    """Return a value as text for the table of checks.

    A value in arcsec has at least two decimals, and more if three significant digits of its limit need them.
    """
    if limit.check.unit != "arcsec":
        return four_digits(value)
    return f"{value:.{max(2, 2 - floor(log10(limit.limit)))}f}"


def _value(check: DecidedCheck) -> str | None:
    """Return the value of a check as text; for a lower bound, "≥" and the lower end of its interval."""
    if check.value is None or check.extent != "at least":
        return None if check.value is None else number(check.value, check)
    interval = _interval(check)
    low = interval[0] if interval else max(0.0, check.value - (check.expanded_uncertainty or 0.0))
    return f"≥ {number(low, check)}"


def _interval(check: DecidedCheck) -> tuple[float, float] | None:
    """Return the 95 % interval for the full cycle, from a model fitted to the recording; None without a model."""
    return check.full_cycle.interval if check.full_cycle else None


def _of_value(name: str) -> Callable[[DecidedCheck], str | None]:
    """Return a function from a check to the cell of one of its numbers, which is None for a lower bound.

    name: attribute of the check.
    """
    return lambda d: None if (value := getattr(d, name)) is None or d.extent == "at least" else number(value, d)


def _without_interval(name: str) -> Callable[[DecidedCheck], str | None]:
    """Return a function from a check to the cell of one of its numbers.

    The cell is None for a lower bound, and for a value with an interval for the full cycle.

    name: attribute of the check.
    """
    cell_of = _of_value(name)
    return lambda d: None if _interval(d) else cell_of(d)


def _range(check: DecidedCheck) -> str | None:
    """Return the 5th and 95th percentile of a prediction, or the ends of the 95 % interval of a recording, as text."""
    ends = (check.belief.p5, check.belief.p95) if check.belief else _interval(check)
    return ends and f"{number(ends[0], check)} to {number(ends[1], check)}"


def _bound(limit: Limit) -> str:
    """Return a limit as text after its sign, ≤ or ≥."""
    return f"{'≤' if limit.check.upper else '≥'} {limit.limit:.6g}"


def _shown_label(check: DecidedCheck) -> str:
    """Return the label of a check on pages.

    The label of a predicted F'_ior also names the self error, which is added to the prediction. A measured F'_ior
    already contains the self error.
    """
    adds = check.check is F_IOR and check.basis == "predicted"
    return check.label.replace("F'_ior", "F'_ior + self error") if adds else check.label


_DECISION_COLUMNS: Quantities[DecidedCheck] = (
    Quantity("check", value=lambda d: f"{_shown_label(d)},{_unit(d).replace('″', ' ″')}"),
    Quantity("verdict", digits=str),
    Quantity("value", value=_value),
    Quantity("expanded_uncertainty", "± (k=2)", value=_without_interval("expanded_uncertainty")),
    Quantity("range", "5 to 95 %", value=_range),
    Quantity("limit", value=_bound),
    Quantity("margin", value=_of_value("margin")),
    Quantity("guard", "guard band", value=lambda d: _without_interval("guard")(d) if d.guard else None),
    Quantity("kept", "P(met)", value=lambda d: d.belief and f"{100 * d.belief.probability:.0f} %"),
)


def accept_report(
    answer: AcceptAnswer,
    predictions: Predictions | None,
    drive: Drive,
) -> Report:
    """Return the report of the acceptance of a drive; predictions: predictions of the model, None if there are none."""
    checks = _by_severity(_shown_checks(answer))
    worst = [check for check in checks if check.verdict == checks[0].verdict]
    reasons = [_reason(check, answer) for check in worst[:_NAMED_CHECKS]]
    reasons[-1] += _further_checks(len(worst) - _NAMED_CHECKS)
    return Report(
        command="accept",
        drive=drive,
        head=answer.preset.name + (f", serial {answer.serial}" if answer.serial else ""),
        verdict=answer.status,
        why=tuple(reasons),
        blocks=(*_tables(answer), Facts.of(_facts(answer, predictions, drive))),
        details=(
            *(steps_tables(predictions) if predictions else []),
            Facts.of(_more_facts(answer, predictions)),
        ),
        certificate=predictions.certificate if predictions else None,
        cross_checks=predictions.cross_checks if predictions else (),
        values=answer_json(answer),
        line=answer.status,
        warnings=answer.warnings,
        exit_code=answer.exit_code,
    )


def _reason(check: DecidedCheck, answer: AcceptAnswer) -> str:
    """Return the reason for the verdict on a check; for an undecided prediction, the probability of the limit."""
    if check.belief and check.verdict == "INCONCLUSIVE" and answer.rule:
        probability = check.belief.kept.text(answer.rule.sure)
        return f"probability that {_shown_label(check)} is {_bound(check)}{_unit(check)}: {probability}"
    return f"{_shown_label(check)}: {check.reason}" if check.reason else _sentence(check)


def _further_checks(count: int) -> str:
    """Return the end of a list of checks, with the number of checks not listed; empty if all are listed."""
    if count <= 0:
        return ""
    return f"; {count} further checks" if count > 1 else "; 1 further check"


def _more_facts(answer: AcceptAnswer, predictions: Predictions | None) -> Iterator[Fact]:
    """Yield contributions, samples, the reasons for all verdicts, notes and files, each as a label and a text."""
    if predictions:
        yield "contributions", influence_at(predictions)
        yield "samples", samples_words(predictions.samples) if predictions.samples else ""
        yield "exact", fitted_words(predictions.samples.prior) if predictions.samples else ""
    yield (
        "reasons",
        "\n".join(f"{check.label}: {check.verdict}, {check.reason}" for check in answer.checks if check.reason),
    )
    yield "notes", "\n".join(f"{note.code}: {note.text}" for note in answer.remarks if note.code != "RECORD")
    yield "version", f"{__version__}, preset sha256 {str(answer.preset.sha256)[:12]}"
    hashes = {recording.file: recording.sha256 for recording in answer.measured} | {
        recording.file: recording.sha256 for recording in answer.pitch
    }
    yield "files", "\n".join(f"{file}: sha256 {sha256[:12]}" for file, sha256 in hashes.items())


def _shown_checks(answer: AcceptAnswer) -> list[DecidedCheck]:
    """Return the checks of a result, with stiffnesses and torques in the units of the limits on the command line."""
    limit_texts = [LimitText.parse(text, "--limit") for text in (answer.request.limits if answer.request else ())]
    units = {limit.field: limit.text.lstrip("+-.0123456789 eE") for limit in limit_texts}
    return [_in_unit(check, units.get(check.check.field, "")) for check in answer.checks]


def _in_unit(check: DecidedCheck, unit: str) -> DecidedCheck:
    if not unit or check.belief or check.unit == "arcsec":
        return check
    size = convert(f"1 {unit}", check.unit)
    names = ("limit", "value", "expanded_uncertainty", "margin", "guard")
    return replace(
        check,
        unit=unit,
        **{name: (value := getattr(check, name)) and value / size for name in names},
    )


def _by_severity(checks: Iterable[DecidedCheck]) -> list[DecidedCheck]:
    """Return the checks sorted by verdict, the worst first, and by relative margin, the smallest first."""
    return sorted(checks, key=lambda each: (SEVERITY.index(each.verdict), (each.margin or 0.0) / each.limit))


def _column_of_basis(
    quantity: Quantity[DecidedCheck],
    basis: str,
    *,
    is_predicted: bool,
) -> Quantity[DecidedCheck]:
    """Return a column of the table of checks, with a label that depends on the basis of the values.

    basis: measured, stated or predicted.
    is_predicted: whether the values are medians over samples.
    """
    if is_predicted and quantity.key == "value":
        return replace(quantity, label="median")
    if basis == "measured" and quantity.key == "range":
        return replace(quantity, label="95 % interval")
    return quantity


def _tables(answer: AcceptAnswer) -> Iterator[Table]:
    """Yield a table of checks for each basis of their values."""
    assert answer.rule is not None
    teeth = ", ".join(f"{WHEEL_WORDS[wheel.wheel]} ({shown(wheel.file)})" for wheel in answer.pitch)
    titles = {
        "measured": f"measured: {_RULE_WORDS[answer.rule.measured]}",
        "stated": f"reported values: {_RULE_WORDS[answer.rule.measured]}",
        "predicted": f"predicted: PASS if the probability is at least {100 * answer.rule.sure:g} %; "
        "a prediction is not a statement of conformity" + (f"; measured pitch deviations: {teeth}" if teeth else ""),
    }
    for basis, title in titles.items():
        checks = [check for check in _shown_checks(answer) if (check.basis or "measured") == basis]
        # if the probability of meeting the limit is known, it replaces the margin
        left_out = {"margin"} if any(check.belief for check in checks) else set()
        is_predicted = basis == "predicted" and all(check.belief for check in checks)
        columns = [
            _column_of_basis(quantity, basis, is_predicted=is_predicted)
            for quantity in _DECISION_COLUMNS
            if quantity.key not in left_out and {*map(quantity.text, checks)} - {NO_VALUE}
        ]
        yield Table.by_row(title, columns, checks)


def _facts(
    answer: AcceptAnswer,
    predictions: Predictions | None,
    drive: Drive,
) -> Iterator[Fact]:
    """Yield options, questions, notes and the next command, each as a label and a text."""
    if predictions:
        yield from steps_facts(predictions)
    codes = [*dict.fromkeys(note.code for note in answer.remarks)]
    words_of_codes = ", ".join(CODES[code].words for code in codes)
    records = [note.text for note in answer.remarks if note.code == "RECORD"]
    yield "notes", "\n".join([*records, f"{words_of_codes} (hdassist explain {' '.join(codes)})"]) if codes else ""
    first = _by_severity(answer.checks)[0]
    if _is_open(first) and first.extent == "at least":
        kinematics = Kinematics.of(drive)
        travel = drive.acceptance.travel
        turns = travel * abs(kinematics.u) / 360
        whole_cycle = (
            f"the full mesh cycle of {kinematics.cycle_cam_revolutions} input revolutions; "
            "a recording of less than a third of the cycle cannot result in PASS"
        )
        if turns < kinematics.cycle_cam_revolutions:
            whole_cycle = (
                f"the whole travel of {travel:g}° at the output ({turns:.4g} input revolutions); "
                "a recording of only part of the travel cannot result in PASS"
            )
        yield "measure", whole_cycle
    if _is_open(first) or (first.basis == "predicted" and first.verdict != "FAIL"):
        yield "next", _with_measured(first, answer, drive)
    elif _is_within_guard(first):
        yield "measure", _NARROWER
        yield "next", _to_explain(answer.checks)
    elif first.verdict == "INCONCLUSIVE" and first.unstated:
        yield "next", again("accept", drive) + _with_budget(first.unstated)
    else:
        failed = _failed_by_F_ior([answer])
        yield "next", _turning_command(failed[0]) if failed else _to_explain(answer.checks)


def _with_measured(
    check: DecidedCheck,
    answer: AcceptAnswer,
    drive: Drive,
) -> str:
    """Return the accept command with a placeholder for a value that is still to be measured.

    The value replaces an earlier recording at the torque of the check.
    """
    if not (answer.request and check.option.startswith("--measured")):
        return f"{again('accept', drive)} {check.option}"
    torques = {text: torque_and_file(text)[0] for text in answer.request.measured}  # empty: torque of the only limit
    other_texts = [text for text, torque in torques.items() if torque and number_of(torque) != check.M_g_Nm]
    command = again(
        "accept", drive, *(word for text in other_texts for word in ("--measured", text)), *check.option.split()
    )
    unstated = [name for name in STATED if name not in parse_stated(answer.request.reading.budget)]
    return command + _with_budget(unstated)


def _with_budget(unstated: Sequence[str]) -> str:
    """Return the option for the sources of uncertainty that are not stated yet; empty if all are stated."""
    return f" --budget {','.join(f'{name}=U' for name in unstated)}" if unstated else ""


def _sentence(check: DecidedCheck) -> str:
    """Return a check as text: value, uncertainty or range, limit, margin, guard band, and basis of the value."""
    cells = {quantity.key: quantity.of(check) for quantity in _DECISION_COLUMNS}
    if not cells["value"]:
        return f"{_shown_label(check)}: no value, limit {_bound(check)}{_unit(check)}"
    spread = f" ± {cells['expanded_uncertainty']}" if cells["expanded_uncertainty"] else ""
    value = cells["value"] + spread + (f" ({cells['range']})" if cells["range"] else "")
    if check.at_most is not None and check.verdict != "FAIL" and not cells["range"]:
        value += f" to {check.at_most:.4g}"
    labels = {"limit": "limit", "margin": "margin", "guard": "guard band", "kept": "probability that it is met"}
    other_figures = [f"{label} {cells[name]}" for name, label in labels.items() if cells[name]]
    basis = _BASIS_WORDS.get(str(check.basis), check.basis)
    return ", ".join(filter(None, (f"{_shown_label(check)}: {value}{_unit(check)}", *other_figures, basis)))


def _unit(check: DecidedCheck) -> str:
    """Return the unit of a check as it is printed after a value, with a space except before ″."""
    return "″" if check.unit == "arcsec" else f" {check.unit.replace('*', '·')}"


def _is_open(check: DecidedCheck) -> bool:
    """Return whether a check is undecided after a prediction or a recording of only a part of the cycle."""
    return check.verdict == "INCONCLUSIVE" and (check.basis == "predicted" or check.extent == "at least")


def _is_within_guard(check: DecidedCheck) -> bool:
    """Return whether a check is undecided only because a measured value is too close to its limit."""
    is_whole = check.extent == "whole" and not check.unstated
    return check.verdict == "INCONCLUSIVE" and check.basis != "predicted" and check.value is not None and is_whole


def _action(check: DecidedCheck) -> str:
    """Return the next action for a check without PASS, as an instruction."""
    # a prediction, a part of the cycle and a missing value are decided by a measurement
    if _is_open(check) or check.value is None:
        return f"measure it ({check.option})"
    if check.verdict == "FAIL":
        turn = "put the fixed wheel in another hole (hdassist mount), " if check.check is F_IOR else ""
        return f"{turn}change the drive as hdassist explain {check.code} states, or reject it"
    if check.unstated:
        return f"state the missing uncertainties,{_with_budget(check.unstated)}"
    return _NARROWER if _is_within_guard(check) else f"hdassist explain {check.code}"


def _to_explain(checks: Iterable[DecidedCheck]) -> str:
    """Return the command that explains failed checks and undecided measured checks; empty if there are none."""
    codes = [check.code for check in checks if check.verdict in ("FAIL", "INCONCLUSIVE") and not _is_open(check)]
    return f"hdassist explain {' '.join(dict.fromkeys(codes))}" if codes else ""


def _yield_words(summary: Mapping[str, Any]) -> str:
    """Return a sentence with the share of drives that pass, and its interval."""
    share = summary["yield"]
    if not share:
        return "no yield, because no drive has PASS or FAIL; the table gives the reasons"
    percent = percent_text(share["share"], share["low"], share["high"])
    return f"yield: {percent}, {summary['verdicts']['PASS']} PASS among {share['decided']} drives with PASS or FAIL"


def _comment_warnings(lot: Lot) -> list[str]:
    """Return a list with one warning if lines of a lot were read as comments, because a line may be a drive."""
    if not lot.remarks:
        return []
    label = "lines" if len(lot.remarks) > 1 else "line"
    verb = "were" if len(lot.remarks) > 1 else "was"
    return [f"{lot.file}: {label} {shortened(lot.remarks)} {verb} read as comments, not as drives"]


def lot_report(lot: Lot, answers: Sequence[AcceptAnswer]) -> Report:
    """Return the report of a lot: counts of verdicts, yield, and each drive with its deciding check."""
    summary = lot_summary(answers)
    counts = [f"{count} {verdict}" for verdict in LOT_VERDICTS if (count := summary["verdicts"][verdict])]
    # an error that occurs in many rows is explained only once
    same: dict[str, AcceptAnswer] = {}  # first result with each error, by the message
    drives = tuple(
        (title(answer), answer.status, _deciding(answer, same.setdefault(fault_words(answer), answer)))
        for answer in answers
    )
    warnings = (*_shared_records(answers), *_comment_warnings(lot))
    return Report(
        command="accept",
        drive=None,
        head=f"{lot.file}, {_drives(len(answers))}",
        verdict=", ".join(counts),
        # only drives with PASS or FAIL count for the yield
        why=(_yield_words(summary),),
        blocks=(
            Table("", ("drive", "verdict", "decided by"), drives, named=True),
            Facts.of(_lot_facts(answers)),
        ),
        details=(Facts((("version", __version__), ("lot", f"{lot.file}, sha256 {lot.sha256[:12]}"))),),
        values={
            **together("accept", [answer_json(answer) for answer in answers]),
            "warnings": warnings,
            "lot": {"name": lot.file, "sha256": lot.sha256, "rows": len(lot.rows)},
            "summary": summary,
        },
        line="\n".join(f"{name} {status}" for name, status, _ in drives),
        warnings=warnings,
        exit_code=worst_exit_code(answer.exit_code for answer in answers),
    )


def _shared_records(answers: Sequence[AcceptAnswer]) -> Iterator[str]:
    """Yield a warning for each recording that several drives share, because a row may name a wrong file."""
    drives: dict[str, dict[str, str]] = {}  # by SHA-256 of a recording: its file for each drive
    for answer in answers:
        for trace in answer.measured:
            drives.setdefault(trace.sha256, {})[title(answer)] = trace.file
    for files in drives.values():
        if len(files) > 1:
            yield f"{', '.join(files)} contain the same recording: {', '.join(dict.fromkeys(files.values()))}"


def _deciding(answer: AcceptAnswer, first_alike: AcceptAnswer) -> str:
    """Return the deciding check of a drive with its reason, or the error of the drive.

    first_alike: first result of the lot with the same error; a later result refers to the first and omits the error.
    """
    if not answer.error:
        worst = _by_severity(_shown_checks(answer))[0]
        return "; ".join(filter(None, (_sentence(worst), worst.reason)))
    if answer is not first_alike:
        return f"same error as {title(first_alike)}"
    first, *further_lines = answer.error.message.splitlines()
    return first + (f" (and {len(further_lines)} more)" if further_lines else "")


def fault_words(answer: AcceptAnswer) -> str:
    """Return the error message of a row without the line number, which differs between rows; empty without an error."""
    return re.sub(rf"^{re.escape(answer.place or '')}(:\d+)?: ", "", answer.error.message) if answer.error else ""


def _lot_facts(answers: Sequence[AcceptAnswer]) -> Iterator[Fact]:
    """Yield notes, the next measurement and the next command, each as a label and a text."""
    notes = Counter(code for answer in answers for code in {note.code for note in answer.remarks})
    del notes["NOT_TESTED"]  # the fact "not tested" states this note together with the drives
    yield "notes", "; ".join(f"{code}: {_drives(notes[code])}" for code in sorted(notes))
    yield "not tested", "\n".join(_untested_limits(answers))
    checks = sorted((check for answer in answers for check in answer.checks), key=lambda check: check.code)
    open_ = sorted({check.label for check in checks if _is_open(check)})
    yield (
        "measure",
        f"{'; '.join(open_)}; a prediction or a recording of part of the cycle is not sufficient" if open_ else "",
    )
    failed = _failed_by_F_ior(answers)
    if failed:
        yield "other hole", _failed_words(failed)
    yield "next", _turning_command(failed[0]) if failed else _to_explain(checks)


def _untested_limits(answers: Sequence[AcceptAnswer]) -> Iterator[str]:
    """Yield each untested limit as text, with the drives for which it was not tested."""
    drives: dict[str, list[str]] = {}
    for answer in answers:
        for label in answer.left_out:
            drives.setdefault(label, []).append(title(answer))
    for label, names in drives.items():
        yield f"{label}: {shortened(names)} (--strict requires a measured value)"


@dataclass(frozen=True)
class _FailedDrive:
    """Drive that fails by F'_ior.

    name: name of the drive.
    request: its request.
    check: failed check with the largest ratio of the value to the limit.
    times_limit: this ratio.
    """

    name: str
    request: Request
    check: DecidedCheck
    times_limit: float


def _failed_by_F_ior(answers: Sequence[AcceptAnswer]) -> list[_FailedDrive]:
    """Return the drives that fail by F'_ior, sorted by the ratio of the value to the limit, the smallest first."""
    failed = []
    for answer in answers:
        checks = [check for check in answer.checks if check.check is F_IOR and check.verdict == "FAIL"]
        ratios = [(check.value or 0.0) / check.limit for check in checks]
        if checks and answer.request is not None:
            worst = max(range(len(checks)), key=lambda k: (ratios[k], k))  # of equal ratios, the last one is chosen
            failed.append(
                _FailedDrive(
                    name=title(answer),
                    request=answer.request,
                    check=checks[worst],
                    times_limit=ratios[worst],
                )
            )
    return sorted(failed, key=lambda drive: drive.times_limit)


def _failed_words(failed: Sequence[_FailedDrive]) -> str:
    """Return a sentence which says that another hole may reduce F'_ior of the failed drives, and names a few drives."""
    named = [f"{drive.name} (F'_ior is {drive.times_limit:.3g} times the limit)" for drive in failed]
    unnamed = len(named) - _NAMED_CHECKS
    text = f"a different hole may reduce F'_ior of {'; '.join(named[:_NAMED_CHECKS])}"
    if unnamed > 0:
        text += f"; and of {unnamed} further drive{'' if unnamed == 1 else 's'}"
    if len(named) > 1:
        text += ". The next command is for the first of these drives"
    return text


def _turning_command(failed: _FailedDrive) -> str:
    """Return the command that finds another hole for a drive.

    The command includes the value measured in the present hole, unless the value is a lower bound.
    """
    check = failed.check
    arguments = ["hdassist", "mount", failed.request.preset]
    is_measured = check.basis != "predicted" and check.value is not None and check.extent == "whole"
    if is_measured:
        arguments.append(f"h0={check.value:g}")
    arguments += [word for text in failed.request.overrides for word in ("--set", text)]
    arguments += ["--limit", f"F_ior@{check.M_g_Nm:g}={check.limit:g}"]
    if is_measured:
        arguments += ["--trial-torque", f"{check.M_g_Nm:g}"]
    return command_line(arguments)


def _drives(count: int) -> str:
    return f"{count} drive{'' if count == 1 else 's'}"


def replay_report(
    recorded: AcceptAnswer,
    now: AcceptAnswer | None,
    fault: DataError | None,
) -> Report:
    """Return the report of the replay of a stored result.

    recorded: result read from the file.
    now: result computed now, None if it was not computed.
    fault: error that prevents the replay, None if there is none.
    """
    differences = answer_differences(recorded, now) if now else []
    outcome, code = ("differs", 3) if differences else ("agrees", 0) if now else ("not replayed", 0)
    if fault:
        outcome = "cannot be replayed"
        code = fault.exit_code
    by = f", by version {recorded.version}" if recorded.version != __version__ else ""
    return Report(
        command="accept-replay",
        drive=None,
        head=f"{title(recorded)}, {recorded.status} at {recorded.time}{by}",
        verdict=outcome,
        why=(fault.message,) if fault else tuple(map(str, differences)),
        values={
            "preset": recorded.preset,
            "serial": recorded.serial,
            "agrees": now and not differences,
            "recorded": attributes(recorded, "version", "time", "verdict", "exit_code"),
            "verdict": now and now.verdict,
            "differences": [asdict(difference) for difference in differences],
            **({"error": {"code": fault.fault, "message": fault.message, "hint": fault.hint}} if fault else {}),
        },
        line=outcome,
        exit_code=code,
    )


def title(answer: AcceptAnswer) -> str:
    """Return the serial number of a drive, or else the name of its preset, with control characters escaped."""
    name = answer.serial or answer.preset.name
    return shown(name, len(name))


def csv(answers: Sequence[AcceptAnswer]) -> str:
    """Return the results as CSV, with one row per drive and limit.

    An untested limit has the verdict NOT_TESTED. A drive without a result has one row with its error.
    """
    rows = []
    for answer in answers:
        for check in answer.checks or [None]:
            verdict = answer.status if answer.error or check is None else check.verdict
            rows.append(_csv_row(answer, check, verdict, check.reason if check else None))
        rows += [_csv_row(answer, None, "NOT_TESTED", f"{label}: no value") for label in answer.left_out]
    return csv_text([*rows[0]], [[*row.values()] for row in rows])


def _csv_row(
    answer: AcceptAnswer,
    check: DecidedCheck | None,
    verdict: str | None,
    reason: str | None,
) -> dict[str, object]:
    """Return a CSV row: the figures of a check, and the provenance of the result that it belongs to."""
    return {
        "serial": answer.serial,
        "preset": answer.preset.name,
        **{figure.key: figure.of(check) for figure in _CHECK_FIGURES},
        "verdict": verdict,
        "reason": reason,
        "exit_code": answer.exit_code,
        "error": answer.error and answer.error.message,
        **provenance(answer),
        "status": answer.status,
    }


SUITES_HEAD = '<?xml version="1.0" encoding="UTF-8"?>\n<!-- hdassist accept -->\n'
_COUNTED = {"tests": "testcase", "failures": "failure", "errors": "error", "skipped": "skipped"}


def junit(
    name: str,
    answers: Sequence[AcceptAnswer],
    lot_sha256: str = "",
) -> str:
    """Return the results as JUnit XML for build servers, with a suite for each drive and a test case for each check.

    The class of a case names the drive, and the name of a case is the limit. Remarks on a drive appear once, in the
    output of the suite. FAIL and INCONCLUSIVE are both failures, because neither may be shown in green. A drive without
    a result is an error, and an untested limit is skipped. The properties of the suite contain the provenance of the
    result, including its time. Durations and machine names are omitted.

    name: name of the whole file.
    answers: results, one per drive.
    lot_sha256: SHA-256 of the file of a lot, empty if there is no lot.
    """
    root = Element("testsuites", name=visible(name))
    for answer in answers:
        _suite(root, answer, lot_sha256)
    for element in (*root, root):
        kinds = Counter(inner.tag for inner in element.iter())
        counted = {key: str(kinds[tag]) for key, tag in _COUNTED.items() if element is not root or key != "skipped"}
        element.attrib.update(counted)
    indent(root)
    return SUITES_HEAD + tostring(root, encoding="unicode") + "\n"


def _suite(
    root: Element,
    answer: AcceptAnswer,
    lot_sha256: str,
) -> None:
    """Append the test suite of a drive to the root of a JUnit file, with a test case for each check."""
    suite = _Suite.begun(root, answer, lot_sha256)
    if answer.error:
        suite.add_error(answer.status, answer.error)
    for check in answer.checks:
        suite.add_check(check)
    for label in answer.left_out:
        suite.add_case(label, "skipped", message="not tested: no measured value")
    remarks = [f"note {remark.code}: {remark.text}" for remark in answer.remarks]
    if remarks:
        SubElement(suite.element, "system-out").text = visible("\n".join(remarks))


@dataclass(frozen=True)
class _Suite:
    """JUnit test suite under construction; visible() replaces characters that XML does not allow."""

    element: Element
    name: str  # serial number of the drive, or else name of its preset

    @classmethod
    def begun(
        cls,
        root: Element,
        answer: AcceptAnswer,
        lot_sha256: str,
    ) -> _Suite:
        """Append a suite with properties, but without test cases, to root, and return the suite."""
        name = answer.serial or answer.preset.name
        element = SubElement(root, "testsuite", name=visible(name))
        place = SubElement(element, "properties")
        identity = {"serial": answer.serial, "preset": answer.preset.name, "status": answer.status}
        properties = {**identity, **provenance(answer), "lot_sha256": lot_sha256}
        for key, value in properties.items():
            # properties without a value are omitted
            if value is not None and value != "":
                SubElement(
                    place,
                    "property",
                    name=key,
                    value=visible(str(value)),
                )
        return cls(element=element, name=name)

    def add_case(
        self,
        label: str,
        outcome: str,
        *,
        message: str = "",
        kind: str = "",
        lines: Sequence[str] = (),
    ) -> None:
        """Append a test case.

        Args:
            label: name of the check.
            outcome: name of the JUnit element for the outcome.
            message: description of the outcome in one line.
            kind: type of a failure.
            lines: detailed description of the outcome; empty lines are omitted.
        """
        case = SubElement(
            self.element,
            "testcase",
            classname=visible(self.name),
            name=visible(label),
        )
        attributes = {key: visible(text) for key, text in (("message", message), ("type", kind)) if text}
        SubElement(case, outcome, attributes).text = visible("\n".join(filter(None, lines))) or None

    def add_error(self, status: str, error: ErrorRecord) -> None:
        """Append a test case for the error that prevented a result."""
        hint = f"hint: {error.hint}" if error.hint else ""
        explanation = f"what it means: hdassist explain {error.code}" if error.code else ""
        self.add_case(
            "no result",
            "error",
            message=f"{status}: {error.message.splitlines()[0]}",
            kind=error.code or "INTERNAL",
            lines=(error.message, hint, explanation),
        )

    def add_check(self, check: DecidedCheck) -> None:
        """Append the test case of a check; a verdict other than PASS is a failure and names the next action."""
        sentence = f"{check.verdict}: {_sentence(check)}"
        because = f"because: {check.reason}" if check.reason else ""
        # for PASS, the details are written as the output of the case
        if check.verdict == "PASS":
            self.add_case(
                check.label,
                "system-out",
                lines=(sentence, because),
            )
            return
        lines = (sentence, because, f"what to do: {_action(check)}", f"what it means: hdassist explain {check.code}")
        self.add_case(
            check.label,
            "failure",
            message=sentence,
            kind=str(check.verdict),
            lines=lines,
        )
