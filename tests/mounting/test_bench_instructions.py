"""What a fitter is told: one destination, one result, one number, in whatever order values are given."""

from __future__ import annotations

import itertools
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.features.mounting.advice import Advice, advise, advise_after
from hdassist.features.mounting.positions import mounting_curve, seat_positions
from hdassist.features.mounting.posterior import HoleSamples, Trial, TrialSetup
from hdassist.features.report import Paragraph
from hdassist.interface.explorer.panes import next_text
from hdassist.interface.pages.mount import mount_report
from hdassist.interface.pages.report import card_html, card_text
from hdassist.run.errors import Verdict
from hdassist.run.run import UNCHECKED
from tests.helpers.advices import TRIALS, advice_of, card
from tests.helpers.process import SMALL, TINY, in_a_line, run
from tests.mounting.drives import HOLES, POSITIONS, SETUP, synthetic, told

AT_4 = told("operation.M_g=[4]")
TURN = 2 * np.pi * np.arange(HOLES) / HOLES


def best_in(hole: int, holes: int = HOLES) -> list[float]:
    """F'_ior in each hole [arcsec], once around the seat, the least in one of them."""
    return [float(30 - 10 * np.cos(2 * np.pi * (k - hole) / holes)) for k in range(holes)]


def once_around() -> HoleSamples:
    """Drives whose F'_ior goes once around the seat by a third."""
    turn = TURN - 2 * np.pi * np.linspace(0, 1, 64, endpoint=False)[:, None]
    return synthetic(24 * np.exp(0.3 * np.cos(turn)))


def measured_in(samples: HoleSamples, *holes: int, row: int = 10) -> list[Trial]:
    """Values of one of the drives in some holes."""
    return [Trial(POSITIONS[hole], float(samples.F_ior_arcsec[row, hole])) for hole in holes]


def tried_best_in(hole: int) -> Advice:
    """An advice after trials of the drive that is best in a hole."""
    samples, row = once_around(), round((hole - HOLES / 2) * 64 / HOLES) % 64
    return advise_after(AT_4, measured_in(samples, 0, 2, 4, 6, 8, 10, row=row), SETUP, samples=samples)


# The destination


@pytest.mark.thorough
@pytest.mark.parametrize("tried", [False, True])
@pytest.mark.parametrize(
    ("hole", "turn"),
    [(9, "3 holes (90°) clockwise"), (3, "3 holes (90°) counter-clockwise"), (6, "6 holes (180°) counter-clockwise")],
)
def test_the_destination_comes_first_and_nothing_contradicts_it(hole: int, turn: str, tried: bool) -> None:
    advice = tried_best_in(hole) if tried else advice_of(best_in(hole))
    words = f"Put the circular spline in hole {hole}. That is {turn} from hole 0, seen from the wave generator side."
    report, paper = mount_report(advice, 0), card(advice, trials=advice.trials)
    assert report.why[0].startswith(words) and paper.instruction.text.startswith(words)
    assert in_a_line(card_text(paper)).count(turn) == 2  # as the instruction and among the checks
    for text in (*report.why, card_text(paper)):
        assert "last trial" not in text and "stands" not in text
    assert report.values["hole"] == hole and report.line == f"{hole}"
    destination = report.values["destination"]
    assert (destination["hole"], destination["from"], destination["fixed"]) == (hole, "hole 0", "rigid")
    assert f"{destination['turn_holes']} holes ({destination['turn_deg']:g}°) {destination['direction']}" == turn


@pytest.mark.parametrize("language", ["en", "ru"])
def test_card_drawing_marks_the_destination_and_its_letters_are_unique(language: str) -> None:
    for hole in (0, 9):  # left where it is, or turned
        paper = card(advice_of(best_in(hole)), language, trials=TRIALS)
        drawing, legend = card_text(paper).split(paper.seat.legend[:20])[0], paper.seat.legend
        assert f"[{hole}]" in drawing and f"[{hole}]" in legend
        assert {"best", "worst", "now"} == {place.kind for place in paper.seat.places}
        letters = [mark.letter.lower() for mark in (*paper.seat.places, *paper.seat.pointers)] + [paper.seat.barred]
        assert len(letters) == len(set(letters))
        filled = re.findall(r'data-hole="(\d+)">\s*<circle [^>]*fill="#000"', card_html(paper))
        assert filled == [f"{hole}"]


def test_the_explorer_names_the_destination_first() -> None:
    from hdassist.interface.explorer.asking import Known

    advice = tried_best_in(9)
    known = replace(Known(), advice=advice, report=mount_report(advice, 0))
    assert next_text(known).startswith("Put the circular spline in hole 9. That is 3 holes (90°) clockwise from hole 0")


@pytest.mark.parametrize("fixed", ["rigid", "flexspline"])
def test_a_mirrored_drive_has_the_mirrored_destination(fixed: str) -> None:
    """Deviations and torque in a mirror: the best hole is as far from hole 0 the other way."""
    drive = load_preset(TINY, [f"mounting.fixed={fixed}", "tolerances.e_hg=40", "mounting.holes=6"])
    names = [f"phases.{name}" for name in type(drive.phases).model_fields]
    phases = {path: -drive.number(path) for path in names if drive.value(path) is not None}
    mirrored = drive.with_values(phases)
    positions = seat_positions(drive)
    one = mounting_curve(drive, (4.0,), positions, run=UNCHECKED)
    other = mounting_curve(mirrored, (-4.0,), positions, run=UNCHECKED)
    back = [-k % 6 for k in range(6)]
    assert other.F_ior_arcsec[0] == pytest.approx(one.F_ior_arcsec[0, back], rel=1e-6)


# One result of --verify


def result_of(advice: Advice) -> tuple[object, ...]:
    """Verdict and hole, wherever they are shown."""
    report = mount_report(advice, 0)
    verification = report.values["verification"]
    word, hole = re.fullmatch(r"([A-Z ]+), hole (\d+)", report.verdict).groups()
    holes = {
        int(hole), int(report.line), report.values["hole"], report.values["recommended"]["hole"],
        report.values["best_bet"]["hole"], verification["position"]["hole"], report.values["destination"]["hole"],
    }  # fmt: skip
    assert len(holes) == 1, holes
    assert word == verification["verdict"].replace("_", " ")
    table = report.blocks[0]
    assert [row[1] for row in table.rows if row[0] == word.lower()] == [f"{int(hole)}"]
    assert "best" not in [row[0] for row in table.rows]
    return word, int(hole), report.exit_code, report.values["word"], report.values["order"]


def test_the_card_states_the_interval_of_the_verification() -> None:
    samples = once_around()
    tried = measured_in(samples, 0, 4, 8, 6, 7)
    before = advise_after(AT_4, tried, SETUP, samples=samples)
    predicted = before.predicted_outcome
    outcome = Trial(before.chosen.rotation_deg, 20.0)
    checked = advise_after(AT_4, tried, SETUP, outcome=outcome, samples=samples).verification
    assert predicted.low_arcsec == pytest.approx(checked.low_arcsec, rel=1e-9)
    assert predicted.high_arcsec == pytest.approx(checked.high_arcsec, rel=1e-9)
    card_lines = card(before, trials=before.trials).chance.lines
    words = (f"{predicted.low_arcsec:.1f} to ", f"{predicted.high_arcsec:.1f}″, also measure")
    assert any(word in card_lines[1] for word in words)
    assert f"--verify h{before.chosen.hole}=VALUE" in card_lines[1]
    carded = mount_report(replace(before, value=None), 0, carded=True)
    assert dict(carded.blocks[1].rows)["next"].endswith(f"--verify h{before.chosen.hole}=F_IOR")


@pytest.mark.thorough
def test_a_verification_has_one_result() -> None:
    samples = once_around()
    tried = measured_in(samples, 0, 4, 8, 6, 7)
    truth = samples.F_ior_arcsec[10]

    def verified(hole: int, value: float, *more: Trial) -> Advice:
        outcome = Trial(POSITIONS[hole], float(value))
        return advise_after(AT_4, [*tried, *more], SETUP, outcome=outcome, samples=samples)

    least = int(np.argmin(truth))
    assert result_of(verified(least, truth[least])) == ("KEEP", least, 0, "LEAVE", "leave")
    bad = int(np.argmax(truth))
    word, hole, code, *_ = result_of(verified(bad, truth[bad]))
    assert (word, code) == ("GO BACK", Verdict.FAIL.exit_code) and truth[hole] < truth[bad]
    again = verified(least, 45.0)  # where 45 contradicts the value before
    assert again.suspected is again.verification.trial
    assert result_of(again) == ("MEASURE AGAIN", least, Verdict.INCONCLUSIVE.exit_code, "BEST_BET", "leave")
    assert mount_report(again, 0).values["next"]["hole"] == least
    # also if another hole is better by the values before: the wheel moves only after a second reading
    verdicts = {}
    for factor in (0.6, 1.0, 1.5, 1.8, 2.2):
        doubtful = verified(bad, factor * truth[bad])
        is_suspected = doubtful.suspected is doubtful.verification.trial
        verdicts[factor] = (is_suspected, doubtful.verification.verdict)
    assert verdicts[1.0] == (False, "GO_BACK")
    assert {verdict for is_suspected, verdict in verdicts.values() if is_suspected} == {"MEASURE_AGAIN"}


@pytest.mark.thorough
def test_the_verification_of_a_command_is_one_result_too() -> None:
    few = ("mount", SMALL, "--torque", "4", "--draws", "8", "h0=73", "h4=18.2", "h8=25", "h3=19.3", "--verify", "h4=70")
    done, quiet = run(*few, "--json"), run(*few, "-q")
    result = json.loads(done.stdout)
    assert done.returncode == quiet.returncode == result["exit_code"]
    assert quiet.stdout == f"{result['hole']}\n"
    assert result["hole"] == result["verification"]["position"]["hole"] == result["destination"]["hole"]


# ANY HOLE


def test_any_hole_names_none() -> None:
    advice = advice_of([20.0] * 12)
    report, paper = mount_report(advice, 0), card(advice)
    assert (advice.word, report.verdict, report.line) == ("ANY_HOLE", "ANY HOLE", "any")
    assert report.values["word"] == "ANY_HOLE" and report.values["destination"] is None
    for where in (report.values, report.values["recommended"], report.values["best_bet"]):
        assert where["hole"] is None and where["rotation_deg"] is None
    assert "hole 0" not in report.why[0] and "any hole" in report.why[0]
    assert paper.instruction.text == "The circular spline may be put in any hole."
    assert [place.kind for place in paper.seat.places] == ["now"]
    assert "[0]" not in card_text(paper)
    assert not re.search('data-hole="[^>]*>\\s*<circle [^>]*fill="#000"', card_html(paper))
    assert (
        "in any of the holes 2, 3"
        in mount_report(advice_of([20.0] * 2, rotations=[60.0, 90.0], overrides=("mounting.allowed=[2,3]",)), 0).why[0]
    )


def test_limit_selects_the_hole_that_meets_it_among_equal_losses() -> None:
    advice = advice_of([20.1, 20.0, 20.1])
    limited = replace(advice, decision=replace(advice.decision, room_arcsec=(20.05,)))
    assert (limited.word != "ANY_HOLE", limited.chosen.rotation_deg) == (True, 120.0)


# A value that is probably misread


def test_probable_reading_error_is_measured_again_before_any_other_hole() -> None:
    samples = once_around()
    tried = measured_in(samples, *range(0, 12, 2), 1, 5, 9)
    wrong = replace(tried[3], F_ior_arcsec=0.6 * tried[3].F_ior_arcsec)
    others = [each for each in tried if each is not tried[3]]
    advice = advise_after(AT_4, [*others, wrong], SETUP, samples=samples)
    assert advice.suspected == wrong
    report = mount_report(advice, 0)
    assert report.values["next"] == {
        "hole": 6, "rotation_deg": 180.0, "gain_arcsec": None, "M_g_Nm": SETUP.M_g, "repeats_misread": True
    }  # fmt: skip
    assert report.why[0].startswith("Repeat the measurement for hole 6. ")
    assert not any("Stop measuring" in words or "→" in words for words in report.why)
    (facts,) = [block for block in report.blocks if type(block).__name__ == "Facts"]
    assert "h6=F_IOR" in dict(facts.rows)["next"]
    paper = card(advice, trials=advice.trials)
    assert paper.condition.text.startswith("Before bolting, repeat the measurement for hole 6: ")
    assert [block for block in paper.blocks if isinstance(block, Paragraph)] == [paper.condition, paper.instruction]
    assert "hole 6 again" not in paper.instruction.text
    repeated = advise_after(AT_4, [*others, wrong, tried[3]], SETUP, samples=samples)
    assert repeated.suspected == wrong and repeated.to_repeat is None


# One number


@pytest.mark.thorough
def test_the_order_of_values_changes_no_digit() -> None:
    samples = once_around()
    tried = [*measured_in(samples, 0, 4, 8), Trial(60.0, 21.0, noise_arcsec=0.2), Trial(60.0, 20.5)]
    every = [
        mount_report(advise_after(AT_4, list(some), SETUP, samples=samples), 0).values
        for some in itertools.islice(itertools.permutations(tried), 0, None, 17)
    ]
    assert all(_same(values, every[0]) for values in every)


def _same(one: object, other: object) -> bool:
    """Whether two results have the same digits."""
    return repr(one) == repr(other)


@pytest.mark.thorough
def test_a_torque_for_all_values_is_the_torque_of_each() -> None:
    drive = told("operation.M_g=[1, 4]")
    values = [(0.0, 30.0), (120.0, 18.0), (240.0, 25.0)]
    for_all = advise_after(drive, [Trial(*each) for each in values], TrialSetup(4.0, 0.5), draws=2)
    own = [Trial(*each, M_g=4.0) for each in values]
    each_one = advise_after(drive, own, TrialSetup(1.0, 0.5, others=(4.0,)), draws=2)
    assert np.array_equal(each_one.decision.F_ior_arcsec, for_all.decision.F_ior_arcsec)
    assert each_one.value == for_all.value


def test_a_decimal_comma_is_a_point() -> None:
    from hdassist.features.mounting.posterior import read_trial

    assert read_trial("h0=46,3", 12) == Trial(0.0, 46.3)
    assert read_trial("h4@3,4=27", 12) == Trial(120.0, 27.0, M_g=3.4)
    assert read_trial("22,5=27", 16) == Trial(22.5, 27.0)


# The card


@pytest.mark.thorough
def test_card_lines_never_break_before_a_unit_or_print_backslashes() -> None:
    for language, name in itertools.product(("en", "ru"), range(1, 30)):  # wherever the line ends
        tried = [Trial(0.0, 20.0, M_g=3.4, noise_arcsec=0.1, file="x" * name), *(replace(t, M_g=44.5) for t in TRIALS)]
        text = card_text(card(advice_of(), language, trials=tried))
        assert "3.4 N·m" in text or "3,4 Н·м" in text
        assert not re.search(r"^ *(N·m|Н·м)", text, flags=re.M)
        assert "\\" not in text


def test_recording_value_is_rounded_by_uncertainty_and_names_its_file() -> None:
    tried = [Trial(0.0, 28.794132, noise_arcsec=0.031, file="/rig/day 1/run4.csv"), Trial(120.0, 17.3)]
    foot = "\n".join(card(advice_of(), trials=tried).foot.lines)
    assert "hole 0: 28.79″ (run4.csv)" in foot and "hole 4: 17.3″" in foot and "/rig" not in foot


# Numbers of another torque, and of one sample


@pytest.mark.thorough
def test_gain_of_a_value_is_computed_at_the_measured_torque() -> None:
    drive = load_preset(SMALL, ["operation.M_g=[4]", "uncertainty.phases.phi_hb=90", "uncertainty.tolerances.e_hb=20"])
    positions = seat_positions(drive)
    here, there = (advise(drive, positions, setup=TrialSetup(M_g), draws=8) for M_g in (4.0, 10.0))
    assert here.value and there.value
    assert np.array_equal(here.decision.F_ior_arcsec, there.decision.F_ior_arcsec)
    assert there.value.M_g == 10.0 and there.value.F_ior_arcsec != here.value.F_ior_arcsec
    both = load_preset(SMALL, [*drive.origin.overrides, "operation.M_g=[4, 10]"])
    assert advise(both, positions, setup=TrialSetup(10.0), draws=8).samples.torques == there.samples.torques
    page = mount_report(there, 0).why
    assert any("at 10 N·m in hole 0" in words and "F'_ior at 4 N·m expected in the hole" in words for words in page)


def test_one_sample_is_no_nominal_value() -> None:
    drive = load_preset(SMALL, ["operation.M_g=[4]", "uncertainty.phases.phi_hb=90"])
    positions = seat_positions(drive)
    none, one = (advise(drive, positions, draws=draws) for draws in (0, 1))
    if one.samples is None:
        assert one.fault
        assert one.decision.F_ior_arcsec == pytest.approx(none.decision.F_ior_arcsec, abs=0.02)  # one is searched
    else:
        assert one.decision.is_sampled
