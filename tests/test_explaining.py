"""Names of all sorts are found, in any spelling; what is not is told with what is near."""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator

import pytest

from hdassist.drive.preset.fields import field_table, sections
from hdassist.features.acceptance.limits import CHECKS, CODES
from hdassist.features.report import declared_quantities, quantity_table
from hdassist.interface.explaining import FAULTS, SYMBOLS, TERMS, entries, explained, latin
from hdassist.interface.explorer.panes import MARKS
from hdassist.interface.pages import check as check_page
from hdassist.interface.pages import curves as curves_page
from hdassist.interface.terminal.output import with_code
from hdassist.interface.terminal.plot import MARK_SIGNS
from hdassist.interface.terminal.words import Texts, texts
from hdassist.run.errors import Fault, HdassistError, UsageError, Verdict
from tests.conftest import ROOT
from tests.helpers.process import SMALL, in_a_line, on_terminal, run

REPORTED = (
    *check_page.POINT_QUANTITIES, *check_page.BELIEF, *curves_page.ORDER_QUANTITIES,
    *curves_page.WHOLE_QUANTITIES,
)  # fmt: skip


@pytest.mark.parametrize(
    ("name", "kinds", "words"),
    [
        ("FIOR", {"check", "quantity or word", "symbol", "field"}, "over the full"),
        ("F'_ior", {"check", "quantity or word", "symbol", "field"}, "over the full"),
        ("phi_g", {"symbol"}, "angles of wave generator and flexspline"),
        ("φ_g", {"symbol"}, "angles of wave generator and flexspline"),
        ("W_0", {"symbol", "field"}, "major axis"),
        ("cam.W_0", {"field"}, "major axis"),
        ("xi_b", {"symbol", "field"}, "tooth deviations"),
        ("K1", {"check", "field"}, "torsional stiffness"),
        ("one-wave share", {"quantity or word"}, "less than 1 %"),
        ("Lost Motion", {"check", "quantity or word", "field"}, "4 %"),
        ("self error", {"check", "quantity or word", "field"}, "without any deviation"),
        ("Генератор волн", {"quantity or word"}, "deforms the flexspline"),
        ("жесткое колесо", {"quantity or word"}, "internal teeth"),
        ("gears", {"section"}, "Teeth"),
        ("N", {"quantity or word", "symbol", "field"}, "balls"),
        ("phasors", {"quantity or word"}, "Amplitudes and phases"),
        ("orders", {"check", "quantity or word"}, "per input revolution"),
        ("oldham", {"field"}, "Oldham coupling"),
        ("pitch", {"quantity or word", "field"}, "equal pitches"),
    ],
)
def test_a_name_is_found_in_its_spellings(name, kinds, words):
    found = explained(name)
    assert {entry.kind for entry in found} == kinds
    assert words in " ".join([text for entry in found for text in (entry.words, *(fact for _, fact in entry.facts))])


def test_all_that_is_declared_is_known():
    names = [*CODES, *field_table(), *(path.split(".")[1] for path in field_table()), *(name for name, _ in sections())]
    names += [name for each in SYMBOLS for name in each.paper]
    names += [name for term in TERMS for name in (term.word, *term.others, *term.russian.split(", ")) if name]
    names += list(Fault)
    names += [part for q in REPORTED for part in (q.key.split(".")[-1],) if not re.search(ANGLES, q.key)]
    for name in names:
        assert explained(name), name
    assert set(FAULTS) == set(Fault)
    assert all(entry.words for entry in entries())


ANGLES = r"^at_|^M_g"  # parts of an object that is explained, or a symbol with its unit


def constants(node: ast.AST | None) -> Iterator[str]:
    """Texts of a node: of a constant, or of both ends of a condition."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.IfExp):
        yield from (*constants(node.body), *constants(node.orelse))
    elif isinstance(node, ast.Tuple | ast.List):
        yield from (text for part in node.elts for text in constants(part))


def labels(source: str) -> Iterator[str]:
    """Words of a page as its code declares them: labels of facts, heads of tables, names of curves and of marks."""
    for node in ast.walk(ast.parse(source)):
        pairs: list[ast.AST] = []
        if isinstance(node, ast.Call):
            name, place = ast.unparse(node.func), {"Quantity": 1, "CurveMark": 2, "Table": 1}
            if name in place and len(node.args) > place[name]:
                yield from constants(node.args[place[name]])
            pairs = list(node.args) if name in ("Facts", "Facts.of") else []
            yield from (text for k in node.keywords if k.arg == "names" for text in constants(k.value))
        elif isinstance(node, ast.FunctionDef) and "facts" in node.name:
            pairs = [node]
        elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) in ("facts", "rows", "more", "rest"):
            pairs = [node.value]
        elif isinstance(node, ast.Yield) and isinstance(node.value, ast.Tuple) and len(node.value.elts) == 2:
            yield from constants(node.value.elts[0])
        both = (
            each for pair in pairs for each in ast.walk(pair) if isinstance(each, ast.Tuple) and len(each.elts) == 2
        )
        yield from (text for each in both for text in constants(each.elts[0]))


NAMED = """
effective samples; as given; as fitted; torque served worst; HIGHS; CLARABEL; REFINED; PROVEN; 90 % RANGE; N; B; W; E;
variance of ln F'_ior; of smooth teeth; best bet; MEASURE FIRST; TURN; LEAVE; NO ORDER; now; best; worst; best of 12;
more sure; less spread; self error; as built; PASS; FAIL; INCONCLUSIVE; NO LIMIT; one-wave share; proof; verified;
residual
"""


def test_all_words_of_pages_are_known() -> None:
    pages = [path.read_text("utf-8") for path in (ROOT / "hdassist/interface/pages").glob("*.py")]
    tables = declared_quantities().items()
    declared = {
        each.words
        for page, named in tables
        for name, of in named.items()
        for each in quantity_table(f"{page}.{name}")
        if {"label", "digits"} & of[each.key].keys()
    }
    said = {label.split(",")[0].strip() for label in (*declared, *(w for page in pages for w in labels(page)))} - {""}
    assert len(said) > 140
    said |= {word.strip() for word in NAMED.split(";")} | {str(verdict) for verdict in Verdict} | set(MARKS)
    unknown = []
    for word in sorted(said):
        try:
            explained(word)
        except UsageError:
            unknown.append(word)
    assert not unknown, "to be explained in hdassist/interface/explaining.toml"
    assert {"now", "N"} <= {name for entry in explained("N") for name in entry.names}  # beside the number of balls


@pytest.mark.parametrize("say", [texts(), texts().variant("trials")], ids=["seat", "after trials"])
def test_letters_of_seats_and_plots_have_one_explained_meaning(say: Texts) -> None:
    letters = {say(f"seat.letter_{kind}"): say(f"seat.{kind}") for kind in ("now", "best", "worst")}
    letters |= {"x": "not allowed", "p": "mark now", "q": "mark after assembly", "e": "eccentricity on the card"}
    marks = {mark: words for words, mark in MARK_SIGNS.items() if mark.isalpha() and " " not in words}
    assert {letter: words for letter, words in marks.items() if letters.get(letter, words) != words} == {}
    for letter, words in (*letters.items(), *marks.items()):
        assert any({letter, words} <= {*entry.names} for entry in explained(letter)), letter


def test_a_field_has_its_unit_range_and_default():
    (found,) = explained("gears.j_n")
    assert found.facts == (("unit", "um"), ("range", "0 to 200"), ("left out", "0"))
    (found,) = explained("bearing.ball_motion")
    assert found.facts == (("values", "locked, rolling"), ("left out", "locked"))


def test_an_option_is_found_where_nothing_else_has_its_name():
    told = run("explain", "robust")
    assert told.returncode == 0
    assert told.stdout.startswith("robust: Leave out")
    assert run("explain", "draws", "--json").stdout.count('"option"') == 0  # a word of the trade
    assert run("explain", "robustly").returncode == 2


@pytest.mark.parametrize(("wrong", "meant"), [("F_iro", "F_IOR"), ("flexpline", "flexspline"), ("phi_q", "phi_g")])
def test_what_is_near_is_offered(wrong, meant):
    with pytest.raises(UsageError, match=f"unknown name: {wrong}") as told:
        explained(wrong)
    assert re.fullmatch(rf"the nearest name is .*\b{meant}\b.*", told.value.hint)


def test_every_error_says_a_code_that_can_be_explained():
    classes = [HdassistError]
    for each in classes:
        classes += each.__subclasses__()
    assert {each.fault for each in classes} <= set(FAULTS)
    asked = {
        Fault.FILE_UNREADABLE: ("check", "none.yaml"),
        Fault.FILE_INVALID: ("check", "-"),
        Fault.USAGE: ("explain", "nothing at all"),
        Fault.FILE_EXISTS: ("trace", SMALL, "-o", SMALL),
        Fault.FILE_UNWRITABLE: ("trace", SMALL, "-o", "/none/there"),
        Fault.BEYOND_MODEL: ("trace", SMALL, "--torque", "1e6"),
    }
    for fault, arguments in asked.items():
        told = run(*arguments, stdin="schema: hdassist.preset/1\n").stderr
        assert told.startswith("error: ")
        assert told.rstrip().endswith((f"(hdassist explain {fault})", f"hint: hdassist explain {fault}")), told
    assert with_code("", Fault.BUG) == "hdassist explain BUG"


def test_codes_are_explained_to_people_and_scripts():
    done = run("explain", "k-1", "coverage")
    assert done.returncode == 0
    for words in ("K_1: torsional stiffness K_1", "acceptance.K_1, the smallest", "goes wrong", "COVERAGE: "):
        assert words in done.stdout
    every = json.loads(run("explain", "--json").stdout)
    assert every["schema"] == "hdassist.explain/1"
    assert [item["name"] for item in every["names"]][: len(CODES)] == list(CODES)
    assert {"name", "kind", "words", "facts"} == set(every["names"][0])
    one = json.loads(run("explain", "cam.W_0", "--json").stdout)
    assert [item["name"] for item in one["names"]] == ["cam.W_0"]
    wrong = run("explain", "nothing")
    assert (wrong.returncode, "unknown name: nothing" in wrong.stderr) == (2, True)
    assert all(check.code in run("explain").stdout for check in CHECKS)


@pytest.mark.thorough
@pytest.mark.parametrize(
    "names", [(), tuple(dict.fromkeys(entry.names[0] for entry in entries()))], ids=["list", "all"]
)
def test_forty_columns_hold_it_whole(names):
    wide = run("explain", *names).stdout
    code, told = on_terminal("explain", *names, "--no-color", columns=40)
    assert code == 0
    assert max(map(len, told.splitlines())) <= 40
    assert "…" not in told
    assert sorted(in_a_line(told).split()) == sorted(in_a_line(wide).split())


@pytest.mark.parametrize(
    ("word", "term"),
    [
        ("draws", "samples"),
        ("not known", "unknown"),
        ("no-load accuracy", "transmission accuracy"),
        ("backlash", "backlash"),
        ("play", "backlash"),
        ("PEC", "PEC"),
        ("periodic error", "periodic error"),
        ("beats", "sidebands"),
        ("dedoidal", "dedoidal"),
        ("phasor", "correction terms"),
        ("rigid wheel", "circular spline"),
        ("wave generator eccentricity", "eccentricity"),
        ("tangential composite deviation", "single-flank composite deviation"),
        ("torque served worst", "governing torque"),
        ("reported value", "reported value"),
        ("flank clearance", "clearance"),
    ],
)
def test_trade_word_leads_only_to_its_own_term(word: str, term: str) -> None:
    names = [entry.names[0] for entry in explained(word) if entry.kind == "quantity or word"]
    assert names == [term]


def test_ascii_explanations_transliterate_russian_and_greek_letters() -> None:
    for name in ("eccentricity", "phi_h", "гибкое колесо", "xi_b"):
        done = run("explain", name, "--ascii")
        assert done.stdout.isascii()
        assert "?" not in done.stdout
    assert "ekstsentrisitet" in run("explain", "eccentricity", "--ascii").stdout
    assert latin("Угол φ_h, ″") == "Ugol phi_h, ″"


def test_several_words_without_quotes_are_one_name():
    phrase = run("explain", "wave", "generator", "--json")
    quoted = run("explain", "wave generator", "--json")
    assert phrase.returncode == quoted.returncode == 0
    assert phrase.stdout == quoted.stdout
