"""Short pages: verdicts, labelled lines, commands that go on."""

from __future__ import annotations

import io
import re
import shlex

import pytest
from typer.main import get_command

from hdassist.belief.steps import Influence
from hdassist.drive.loading import load_preset
from hdassist.drive.preset.fields import AskedOption
from hdassist.drive.solve.answers import Certificate
from hdassist.drive.solve.loadcase import CrossCheck
from hdassist.features.report import Facts, Paragraph, Report, Table
from hdassist.interface.cli import COMMANDS, OTHER_NAMES, app
from hdassist.interface.commands.design import CheckCommand
from hdassist.interface.terminal.options import torque_overrides
from hdassist.interface.terminal.page import report_page
from hdassist.interface.terminal.streams import Style, console
from hdassist.interface.terminal.words import (
    LIMITED,
    TAKEN_OVER,
    again,
    influence_words,
    on_what,
    proof,
)
from tests.helpers.process import SMALL, in_a_line, run


@pytest.mark.parametrize(
    ("share", "second"), [(0.006, "; addendum of both wheels, in modules (gears.h_a): 1 %"), (0.004, "")]
)
def test_second_contribution_is_named_if_above_0_percent(share, second):
    found = [Influence("operation.dT", 0.99), Influence("gears.h_a", share)]
    assert influence_words(found).partition("99 %")[2] == second


PROVEN = Certificate(9, 0.0, 0.0, 0.0, 0.0, 0)


def shown(style: Style, report: Report) -> str:
    stream = io.StringIO()
    console(stream, style).print(report_page(report, style))
    return stream.getvalue()


@pytest.mark.parametrize(
    ("verdict", "code"),
    [("PASS", "32m"), ("FAIL", "31m"), ("INCONCLUSIVE", "38;5;136m"), ("range 2.5″", None),
     ("TURN, hole 3", "32m"), ("LEAVE, hole 0", "32m"), ("BEST BET, 90°", "38;5;136m"), ("GO BACK, hole 1", "31m")],
)  # fmt: skip
def test_verdicts_are_green_red_or_ochre_where_there_are_colours(monkeypatch, verdict, code):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    report = Report("check", None, "own", verdict)
    coloured = shown(Style(False, True, 80), report)
    assert verdict in coloured
    for found in ("31m", "32m", "33m", "38;5;136m"):
        assert (found in coloured) == (found == code)
    assert shown(Style(False, False, 80), report) == f"own: {verdict}\n"


def test_verdict_numbers_and_next_command_are_bold_and_verification_dim(monkeypatch):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    facts = Facts((("limit", "30″"), ("next", "hdassist mount own")))
    report = Report("check", None, "own", why=("h0 keeps 30″ at 80 N·m",), blocks=(facts,), certificate=PROVEN)
    coloured = shown(Style(False, True, 80), report)
    assert "h0 keeps \x1b[1m30″\x1b[0m at \x1b[1m80 N·m\x1b[0m" in coloured
    assert "\x1b[1mnext" in coloured
    assert "\x1b[2mverified" in coloured
    assert "\x1b[1mlimit" not in coloured
    assert "\x1b" not in shown(Style(False, False, 80), report)


def test_table_title_is_bold_unlike_its_notes(monkeypatch):
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    table = Table("F'_ior, ″", ("hole", "F'_ior"), (("0", "27.7"),), notes=("loss: against the best",))
    coloured = shown(Style(False, True, 80), Report("check", None, "own", blocks=(table,)))
    assert "\x1b[1mF'_ior, ″\x1b[0m" in coloured
    assert "\nloss: against the best\n" in coloured


@pytest.mark.parametrize("width", range(20, 60))
def test_no_line_ends_within_a_number_with_its_unit(width):
    words = "keeps 30 ″ at 80 N·m with 86 % (± 2 %), order 2, ″, limit ≤ 35, 120 µm and 15 °"
    table = Table("", ("check", "kept"), ((words, "100 %"),))
    report = Report("check", None, words, why=(words,), blocks=(Paragraph(words), Facts((("limit", words),)), table))
    lines = [line.rstrip() for line in shown(Style(False, False, width), report).splitlines()]
    assert not [line for line in lines if re.match(r"(?:limit)? *(?:[%″°]|N·m|µm)", line) or re.search("[±≤]$", line)]
    assert "\ufffe" not in "".join(lines)


def test_labels_wrap_before_numbers_do():
    rows = (("negative force, relative residual (limit 1e-08)", "2.8e-12"), ("mesh positions solved", "71569"))
    text = shown(Style(False, False, 50), Report("check", None, "own", blocks=(Facts(rows),)))
    assert "2.8e-12" in text
    assert "71569" in text


def test_a_path_longer_than_its_column_makes_no_second_table():
    path = "/home/somebody/.cache/hdassist/answers/of/all/commands"
    text = shown(Style(False, False, 50), Report("doctor", None, "", blocks=(
        Table("", ("part", "status", "found"), (("cache", "ok", f"{path}, 115 files"),)),
    )))  # fmt: skip
    assert text.count("part") == 1
    assert path in "".join(text.split())


@pytest.mark.parametrize("width", [40, 80])
def test_fact_lines_stay_beside_their_label_and_empty_ones_vanish(width):
    words = "one two three four five six seven eight nine ten eleven twelve"
    report = Report("check", None, "own", blocks=(Facts.of([("lever", words), ("next", "")]),))
    _, first, *rest = [line for line in shown(Style(True, False, width), report).splitlines() if line]
    assert first.startswith("lever  one")
    assert all(line.startswith("       ") for line in rest)
    assert " ".join(" ".join([first, *rest]).split()) == f"lever {words}"
    assert max(map(len, [first, *rest])) <= width


def test_a_command_that_goes_on_is_about_the_same_drive():
    overrides = [*torque_overrides(["2", "-3.5 N·m"]), "phases.xi_b=90±10", "name=a b"]
    drive = load_preset(SMALL, overrides)
    words = shlex.split(again("check", drive, "--json"))
    assert words == [
        "hdassist", "check", SMALL, "--torque=2", "--torque=-3.5", "--set", "phases.xi_b=90±10", "--set", "name=a b",
        "--json",
    ]  # fmt: skip
    assert again("mount", load_preset("vzp160")) == "hdassist mount vzp160"
    limited = load_preset(SMALL, ["acceptance.F_ior=45", "acceptance.F_ior.4=20"])
    for command in ("check", "mount"):
        assert shlex.split(again(command, limited))[3:] == ["--limit", "45", "--limit", "F_ior@4=20"]
    assert shlex.split(again("trace", limited))[3:] == [
        "--set",
        "acceptance.F_ior=45",
        "--set",
        "acceptance.F_ior.4=20",
    ]


def test_a_next_command_keeps_what_the_user_asked_with():
    asked = run("check", SMALL, "--torque", "4", "--limit", "45", "--draws", "32", "--seed", "3", "--no-plot").stdout
    command = f"hdassist tolerance {SMALL} --torque=4 --limit 45 --seed=3"
    assert command in in_a_line(asked)  # which draws drives, no samples
    drive = CheckCommand(presets=[SMALL], overrides=[], torque=[], limit=[], draws=32, seed=3).load(SMALL)
    assert again("mount", drive) == f"hdassist mount {SMALL} --draws=32 --seed=3"
    usual = CheckCommand(presets=[SMALL], overrides=[], torque=[], limit=[]).load(SMALL)
    assert again("mount", usual) == f"hdassist mount {SMALL}"


def test_options_are_taken_over_by_the_commands_that_have_them():
    root = get_command(app)
    every = {name: {each.name for each in root.get_command(None, name).params} for name in COMMANDS}
    of_presets_alone = {"compare"}  # the command that a page prints of it has a recording, which takes no limit
    limited = {name for name, options in every.items() if "limit" in options}
    assert limited - {*OTHER_NAMES} - of_presets_alone == {*LIMITED}
    for option, takers in TAKEN_OVER.items():
        assert all(option in every[name] for name in takers)


def test_given_option_replaces_the_one_of_the_previous_command():
    asked = (AskedOption("check", "draws", "--draws=8"), AskedOption("check", "seed", "--seed=3"))
    drive = load_preset("vzp160", (), asked)
    assert again("check", drive, "--draws", "32") == "hdassist check vzp160 --seed=3 --draws 32"


def test_the_proof_in_a_line():
    certificate = Certificate(20200, 0.0, 8.1e-11, 1e-12, 0.0, 0)
    assert proof(certificate) == "20 200 mesh positions, residual 8e-11"
    crossed = [CrossCheck("CLARABEL", 10, 1e-6), None, CrossCheck("CLARABEL", 10, 1e-6)]
    assert proof(certificate, crossed) == "20 200 mesh positions, residual 8e-11; CLARABEL checked 20"


def test_unweighted_ranges_are_those_of_assumed_and_defaulted_values():
    drive = load_preset("size-17-100")
    ranges = {path for path, source in drive.source.items() if source.kind == "assumed" and source.range}
    ranges = ranges - {drive.unused_tooth_field} | {"operation.dT"}  # which the preset leaves out
    told = f"{len(ranges)} inputs with an assumed or default range are at their nominal values; "
    told += "hdassist check samples them"
    assert on_what(drive) == told
    assert on_what(load_preset(SMALL)) == ""


def test_accept_is_named_with_options_that_it_has():
    drive = load_preset(SMALL, ["operation.M_g=[4.0]", "acceptance.F_ior=40"])
    named = shlex.split(again("accept", drive, "--measured-only"))
    assert named == [
        "hdassist",
        "accept",
        str(SMALL),
        "--set",
        "operation.M_g=[4.0]",
        "--limit",
        "40",
        "--measured-only",
    ]
