"""The assembly card: its facts, both languages, every kind of drive."""

from __future__ import annotations

import re
from dataclasses import asdict, replace
from html.parser import HTMLParser
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from hdassist import __version__
from hdassist.belief.predicted import MeasuredBeside, beyond_words
from hdassist.drive.model.deviations import Unknown
from hdassist.features.mounting.advice import Advice
from hdassist.features.mounting.posterior import Trial
from hdassist.interface.pages.card import Card, instruction, seat_of, warnings_of
from hdassist.interface.pages.mount import mount_warnings
from hdassist.interface.pages.report import CENTRE, HOLE_CIRCLE, card_html, card_text
from hdassist.interface.terminal.plot import seat_in_characters
from hdassist.interface.terminal.words import Texts, languages, texts
from hdassist.run.errors import UsageError
from tests.helpers.advices import MADE, TRIALS, advice_of, card, cards, crowded, sampled

CARDS = cards()
SVG = "{http://www.w3.org/2000/svg}"


UNKNOWN_TURN = replace(
    advice_of(overrides=("phases.phi_hb=unknown", "phases.xi_b=unknown")),
    unknown=(Unknown("phases.phi_hb", 0.0, 360.0, "any direction"),),
)
UNSURE = replace(CARDS["not sure"], unknown=(Unknown("harmonics.a_g2", 0.0, 3.0, "assumed"),))


def strings(value: object) -> list[str]:
    if isinstance(value, str):
        return [value]
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list | tuple) else ()
    return [text for part in parts for text in strings(part)]


def everything(advice, language: str = "en", serial: str = "17") -> str:
    return "\n".join(strings(asdict(card(advice, language, serial))))


def drawing_of(made: Card) -> ElementTree.Element:
    """The drawing on a card in HTML."""
    (svg,) = re.findall("<svg.*</svg>", card_html(made), re.DOTALL)
    return ElementTree.fromstring(svg)


def test_the_facts():
    made = card(CARDS["plain"], serial="17-042")
    assert dict(made.subject.rows)["drive"] == "small"
    assert dict(made.subject.rows)["serial number"] == "17-042"
    assert dict(made.subject.rows)["teeth"] == "flexspline 60, circular spline 62; module 0.5 mm"
    assert made.instruction.text == instruction(CARDS["plain"], gains=False)
    assert made.torques.rows == (("1", "28.09", "14.94", "-47 %", ""), ("10", "8.09", "4.52", "-44 %", ""))
    assert "the circular spline is in hole 8: 4 holes (120°) clockwise from hole 0" in made.checks.lines
    assert made.chance.title == "Probability: TURN"
    assert made.chance.lines == (
        "The choice is made at nominal values; its probability is unknown.",
        "If F'_ior is larger than predicted, also measure it for hole 0, hole 4, hole 8, and enter all values in "
        "hdassist mount.",
        "Inputs: 0 uncertain, 50 given in the preset, 0 identified from measurements.",
    )
    assert made.warnings.lines == ()
    digest = CARDS["plain"].drive.origin.sha256[:12]
    assert made.foot.lines[1] == f"hdassist {__version__}; preset small, sha256 {digest}; card made 2026-03-09"
    assert "one measurement" in made.foot.lines[0]


def test_card_mark_turns_with_the_wheel_unlike_the_wave_generator():
    made = card(CARDS["plain"])  # xi_b 90, phi_hb 0, turned by 240
    assert made.directions.lines == (
        "p: mark now, 90°", "q: mark after assembly, 330°", "e: eccentricity of the wave generator e_hb, 0°",
    )  # fmt: skip
    assert dict(made.subject.rows)["mark"] == "the phase xi_b of the deviation F'_i2 of the circular spline"
    other = card(CARDS["flexspline"])  # xi_g 0, phi_hg 0
    assert other.directions.lines == (
        "p: mark now, 0°", "q: mark after assembly, 240°", "e: eccentricity of the wave generator e_hg, 0°",
    )  # fmt: skip
    assert dict(other.subject.rows)["mark"] == "high spot of the radial runout of the flexspline"
    assert other.instruction.text.startswith("Put the flexspline in hole 8. That is 4 holes (120°) clockwise")
    without = card(advice_of(overrides=("mounting.fixed=flexspline",)))  # e_hg is 0: no hole is better
    assert without.directions.lines == ("p: mark now, 0°",)
    assert dict(card(CARDS["free"]).subject.rows)["mark"] == "largest cumulative pitch deviation of the circular spline"


def test_a_measured_wheel_is_marked_at_its_tooth():
    made = card(CARDS["measured"])  # turned by 240
    assert dict(made.subject.rows)["mark"] == "tooth 17 of the measured circular spline"
    assert made.directions.lines[:2] == ("p: mark now, 33°", "q: mark after assembly, 273°")
    assert made.foot.lines[2] == "measured pitch deviations: circular spline, wheel.csv, sha256 0123456789ab"
    assert len(made.warnings.lines) == 2


def test_a_wheel_that_is_left_stays_on_its_hole():
    made = card(CARDS["leave"])
    assert made.instruction.text == "Leave the circular spline in hole 0, where it is now."
    assert made.torques.heads == ("torque, N·m", "hole 0, ″", "measured, ″")
    assert made.torques.rows == (("1", "10.00", ""),)
    assert made.directions.lines[0] == "q: mark now and after assembly, 90°"
    assert [p.kind for p in made.seat.places] == ["worst", "now", "best"]
    assert not [text for text in made.checks.lines if "hole" in text]
    unsure = card(CARDS["not sure"])
    assert unsure.instruction.text == "Leave the circular spline in hole 0, where it is now."
    assert len(unsure.chance.lines) == 3


def test_a_card_asks_for_no_hole_that_was_measured() -> None:
    """With all that is worth it measured, the value after bolting is what is left to enter."""
    in_hole_0 = TRIALS[:1]
    wrong = card(CARDS["sampled"], trials=in_hole_0).chance.lines[1]
    assert wrong.startswith("After bolting, measure F'_ior at 1 N·m, and run hdassist mount with all values and ")
    assert "--verify h8=VALUE. Predicted: " in wrong
    elsewhere = card(CARDS["sampled"], trials=TRIALS[1:2]).chance.lines[1]
    assert elsewhere.endswith("″, also measure it for hole 0.")


def test_a_free_angle_has_degrees_and_no_holes():
    made = card(CARDS["free"])
    assert made.instruction.text.startswith(
        "Turn the circular spline to 245.3°. That is 114.7° clockwise from 0°, seen"
    )
    assert "the circular spline is at 245.3°: 114.7° clockwise from 0°" in made.checks.lines
    assert made.seat.holes == ()
    assert "hole" not in re.sub("whole", "", everything(CARDS["free"])).replace("mounting.holes", "")


def test_holes_that_are_not_allowed():
    made = card(CARDS["allowed"])
    assert [h.number for h in made.seat.holes if h.usable] == [2, 3, 9]
    assert made.seat.legend.endswith("; x not allowed")
    assert seat_in_characters(made.seat).count("x") == 9
    drawn = drawing_of(made)
    crossed = [g.get("data-hole") for g in drawn.iter(f"{SVG}g") if g.find(f"{SVG}path") is not None]
    assert crossed[1:] == ["0", "1", "4", "5", "6", "7", "8", "10", "11"]  # the first is the drawing


def test_card_states_the_probability_of_its_hole_without_field_names():
    advice = CARDS["sampled"]
    said, wrong, inputs = card(advice).chance.lines
    assert advice.word == "TURN"
    assert "that hole 8 is better than hole 0 by more than 1 %, over all uncertain inputs: 100 % (" in said
    assert inputs.startswith("Inputs: 3 uncertain, ")
    high = advice.decision.quantile(0.95, advice.decision.best)[0]
    assert wrong.startswith(f"If F'_ior at 1 N·m exceeds {high:.1f}″ after bolting, also measure it for hole 0, ")
    unsure, word = card(UNSURE), UNSURE.decision.probability.value
    assert (UNSURE.word, unsure.chance.title) == ("BEST_BET", "Probability: BEST BET")
    assert (
        f"other position is better than hole 0 by more than 1 %, over all uncertain inputs: {100 * word:.0f} % ("
        in unsure.chance.lines[0]
    )
    assert card(CARDS["any"]).chance.lines[0] == "According to the known data, no hole is better than another."
    for each in (advice, UNSURE, UNKNOWN_TURN):
        changed_by_hand = ", ".join(each.drive.origin.overrides)
        assert not re.search(r"\b(tolerances|phases|gears)\.", everything(each).replace(changed_by_hand, ""))


@pytest.mark.parametrize("first", [0.0, 75.0])
def test_the_drawing_is_right(first):
    advice = advice_of(overrides=(f"mounting.first_hole={first:g}", "phases.xi_b=260", "phases.phi_hb=40"))
    drawn = drawing_of(card(advice))

    def direction(x: object, y: object) -> tuple[float, float]:
        right, up = float(str(x)) - CENTRE[0], CENTRE[1] - float(str(y))
        return float(np.degrees(np.arctan2(up, right)) % 360), float(np.hypot(right, up))

    holes = {g.get("data-hole"): g[0] for g in drawn.iter(f"{SVG}g") if g.get("class") == "hole"}
    assert len(holes) == 12
    for number, hole in holes.items():
        angle, radius = direction(hole.get("cx"), hole.get("cy"))
        assert abs((angle - first - 30 * int(str(number)) + 180) % 360 - 180) < 0.1  # counter-clockwise from hole 0
        assert radius == pytest.approx(HOLE_CIRCLE, abs=0.01)
        assert hole.get("fill") == ("#000" if number == "8" else "#fff")
    tips = {}
    for pointer in drawn.iter(f"{SVG}g"):
        if "pointer" in str(pointer.get("class")):
            placed = str(pointer.find(f"{SVG}polygon").get("transform"))
            tip = re.findall(r"translate\((\S+) (\S+)\)", placed)[0]
            tips[str(pointer.get("class")).split()[1]] = direction(*tip)[0]
    # the mark's directions do not depend on where hole 0 lies
    assert tips == {
        "now": pytest.approx(260, abs=0.1),
        "after": pytest.approx(140, abs=0.1),
        "cam": pytest.approx(40, abs=0.1),
    }
    words = {t.get("class"): direction(t.get("x"), t.get("y")) for t in drawn.iter(f"{SVG}text") if t.get("class")}
    for kind, hole in (("now", 0), ("best", 8), ("worst", 3)):
        angle, radius = words[f"place {kind}"]
        assert abs((angle - first - 30 * hole + 180) % 360 - 180) < 8
        assert radius > HOLE_CIRCLE + 13
    (turn,) = [p.get("d") for p in drawn.iter(f"{SVG}path") if p.get("class") == "turn"]
    ends = re.fullmatch(r"M([\d.]+) ([\d.]+)A\S+ \S+ 0 0 1 ([\d.]+) ([\d.]+)", str(turn))  # 1: clockwise
    assert ends
    assert abs((direction(ends[1], ends[2])[0] - first + 180) % 360 - 180) < 0.1
    assert abs((direction(ends[3], ends[4])[0] - first - 240 + 180) % 360 - 180) < 5


class Checked(HTMLParser):
    """Tags that are open, and all text."""

    def __init__(self) -> None:
        super().__init__()
        self.open, self.tags, self.text = [], [], ""

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        assert not {"src", "href", "onload"} & {name for name, _ in attrs}
        if tag not in ("meta", "path", "circle", "line", "polygon"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert tag in ("path", "circle", "line", "polygon") or self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


@pytest.mark.thorough
@pytest.mark.parametrize("language", languages())
@pytest.mark.parametrize("name", CARDS)
def test_html_is_one_sound_file_without_scripts(name, language):
    page = card_html(card(CARDS[name], language))
    checked = Checked()
    checked.feed(page)
    assert checked.open == []
    assert "script" not in checked.tags
    assert "http" not in page.replace('xmlns="http://www.w3.org/2000/svg"', "")
    assert "@page { size: A4" in page
    assert f'<html lang="{language}">' in page


def test_names_are_escaped():
    evil = "<b>&\"'|*_`\\"
    advice = CARDS["plain"]
    drive = advice.drive.model_copy(update={"name": evil})
    drive._origin = advice.drive.origin
    made = card(replace(advice, drive=drive), serial=evil)
    page = card_html(made)
    checked = Checked()
    checked.feed(page)
    assert "b" not in checked.tags
    assert checked.text.count(evil) == 4  # title, name, serial number, foot
    assert f"serial number  {evil}" in card_text(made)


@pytest.mark.thorough
@pytest.mark.parametrize("language", languages())
@pytest.mark.parametrize("name", CARDS)
def test_text_is_78_columns_wide_and_plain_if_asked(name, language):
    advice = crowded(CARDS["many"]) if name == "crowded" else CARDS[name]
    page = card_text(card(advice, language))
    assert max(map(len, page.splitlines())) <= 78
    assert "…" not in page
    plain = card_text(card(advice, language), ascii=True)
    assert max(map(len, plain.splitlines())) <= 78
    odd = {c for c in plain if not c.isascii()}
    assert not odd if language == "en" else all("а" <= c.lower() <= "ё" for c in odd)
    assert "?" not in plain


def test_an_empty_serial_number_is_a_line_to_write_on():
    assert "serial number  ______" in card_text(card(CARDS["plain"]))
    assert "<th>serial number</th><td></td>" in card_html(card(CARDS["plain"]))


def test_catalogues_have_the_same_keys_and_fields():
    def fields(text: str) -> set[str]:
        return set(re.findall(r"\{(\w+)\}", text))

    home = texts("en").entries
    for language in languages():
        entries = texts(language).entries
        assert entries.keys() == home.keys()
        assert all(isinstance(text, str) and text for text in entries.values())
        for key in (key for key in home if not key.startswith("plural.")):
            assert fields(entries[key]) == fields(home[key]), (language, key)


def doubtful() -> list[Advice]:
    """Advices by values that are odd in every way, and of seats where any of some positions will do."""
    tried = (
        Trial(0.0, 28.0),
        Trial(0.0, 21.0),
        Trial(30.0, 9.0),
        Trial(60.0, 20.123, noise_arcsec=0.3, file="a/r.csv"),
    )
    beside = [
        SimpleNamespace(is_above=is_above, is_below=not is_above, low_arcsec=1.0, high_arcsec=2.0)
        for is_above in (True, False)
    ]
    beyond, within = iter(beside), SimpleNamespace(is_above=False, is_below=False)
    samples = SimpleNamespace(
        few="",
        draws=64,
        noise=lambda trials: np.full(len(trials), 0.01),
        predicted=lambda _trial: next(beyond, within),
        setup=CARDS["sampled"].setup,
        seed=0,
    )
    after = SimpleNamespace(
        samples=samples,
        effective=3.0,
        by_values=0.5,
        facing=(90.0, 5.0),
        misread=np.array([0, 0, 0.6, 0]),
        noise=np.ones(4),
        F_ior_by_torque={samples.setup.M_g: np.full((4, 12), 20.0)},
    )
    odd = replace(CARDS["sampled"], trials=tried, after=after, likelier_torque=40.0)
    several = SimpleNamespace(**vars(after) | {"misread": np.full(4, 0.2), "by_values": 0.99})
    alike = [10.0, 10.0, 10.0]
    some = advice_of(alike[:2], rotations=[60.0, 90.0], overrides=("mounting.allowed=[2,3]",))
    some = replace(some, decision=replace(some.decision, all_alike=True))
    free = advice_of(alike, overrides=("mounting.holes=0",))
    left = sampled(CARDS["plain"])
    left = replace(left, decision=replace(left.decision, rotations_deg=tuple(k + 30.0 for k in range(0, 360, 30))))
    corrected = replace(CARDS["sampled"], compensated=("cam", CARDS["sampled"].decision))
    return [odd, replace(odd, after=several), some, free, left, corrected]


def test_the_draws_for_enough_samples_are_named():
    odd, *_ = doubtful()  # 3 of 64 agree, 32 are wanted: 64 * 32 / 3
    assert any("with --draws 683, about 32 samples would agree" in warning for warning in mount_warnings(odd))


@pytest.mark.parametrize("value_arcsec", [9.0, 0.5])
def test_check_and_mount_share_the_sentence_on_odd_values(value_arcsec):
    beside = MeasuredBeside("measured.F_ior.h4@6.7", value_arcsec, 0.1, low_arcsec=1.0, high_arcsec=2.0)
    name = "warning.above_range" if beside.is_above else "warning.below_range"
    value = f"{beside.place}: {value_arcsec:g}″"
    assert beyond_words([beside]) == [texts("en")(name, value=value, low="1", high="2")]


def test_no_text_of_the_catalogue_is_unused(monkeypatch):
    used, look_up = set(), Texts.__call__

    def recorded(self, key, **fields):
        used.add(key)
        return look_up(self, key, **fields)

    monkeypatch.setattr(Texts, "__call__", recorded)
    for advice in [*CARDS.values(), crowded(CARDS["many"])]:
        card(advice, "ru")
        seat_of(advice, texts("ru"), advice.chosen)
    card(CARDS["plain"], "ru", trials=TRIALS)
    card(CARDS["sampled"], "ru", trials=TRIALS)
    card(CARDS["leave"], "ru", trials=TRIALS)
    card(crowded(CARDS["many"]), "en")
    card(UNKNOWN_TURN, "ru", trials=TRIALS)
    for advice in doubtful():
        card(advice, "ru", trials=advice.trials)
        mount_warnings(advice, texts("ru"))
    mount_warnings(replace(CARDS["measured"], open_=("gears.j_n",)), texts("ru"))
    texts("ru").holes(1)
    entries = set(texts("ru").entries)
    for_trials = {key for key in entries if key.startswith("trials.")}
    assert {key.removeprefix("trials.") for key in for_trials} <= used
    assert used == entries - for_trials


@pytest.mark.parametrize("name", CARDS)
def test_nothing_on_a_russian_card_is_english(name):
    advice = CARDS[name]
    said = strings(asdict(card(advice, "ru", serial="17", trials=TRIALS)))
    said = [text for text in said if text not in ("ru", "now", "after", "cam", "best", "worst")]  # kinds
    text = "\n".join(said)
    known_words = (f"hdassist {__version__}", "hdassist mount", "hdassist", "sha256", "F'_ior", "wheel.csv")
    text = re.sub(r"--verify h?\d+(,\d+)?=", "", text)
    for known in (*advice.drive.origin.overrides, advice.drive.name, *known_words):
        text = text.replace(known, "")
    text = re.sub(
        r"\bxi_[bg]\b|\be_h[bg]\b|F'_i[12]\b|\b[0-9a-f]{12}\b|^[pqex]$|^[pqe]: |\bx (?=не разрешено)",
        "",
        text,
        flags=re.M,
    )
    assert re.findall("[A-Za-z]+", text) == []
    assert "." not in re.sub(r"\.(\s|$)|\d\d\.\d\d\.\d{4}", "", text)  # decimal commas


def test_card_prints_preset_warnings_in_english_or_their_number_otherwise():
    full = crowded(CARDS["many"])
    assert warnings_of(full.drive, texts("en")) == full.drive.origin.warnings
    (others,) = warnings_of(full.drive, texts("ru"))
    assert others.startswith("замечаний к исходным данным: 6")
    assert warnings_of(CARDS["plain"].drive, texts("ru")) == ()


def test_russian_plurals():
    say = texts("ru")
    ends = {1: "ие", 2: "ия", 4: "ия", 5: "ий", 11: "ий", 12: "ий", 21: "ие", 23: "ия", 111: "ий", 0: "ий"}
    assert {count: say.holes(count)[-2:] for count in ends} == ends
    assert [texts("en").holes(k) for k in (1, 2, 11, 21)] == ["1 hole", "2 holes", "11 holes", "21 holes"]


def test_an_instruction_in_russian():
    made = card(CARDS["plain"], "ru")
    assert made.instruction.text == (
        "Поставьте жёсткое колесо на отверстие 8. Это 4 отверстия (120°) по часовой стрелке от отверстия 0, если "
        "смотреть со стороны генератора волн. Отверстием 0 считается то, где жёсткое колесо стоит сейчас."
    )
    assert made.foot.lines[1].endswith(f"{MADE:%d.%m.%Y}")


@pytest.mark.parametrize("language", ["xx", "", "../en", "EN"])
def test_an_unknown_language_names_those_there_are(language):
    with pytest.raises(UsageError, match="unknown language") as refused:
        texts(language)
    assert refused.value.hint == "use one of en, ru"


def test_card_states_that_a_mark_is_unknown_and_draws_none():
    open_ = ("phases.xi_b=unknown", "harmonics.a_g2=unknown", "source.cam.W_0={kind: assumed}")
    made = card(advice_of(overrides=open_), trials=TRIALS)
    assert dict(made.subject.rows)["mark"].startswith("its direction is unknown")
    assert [p.kind for p in made.seat.pointers] == ["cam"]
    assert any(", 47 given in the preset" in line for line in made.chance.lines)


@pytest.mark.parametrize("language", languages())
def test_card_after_trials_changes_its_headings_and_uses_standard_units(language):
    before, after = (card(CARDS["plain"], language, trials=tried) for tried in ((), TRIALS))
    assert before.torques.title != after.torques.title
    assert before.foot.lines[0] != after.foot.lines[1]
    text = "\n".join(strings(asdict(card(CARDS["free"], "ru"))))
    assert "°" in text
    assert "″" in text
    assert not re.search(r"\bград\b|угл\. с", text)
