"""Reports of plans for a test of F'_ior, and the sheet for the test rig."""

from collections.abc import Iterator, Sequence

import numpy as np

from hdassist.belief.samples import ErrorBelief
from hdassist.drive.model.deviations import unknown_notes
from hdassist.features.planning import SEEN_SHARE, PlanChoice, PlannedTest
from hdassist.features.report import (
    Curve,
    CurveMark,
    Fact,
    Facts,
    Json,
    Lines,
    Report,
    Table,
    as_object,
    as_objects,
    attributes,
    csv_table,
    quantity_table,
    samples_object,
)
from hdassist.interface.terminal.words import again, more_draws, preset_argument
from hdassist.run.errors import Verdict
from hdassist.run.system import command_line

_LARGE_LINE = 0.1  # smallest share of the variance at which a component is named
_DRAWN_GROUPS = 36  # largest number of points in a plot, at which they do not overlap
_ENOUGH_WORDS = {Verdict.PASS: "yes", Verdict.FAIL: "no", Verdict.INCONCLUSIVE: "open"}


def _percent(share: float) -> str:
    return f"{100 * share:.0f}" if share >= 0.1 else f"{100 * share:.1f}"


def _test_words(name: str) -> str:
    """Return the name of a test on pages; name: its name in JSON, such as "record of 10 cam turns"."""
    words_of_json = {
        "record of": "recording of",
        "cam turn": "input revolution",
        "output turn": "output revolution",
        "both ways": "from both sides",
    }
    for json_word, page_word in words_of_json.items():
        name = name.replace(json_word, page_word)
    return name


_PLAN_QUANTITIES = quantity_table(
    "plan.tests",
    test_words=_test_words,
    percent_seen=_percent,
    enough=lambda judged: _ENOUGH_WORDS[judged.verdict],
    step_deg=lambda judged: 360 * judged.plan.step_turns,
)
_LINE_QUANTITIES = quantity_table("plan.lines", percent_seen=_percent)
_TEST_QUANTITIES = quantity_table("plan.run")
_LISTED_READINGS = 96  # largest number of readings listed on a sheet; a longer list is only in the file


def _plan_object(choice: PlanChoice, F_ior: Sequence[float]) -> Json:
    """Return the judged plans by the keys of the JSON result.

    F_ior: 5th percentile, median and 95th percentile of F'_ior [arcsec] over the drives.
    """
    drives = choice.drives
    return {
        "M_g_Nm": choice.M_g,
        "limit_arcsec": choice.drive.limit(choice.M_g),
        "F_ior_arcsec": dict(
            zip(
                ("p5", "p50", "p95"),
                F_ior,
                strict=True,
            )
        ),
        "beyond_limit": drives.beyond and attributes(drives.beyond, "value", "low", "high"),
        "verdict": str(choice.verdict),
        "plans": as_objects(_PLAN_QUANTITIES, choice.judged),
        "enough": [judgement.plan.name for judgement in choice.enough],
        "over_positions": as_objects(_PLAN_QUANTITIES, choice.over_positions),
        "lines": as_objects(_LINE_QUANTITIES, choice.lines),
        "carried_out": as_object(_TEST_QUANTITIES, choice.test),
        "samples": samples_object(choice.samples),
        "seed": drives.seed,
    }


def plan_report(choice: PlanChoice, record: str) -> Report:
    """Return the report on tests of F'_ior: which are sufficient, and the share of F'_ior that they capture.

    choice: judged plans.
    record: file that the next command measures.
    """
    drive = choice.drive
    limit = drive.limit(choice.M_g)
    F_ior = _F_ior_range(choice)
    answer = _answer(choice)
    head = f"{drive.name}, test at {choice.M_g:g} N·m"
    if limit:
        head += f", limit {limit:g}″"
    return Report(
        command="plan",
        drive=drive,
        head=head,
        verdict=answer,
        why=tuple(_why(choice, F_ior)),
        blocks=(
            Table.by_row("", _PLAN_QUANTITIES[: 7 if limit else 5], choice.judged),
            Facts.of(_facts(choice, record)),
            seen_curve(choice),
        ),
        details=(
            Table.by_row(
                f"spectral lines of the error in {_test_words(choice.judged[0].plan.name)}; share: of the mean square",
                _LINE_QUANTITIES,
                choice.lines,
            ),
        ),
        certificate=choice.certificate,
        values=_plan_object(choice, F_ior),
        csv=csv_table(drive.name, _PLAN_QUANTITIES, choice.judged),
        line=answer,
        warnings=(*drive.origin.warnings, *(choice.samples.remarks if choice.samples else unknown_notes(drive))),
        exit_code=choice.verdict.exit_code,
    )


def _F_ior_range(choice: PlanChoice) -> tuple[float, float, float]:
    """Return the 5th percentile, median and 95th percentile of F'_ior [arcsec] over the drives of a choice."""
    if choice.samples and not choice.drives.travel:  # other pages show the same range
        belief = ErrorBelief.of(choice.samples, choice.drive.operation.M_g.index(choice.M_g))
        return belief.p5, belief.p50, belief.p95
    return choice.drives.percentiles(choice.drives.F_ior_arcsec)


def _sufficient_tests(choice: PlanChoice) -> str:
    """Return the names of the sufficient tests as text; empty if there are none."""
    return " or ".join(_test_words(judged.plan.name) for judged in choice.enough)


def _unsure_tests(choice: PlanChoice) -> list[str]:
    """Return the names of the tests for which the samples do not decide whether they are sufficient."""
    return [_test_words(judged.plan.name) for judged in choice.judged if judged.verdict is Verdict.INCONCLUSIVE]


def _answer(choice: PlanChoice) -> str:
    """Return a text on whether the requested test is sufficient, or else with the names of the sufficient tests."""
    if not choice.asked and choice.verdict is Verdict.FAIL:
        return "none of these tests is sufficient"
    word = {Verdict.PASS: "sufficient", Verdict.FAIL: "not sufficient"}.get(choice.verdict, "possibly sufficient")
    if choice.asked:
        tests = _test_words(choice.judged[0].plan.name)
    else:
        tests = _sufficient_tests(choice) or " or ".join(_unsure_tests(choice))
    return f"{word}: {tests}"


def _facts(choice: PlanChoice, record: str) -> Iterator[Fact]:
    """Yield facts about the test, each as a label and a text; record: file that the next command measures."""
    lines = [line for line in choice.lines if not line.seen_as and line.variance_share >= _LARGE_LINE]
    often = ", ".join(f"{line.per_output_turn:g} times ({_percent(line.variance_share)} %)" for line in lines)
    blind = f"to components that repeat {often} per output revolution (share of the mean square of the error)"
    yield "blind", blind if lines else ""
    yield "sufficient", _sufficient_tests(choice) if choice.asked else ""
    yield "duration", _duration(choice.test) if choice.asked or choice.drive.limit(choice.M_g) else ""
    yield "verdict", _verdicts(choice.test)
    yield "open", more_draws(choice.samples) if choice.samples and _unsure_tests(choice) else ""
    travel = ["--travel", f"{360 * choice.drives.travel:.6g}"] if choice.drives.travel else []
    yield "next", command_line(["hdassist", "measure", record, "--drive", preset_argument(choice.drive), *travel])


def _why(choice: PlanChoice, F_ior_arcsec: tuple[float, float, float]) -> Iterator[str]:
    first = choice.judged[0]
    drives = choice.drives
    wrong = choice.drives.demands.wrong
    low, _, high = map(_percent, first.seen)
    F_ior = ("{0:.1f} to {2:.1f}" if choice.samples or drives.travel else "{0:.1f}").format(*F_ior_arcsec)
    of_travel = f" over {360 * drives.travel:.4g}° of travel" if drives.travel else ""
    verb = "captures" if first.plan.is_record else "capture"
    yield f"{_test_words(first.plan.name)} {verb} {low} to {high} % of F'_ior ({F_ior}″){of_travel}"
    risk = first.false_pass
    beyond = drives.beyond
    if not risk or not beyond:
        share = f"{100 * SEEN_SHARE:g} % of F'_ior in {100 * (1 - wrong):g} % of cases"
        yield f"A sufficient test captures {share} (no limit set)."
        return
    exceeding = f"{_percent(beyond.value)} % of drives exceed the limit"
    if not wrong < beyond.value < 1 - wrong and all(judged.verdict is Verdict.PASS for judged in choice.judged):
        yield f"{exceeding}, so any of these tests is sufficient for a decision."
    else:
        interval = f"{_percent(risk.value)} % ({_percent(risk.low)} to {_percent(risk.high)})"
        yield f"{exceeding}; false PASS: {interval}, at most {100 * wrong:g} % allowed."


def seen_curve(choice: PlanChoice) -> Curve:
    """Return the curve of the share of F'_ior captured in 95 of 100 cases over the number of positions.

    A point of the curve is the lowest share in a group of adjacent numbers of positions.
    """
    points = {judgement.plan.readings: 100 * judgement.seen[0] for judgement in choice.over_positions}
    groups = np.array_split([*points], min(_DRAWN_GROUPS, len(points)))
    group_words = f"; lowest of each {len(groups[0])} adjacent numbers" if len(groups[0]) > 1 else ""
    enough_readings = [judgement.plan.readings for judgement in choice.enough if not judgement.plan.is_record]
    return Curve(
        np.array([group.mean() for group in groups]),
        np.array([min(points[N] for N in group) for group in groups]),
        x_label="positions per output revolution",
        y_label=f"F'_ior captured in 95 of 100 cases, %{group_words}",
        marks=tuple(CurveMark(x=N, y=points[N], words="enough", kind="target") for N in enough_readings),
        rows=6,
    )


def _duration(test: PlannedTest) -> str:
    """Return the number of readings, the duration and the standard uncertainty of a test as text."""
    unsure = f", u = {test.uncertainty_arcsec:.2g}″" if test.uncertainty_arcsec else ""
    return (
        f"{_test_words(test.judged.plan.name)}: {test.readings} readings, {test.minutes:.0f} min with warm-up{unsure}"
    )


def _verdicts(test: PlannedTest) -> str:
    """Return a text on the shares of the verdicts of accept after a test; empty without a limit."""
    if test.passing is None or test.failing is None:
        return ""
    passing = test.passing.value
    failing = test.failing.value
    undecided = _percent(1 - passing - failing)
    shares = f"PASS {_percent(passing)} %, FAIL {_percent(failing)} %, INCONCLUSIVE {undecided} % of drives"
    rule = f"PASS up to {test.passes_up_to:.1f}″, FAIL beyond {test.fails_beyond:.1f}″"
    return f"by the decision rule of accept, {rule}: {shares}"


def approach_csv(choice: PlanChoice) -> str:
    """Return the text of the file to fill in during a test: comments on the plan, then a row for each reading."""
    test = choice.test
    shares = " ".join(f"{share:.3f}" for share in test.judged.seen)
    rows = [f"{minute:.1f},{target:.6g},{side:g}," for minute, target, side in zip(*test.approaches, strict=True)]
    return (
        "\n".join(
            [
                f"# plan: {choice.drive.name}, {_test_words(test.judged.plan.name)}",
                f"# torque: {choice.M_g:.15g}",
                f"# sees: {shares}",
                f"# uncertainty: {test.uncertainty_arcsec:.4g}",
                "# write the output angle of each reading after the last comma of its row, in deg; or name that column",
                "# deviation_arcsec and write actual minus target angle, counter-clockwise positive",
                "minute,target_deg,side,actual_deg",
                *rows,
            ]
        )
        + "\n"
    )


def sheet_report(
    choice: PlanChoice,
    serial: str = "",
    file: str = "",
) -> Report:
    """Return the sheet of a test for the test rig.

    choice: judged plans.
    serial: serial number of the drive.
    file: file with the positions, empty if none is written.
    """
    drive = choice.drive
    return Report(
        command="plan",
        drive=drive,
        head=f"{drive.name}: test of F'_ior at {choice.M_g:g} N·m, {_duration(choice.test)}",
        verdict="",
        blocks=(
            Facts((("drive", drive.name), ("serial", serial), ("date, name", ""), ("rig, encoders", ""))),
            Lines("procedure", _procedure(choice), "[ ]"),
            Facts((("temperature at start, °C", ""), ("temperature at end, °C", ""))),
            Lines("evaluation", _evaluation(choice, file)),
            _readings(choice.test, file),
        ),
        certificate=choice.certificate,
    )


def _procedure(choice: PlanChoice) -> tuple[str, ...]:
    """Return the steps of a test, which the operator ticks off."""
    test = choice.test
    run = test.run
    lead_deg = f"{360 * run.lead_turns / test.ratio:.3g}°"  # output angle over which the backlash is taken up
    sides = "from below"
    if test.judged.plan.both:
        sides = "from below in increasing order, then from above in decreasing order"
    times = "time" if run.repeats == 1 else "times"
    return (
        f"Load the output with a constant torque of {choice.M_g:g} N·m, as in use (positive: counter-clockwise).",
        f"Warm up for {run.warm_up_min:g} min at an input speed of {run.cam_rpm:g} rpm. Record the temperature.",
        f"Take any output angle as 0. To take up the backlash, first move back by {lead_deg}, and "
        f"move on by {lead_deg} "
        "before each reversal.",
        f"Approach each position {sides}, {run.repeats} {times}. Never overshoot a position.",
        f"Wait {run.dwell_s:g} s, then read the output. Record the temperature again at the end.",
    )


def _evaluation(choice: PlanChoice, file: str) -> tuple[str, ...]:
    """Return the rules to evaluate the readings of a test; file: file with the positions, empty if there is none."""
    low, middle, high = map(_percent, choice.test.judged.seen)
    rules = [
        "Average repeated readings. The result is the largest minus the smallest deviation of "
        "approaches from one side.",
        f"The test captures {low} to {high} % of F'_ior (median {middle} %).",
        _verdicts(choice.test),
    ]
    if file:
        measured = f"{choice.M_g:.15g}={file}"
        budget = "encoder=U,coupling=U,reseating=U,temperature=U"
        rules.append(again("accept", choice.drive, "--measured", measured, "--measured-only", "--budget", budget))
    return tuple(filter(None, rules))


def _readings(test: PlannedTest, file: str) -> Table | Facts:
    """Return the table of readings to fill in, or a reference to the file if there are too many readings."""
    minutes, targets_deg, sides = test.approaches
    if len(targets_deg) > _LISTED_READINGS:
        return Facts((("readings", f"the list is in {file or 'the file of --approach'}"),))
    rows = []
    for number, (minute, target_deg, side) in enumerate(
        zip(
            minutes,
            targets_deg,
            sides,
            strict=True,
        ),
        start=1,
    ):
        from_side = "below" if side > 0 else "above"
        rows.append((f"{number}", f"{minute:.0f}", f"{target_deg:.5g}", from_side, "", ""))
    return Table("readings", ("no.", "minute", "position, °", "from", "read, °", "deviation, ″"), tuple(rows))
