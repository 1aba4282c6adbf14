"""Whatever names, paths, serials and cells have in them: no way out lets a hidden character through."""

from __future__ import annotations

import csv
import io
import json
import math
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from xml.dom.minidom import parseString

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from hdassist.features.report import (
    Curve,
    CurveMark,
    Facts,
    Lines,
    Paragraph,
    Report,
    ReportSection,
    Table,
    Tiles,
)
from hdassist.interface.pages import report as documents
from hdassist.interface.terminal.output import csv_text, json_text, report_object
from hdassist.interface.terminal.page import report_page
from hdassist.interface.terminal.streams import Style, console
from hdassist.run.kept import KeptOwner, RecordKind, open_kept
from tests.helpers.advices import advice_of, card
from tests.helpers.process import TINY, on_terminal, run
from tests.test_hidden import EVERY_HIDDEN, hidden

SURROGATES = re.compile("[\ud800-\udfff]")
STEERING = "\x1b]0;owned\x07\x1b[2J\u202e\u2066\u200b\x7f\x9b31m\u2028=1"
LETTERS = st.sampled_from(SURROGATES.sub("", EVERY_HIDDEN) + "=+-@[]/|<&\"' ab1Жµ")
WORDS = st.text(LETTERS, min_size=1, max_size=12)
STATED = ("--measured-only", "--value", "F_ior@1=20±1", "--limit", "F_ior@1=30")
# what rich writes round our own words, and where a bar on stderr begins and goes
COLOURS = re.compile(r"\x1b\[([0-9;]*m|\?25[lh])|\r(\x1b\[1A)?\x1b\[2K")
TRACE = "".join(f"{6 * step},{10 * math.sin(math.radians(12 * step)):.3f}\n" for step in range(150))


@contextmanager
def folder(word: str) -> Iterator[tuple[Path, str]]:
    """A folder, and in it a preset whose name and file name have a word in them."""
    with tempfile.TemporaryDirectory() as made:
        preset = Path(made) / f"{on_disk(word)}.yaml"
        text = Path(TINY).read_text(encoding="utf-8")
        text = text.replace("name: tiny", f"name: {json.dumps('a' + word)}")
        source = f"source: {{gears.z_g: {{kind: given, ref: {json.dumps(word)}}}}}\n"
        preset.write_text(text + source, encoding="utf-8")
        yield Path(made), str(preset)


def on_disk(word: str) -> str:
    """The word as a name that a file can have."""
    return "a" + word.replace("/", "_").replace("\x00", "_")


def say(*args: str) -> tuple[str, str]:
    """What a command says: nothing hidden, and no bug."""
    result = run(*args)
    assert result.returncode != 1, result.stderr
    assert not hidden(result.stdout)
    assert not hidden(result.stderr)
    return result.stdout, result.stderr


hostile = settings(max_examples=8, deadline=None)


@pytest.mark.thorough
@hostile
@example(STEERING)
@given(WORDS)
def test_presets(word: str) -> None:
    with folder(word) as (_, preset):
        assert say("presets", "validate", preset)[0].endswith(": OK\n")
        say("presets", "show", preset, "--resolved")
        told = json.loads(say("presets", "show", preset, "--json")[0])
        assert told["preset"]["name"] == "a" + word
        say("presets", "validate", preset, "--set", f"gears.{word}={word}")
        say("presets", "show", "b" + preset)


@hostile
@example(STEERING)
@given(WORDS)
def test_an_acceptance_in_every_form(word: str) -> None:
    with folder(word) as (place, preset):
        asked = ("accept", preset, *STATED, "--serial", "a" + word)
        table, suite, kept = (str(place / name) for name in ("a.csv", "a.xml", "a.json"))
        say(*asked, "--csv", table, "--junit", suite)
        say(*asked, "-q")
        assert not hidden(say(*asked, "--csv", "-")[0] + say(*asked, "--junit", "-")[0])
        told = json.loads(say(*asked, "--json")[0])
        assert told["serial"] == "a" + word
        rows = list(csv.DictReader(io.StringIO(read(table), newline="")))
        assert [float(row["value"]) for row in rows] == [check["value"] for check in told["checks"]]
        assert parseString(read(suite)).documentElement.tagName == "testsuites"
        Path(kept).write_text(json.dumps(told | {"version": "0" + word}), encoding="utf-8")
        say("accept", "--replay", kept)


@hostile
@example(STEERING)
@given(WORDS)
def test_a_lot(word: str) -> None:
    with folder(word) as (place, preset):
        lot = place / f"{on_disk(word)}.csv"
        table, suite = str(place / "told.csv"), str(place / "told.xml")
        asked = ("accept", str(lot), "--measured-only", "--jobs", "1")
        head = ["serial", "preset", "F_ior@1", "limit F_ior@1", "measured@1"]
        rows = [
            [f"1{word}", preset, "20±1", "30", "", word],
            [f"={word}", preset, "20±1", "30", f"none{word}", word],
            [f"3{word}", f"none{word}", word, "30", "", word],
        ]
        write(lot, [[*head, "a" + word], *rows])
        say(*asked)
        write(lot, [[*head, "note"], *rows])
        say(*asked, "--csv", table, "--junit", suite)
        told = list(csv.DictReader(io.StringIO(read(table), newline="")))
        assert [row["value"] for row in told] == ["20.0", "", ""]
        assert [row["serial"][:2].strip() for row in told][1] == "'="
        assert len(parseString(read(suite)).getElementsByTagName("testsuite")) == 3
        say(*asked, "-q")


@pytest.mark.thorough
@settings(max_examples=4, deadline=None)
@example(STEERING)
@given(WORDS)
def test_traces(word: str) -> None:
    with folder(word) as (place, preset):
        trace = place / f"{on_disk(word)}.csv"
        trace.write_text(f"# {word}\ncam_deg a{word},error_arcsec\n{TRACE}", encoding="utf-8", newline="")
        say("measure", str(trace), "--ratio", "30")
        say("measure", str(trace), "--ratio", "30", "--csv", "-")
        say("measure", str(trace) + word.replace("\x00", ""), "--ratio", "30", "--json")
        say("compare", preset, str(trace) + word.replace("\x00", ""), "--torque", "4")
        trace.write_text(f"cam_deg,error_arcsec\n{TRACE}{word},1\n", encoding="utf-8", newline="")
        say("measure", str(trace), "--ratio", "30")
        say("compare", preset, str(trace), "--torque", word)
        say("calibrate", preset, "--targets", str(trace))
        say("mount", preset, "--pitch-b", str(trace))


@settings(max_examples=2, deadline=None)
@example(STEERING)
@given(WORDS)
def test_a_sweep(word: str) -> None:
    with folder(word) as (place, preset):
        asked = ("sweep", preset, "--vary", "gears.x_b=4", "--torque", "4", "--jobs", "1")
        rows, kept = str(place / "a.csv"), str(place / "a.jsonl")
        say(*asked)
        say(*asked, "--csv", rows, "-o", kept)
        assert json.loads(read(kept).splitlines()[0])["preset"] == "a" + word
        assert "the teeth do not reach" in read(rows)
        other = KeptOwner(command="sweep", inputs={}, options={"set": [word]})
        with open_kept(kept, other, RecordKind(TypeAdapter(dict)), force=True):
            pass
        assert "options.set" in say(*asked, "-o", kept)[1]
        write(Path(kept), [[word]])
        assert "was not written by hdassist" in say(*asked, "-o", kept)[1]


@hostile
@example(STEERING)
@given(WORDS)
def test_words_of_the_command_line(word: str) -> None:
    say("explain", word)
    say("check", TINY, f"--a{word}")
    say("check", TINY, "--torque", word)
    say("accept", TINY, "--measured-only", "--value", word)
    say("mount", TINY, "--card", f"a{word}")
    say("sweep", TINY, "--vary", word)
    say("sweep", TINY, "--vary", "gears.j_n=1," + word)


CARD = card(advice_of([30.0, 20.0, 25.0]), serial="17")


@pytest.mark.thorough
@settings(max_examples=50, deadline=None)
@example(STEERING, False)
@given(WORDS, st.booleans())
def test_cards(word: str, ascii: bool) -> None:
    made = replace(
        CARD,
        subject=Facts((("drive", word), *CARD.subject.rows[1:])),
        foot=replace(CARD.foot, lines=(word,)),
        warnings=replace(CARD.warnings, lines=(word,)),
        torques=replace(CARD.torques, rows=((word, *CARD.torques.rows[0][1:]),)),
    )
    pages = documents.card_html(made), documents.card_text(made, ascii=ascii)
    assert not hidden("".join(pages))


def report_of(word: str) -> Report:
    """A report of a drive with a word wherever text may stand."""
    x, advice = np.arange(3.0), advice_of([30.0, 20.0, 25.0])
    drive = advice.drive.model_copy(update={"name": word})
    drive._origin = advice.drive.origin
    drawn = Curve(x, x, word, word, second=-x, names=(word, word), limit=2.0)
    blocks = (
        Paragraph(word),
        Facts(((word, word),)),
        Table(f"{word}\n{word}", (word, word), ((word, word),), notes=(word,)),
        Curve(x, x, word, word, marks=(CurveMark(1, 1, f"b{word}", "now"),)),
        replace(CARD.seat, title=word, legend=word),
        Lines(word, (word,), word),
        drawn,
    )
    return Report(
        command="report",
        drive=drive,
        head=word,
        verdict=word,
        why=(word,),
        blocks=(Tiles(((word, word, word),)), ReportSection(word, blocks)),
        csv=((word, word), ((word, word),)),
        line=word,
        warnings=(word,),
    )


STYLES = [Style(ascii=ascii, codes=False, width=200) for ascii in (False, True)]
PLAIN = [*map(documents.report_html(report_of("a")).count, "<>")]


@pytest.mark.thorough
@hostile
@example(STEERING)
@example("<script>alert(1)</script>")
@example("</title><svg onload=x> | `a` ```")
@given(WORDS)
def test_reports(word: str) -> None:
    report = report_of(word)
    page, text = documents.report_html(report), documents.report_markdown(report, STYLES[0])
    assert not hidden(page + text)
    assert [*map(page.count, "<>")] == PLAIN  # no more elements than with a word of letters
    assert report.csv
    assert not hidden(json_text(report_object(report)) + csv_text(*report.csv))
    for style in STYLES:
        shown = io.StringIO()
        console(shown, style).print(report_page(report, style, details=True))
        assert not hidden(shown.getvalue())
        assert shown.getvalue().isascii() or not style.ascii


@pytest.mark.thorough
def test_a_true_terminal_is_sent_our_colours_alone() -> None:
    with folder(STEERING) as (place, preset):
        trace = place / f"{on_disk(STEERING)}.csv"
        trace.write_text(f"# {STEERING}\ncam_deg,error_arcsec\n{TRACE}", encoding="utf-8")
        for args in (
            ("presets", "show", preset), ("presets", "show", preset, "--resolved"), ("presets", "validate", preset),
            ("accept", preset, *STATED, "--serial", STEERING),
            ("measure", str(trace), "--ratio", "30"), ("check", preset, f"--a{STEERING}"),
        ):  # fmt: skip
            _, sent = on_terminal(*args, columns=200)
            assert "owned" in sent
            assert not hidden(COLOURS.sub("", sent)), args


def write(path: Path, rows: list[list[str]]) -> None:
    """A table as a shop would make it."""
    with path.open("w", encoding="utf-8", newline="") as stream:
        csv.writer(stream).writerows(rows)


def read(path: str) -> str:
    """The text of a file of ours, which has nothing hidden."""
    text = Path(path).read_bytes().decode("utf-8")
    assert not hidden(text)
    return text
