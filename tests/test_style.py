"""The language of pages and program texts: phrases that they avoid, and how many places still have them.

`tests/data/style.toml` lists the phrases with their rules. Banned phrases are in no page of the docs. The program may
have those that `tests/data/style_counts.toml` lists by file. Judged phrases, long sentences and crowded sentences are
counted for all pages, and for all texts of the program. No count grows: `python -m tests.test_style` lowers the list,
and `python -m tests.test_style PHRASES FILE ...` shows the places of a rule, or of all rules, in files.
"""

import ast
import re
import sys
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
RULES = Path(__file__).parent / "data" / "style.toml"
COUNTS = Path(__file__).parent / "data" / "style_counts.toml"
GENERATED = {"commands.md", "fields.md", "glossary.md"}  # their texts are those of the program
MOST_WORDS = 30  # of a sentence
MOST_SEPARATORS = 1  # colons and semicolons of a sentence
SENTENCE_END = r"(?<=[.!?])\s+|\n\s*\n|\s*\|\s*|\n(?=\s*(?:[-*]|\d+\.) )"  # blank lines, cells and items of lists too


@cache
def rules():
    """Return the phrases of each rule, compiled, by kind (banned, judged) and name."""
    data = tomllib.loads(RULES.read_text("utf-8"))
    return {
        kind: {name: [re.compile(phrase) for phrase in rule["phrases"]] for name, rule in data[kind].items()}
        for kind in ("banned", "judged")
    }


def prose_of(page):
    """Return the text of a page of Markdown without code, mathematics and targets of links."""
    text = re.sub(r"^( *)```.*?^\1```", "", page, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"\$\$.*?\$\$", "", text, flags=re.DOTALL)
    text = re.sub(r"^(?: {4}).*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"`[^`\n]*`", "`code`", text)
    return re.sub(r"\]\([^)]*\)", "]", text)


@cache
def pages():
    """Return the prose of each page that is written by hand, by its path."""
    files = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
    files += sorted((ROOT / ".github").rglob("*.md"))
    return {
        file.relative_to(ROOT).as_posix(): prose_of(file.read_text("utf-8"))
        for file in files
        if file.name not in GENERATED
    }


def is_text(value):
    """Return whether a string is for people: two words side by side."""
    return re.search(r"[a-z]{2,} [a-z]{2,}", value) is not None


def text_of_literal(node):
    """Return the text of a string in the source, with {} for each value that is put in; None for any other node."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) if isinstance(part, ast.Constant) else "{}" for part in node.values)
    return None


def texts_of_module(source):
    """Return the strings of a module that people read: those with words, and the docstrings of commands."""
    nodes = list(ast.walk(ast.parse(source)))
    inner = {id(part) for node in nodes if isinstance(node, ast.JoinedStr) for part in ast.walk(node)} - {
        id(node) for node in nodes if isinstance(node, ast.JoinedStr)
    }
    docstrings = set()
    for node in nodes:
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and ast.get_docstring(
            node
        ):
            is_help = isinstance(node, ast.ClassDef) and node.name.endswith("Command")
            if not is_help:
                docstrings.add(id(node.body[0].value))
    texts = [text_of_literal(node) for node in nodes if id(node) not in inner | docstrings]
    return [text for text in texts if text is not None and is_text(text)]


def texts_of_toml(value):
    """Return the texts among the values of a table, its keys left out."""
    if isinstance(value, dict):
        return [text for child in value.values() for text in texts_of_toml(child)]
    if isinstance(value, list):
        return [text for child in value for text in texts_of_toml(child)]
    return [value] if isinstance(value, str) and is_text(value) else []


@cache
def program_texts():
    """Return the texts that the program shows, by the path of the file, each as one string."""
    texts = {}
    for file in sorted((ROOT / "hdassist").rglob("*")):
        if file.suffix == ".py":
            found = texts_of_module(file.read_text("utf-8"))
        elif file.suffix == ".toml":
            found = texts_of_toml(tomllib.loads(file.read_text("utf-8")))
        elif file.name == "en.yaml":
            found = file.read_text("utf-8").splitlines()
        else:
            continue
        texts[file.relative_to(ROOT).as_posix()] = "\n\n".join(found)
    return texts


def places_of(kind, text):
    """Return the places of a text with a phrase of a kind, as pairs of the rule and the words around the phrase."""
    flat = "\n\n".join(" ".join(block.split()) for block in re.split(r"\n\s*\n", text))
    places = []
    for name, phrases in rules()[kind].items():
        for phrase in phrases:
            matches = phrase.finditer(flat)
            places.extend((name, flat[max(0, match.start() - 40) : match.end() + 40]) for match in matches)
    return places


def sentences_of(text):
    """Return the sentences of a text; a cell of a table and an item of a list end one."""
    parts = re.split(SENTENCE_END, text)
    return [" ".join(part.split()) for part in parts if part and part.strip()]


def is_long(sentence):
    """Return whether a sentence has more than MOST_WORDS words."""
    return len(sentence.split()) > MOST_WORDS


def is_crowded(sentence):
    """Return whether a sentence has more than MOST_SEPARATORS colons and semicolons that separate clauses."""
    return len(re.findall(r"[;:](?= )", sentence)) > MOST_SEPARATORS


def counts_of(texts):
    """Return the number of judged phrases, long and crowded sentences of some texts, by rule."""
    counts = Counter()
    for text in texts:
        counts.update(name for name, _ in places_of("judged", text))
        for sentence in sentences_of(text):
            counts["long"] += is_long(sentence)
            counts["crowded"] += is_crowded(sentence)
    return counts


def banned_counts(texts):
    """Return the number of banned phrases of each text that has one, by its path."""
    numbers = {file: len(places_of("banned", text)) for file, text in texts.items()}
    return {file: number for file, number in numbers.items() if number}


def test_no_page_has_a_banned_phrase():
    places = {file: places_of("banned", text) for file, text in pages().items()}
    assert {file: found for file, found in places.items() if found} == {}


def test_the_program_has_no_further_banned_phrase():
    allowed = tomllib.loads(COUNTS.read_text("utf-8"))["banned_in_program"]
    texts = program_texts()
    excess = {
        file: places_of("banned", texts[file])
        for file, number in banned_counts(texts).items()
        if number > allowed.get(file, 0)
    }
    assert excess == {}


@pytest.mark.parametrize(("group", "texts"), [("judged_on_pages", pages), ("judged_in_program", program_texts)])
def test_judged_phrases_become_fewer(group, texts):
    allowed = tomllib.loads(COUNTS.read_text("utf-8"))[group]
    excess = {name: number for name, number in counts_of(texts().values()).items() if number > allowed.get(name, 0)}
    assert excess == {}, "`python -m tests.test_style RULE FILE ...` shows the places"


@pytest.mark.parametrize(
    ("kind", "rule", "text"),
    [
        ("banned", "worst_served", "the torque served worst"),
        ("banned", "less", "the greatest less the least error"),
        ("banned", "rigid_wheel", "Rigid wheel fixed"),
        ("banned", "tell", "is told apart"),
        ("judged", "fronted", "It has two seats. Of these one is round."),
        ("judged", "dangling", "The wheel stays with it."),
        ("judged", "cam", "the angle of the cam"),
    ],
)
def test_a_phrase_is_counted_by_its_rule(kind, rule, text):
    assert rule in {name for name, _ in places_of(kind, text)}


def test_plain_sentences_are_not_counted():
    text = "Bolt the circular spline in hole 9. The probability that it meets the limit is 86 %."
    assert places_of("banned", text) == places_of("judged", text) == []
    assert counts_of([text]) == {"long": 0, "crowded": 0}


def test_sentences_are_measured():
    assert [is_long("word " * count) for count in (30, 31)] == [False, True]
    assert [is_crowded(text) for text in ("One: two.", "One: two; three.")] == [False, True]
    assert sentences_of("One. Two!\n\nThree\n\n- Four\n- Five | Six |") == [
        "One.",
        "Two!",
        "Three",
        "- Four",
        "- Five",
        "Six",
    ]


def test_code_and_links_are_no_prose():
    page = "The `rigid wheel` and [a page](docs/standing-offset.md):\n\n```sh\nhdassist told\n```\n\n$$ proof $$\n"
    assert places_of("banned", prose_of(page)) == []


def lower_counts():
    """Write the counts of this checkout where they are lower than the listed ones; the first run writes all."""
    listed = tomllib.loads(COUNTS.read_text("utf-8")) if COUNTS.exists() else None
    groups = {
        "banned_in_program": banned_counts(program_texts()),
        "judged_on_pages": counts_of(pages().values()),
        "judged_in_program": counts_of(program_texts().values()),
    }
    lines = ["# Places that remain, by file or by rule of style.toml. `python -m tests.test_style` lowers them."]
    for group, counts in groups.items():
        lines.append(f"\n[{group}]")
        for name, number in sorted(counts.items()):
            lowest = number if listed is None else min(number, listed[group].get(name, 0))
            if lowest:
                lines.append(f'"{name}" = {lowest}')
    COUNTS.write_text("\n".join(lines) + "\n", "utf-8")


def show_places(rule, files):
    """Write the places of a rule of style.toml, or of all rules, in some files."""
    texts = pages() | program_texts()
    for file in files or texts:
        places = places_of("banned", texts[file]) + places_of("judged", texts[file])
        for sentence in sentences_of(texts[file]):
            places += [("long", sentence)] * is_long(sentence) + [("crowded", sentence)] * is_crowded(sentence)
        for name, words in places:
            if rule in ("PHRASES", name):
                sys.stdout.write(f"{file}: {name}: ...{words}...\n")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        show_places(sys.argv[1], sys.argv[2:])
    else:
        lower_counts()
