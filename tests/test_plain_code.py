"""Plain code: the habits that make code hard to read, and how many places of each file still have them.

`tests/data/plain_code.toml` lists the places that remain. A file with more places than listed fails, and so does a file
with fewer: `python -m tests.test_plain_code` then lowers the list. The list never grows.
"""

import ast
import tokenize
import tomllib
from collections import Counter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "hdassist"
ALLOWED = Path(__file__).parent / "data" / "plain_code.toml"

POINTING_NAMES = {  # they point at a value, and do not say what it is
    *("above", "alike", "apart", "asked", "at", "below", "beside", "both", "done", "each", "every", "fewer", "found"),
    *("further", "given", "held", "here", "known", "left", "made", "more", "most", "near", "now", "of", "other"),
    *("others", "own", "rest", "seen", "some", "there", "told", "whole", "words"),
}
MOST_POSITIONAL = 3  # arguments of a constructor; further ones are named
MOST_TOKENS = 300  # of a function, without comments and layout
LAYOUT = {
    *(tokenize.ENCODING, tokenize.ENDMARKER, tokenize.COMMENT),
    *(tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
}


def is_pointing_name(node):
    """Return whether a node assigns a name that only points."""
    return isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id in POINTING_NAMES


def is_packed_assignment(node):
    """Return whether a node assigns several values at once, as in `a, b = x, y`."""
    if not isinstance(node, ast.Assign):
        return False
    return isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple)


def is_sequence_display(node):
    """Return whether a node is a text, a tuple or a list, written out."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, str)
    return isinstance(node, ast.JoinedStr | ast.Tuple | ast.List)


def is_text_times_flag(node):
    """Return whether a node multiplies a text or a sequence, as in `"s" * (count > 1)`."""
    if not (isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult)):
        return False
    return is_sequence_display(node.left) or is_sequence_display(node.right)


def is_positional_constructor(node, class_names):
    """Return whether a node calls a class of the package with many positional arguments."""
    if not isinstance(node, ast.Call):
        return False
    called_name = getattr(node.func, "id", getattr(node.func, "attr", ""))
    positional = [argument for argument in node.args if not isinstance(argument, ast.Starred)]
    return called_name in class_names and len(positional) > MOST_POSITIONAL


def is_long_function(node, tokens_of_line):
    """Return whether a node is a function of more than MOST_TOKENS tokens."""
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        return False
    return sum(tokens_of_line[line] for line in range(node.lineno, node.end_lineno + 1)) > MOST_TOKENS


def broken_rules(tree, source, class_names):
    """Return the lines of a source with its syntax tree that break a rule, by the name of the rule."""
    with_tokens = tokenize.generate_tokens(iter(source.splitlines(keepends=True)).__next__)
    tokens_of_line = Counter(token.start[0] for token in with_tokens if token.type not in LAYOUT)
    lines = {"pointing": [], "packed": [], "text_times_flag": [], "positional": [], "long": []}
    for node in ast.walk(tree):
        if is_pointing_name(node):
            lines["pointing"].append(node.lineno)
        if is_packed_assignment(node):
            lines["packed"].append(node.lineno)
        if is_text_times_flag(node):
            lines["text_times_flag"].append(node.lineno)
        if is_positional_constructor(node, class_names):
            lines["positional"].append(node.lineno)
        if is_long_function(node, tokens_of_line):
            lines["long"].append(node.lineno)
    return lines


def sources_of_package():
    """Return the source of each module, by its path in the package."""
    files = sorted(PACKAGE.rglob("*.py"))
    return {file.relative_to(PACKAGE).as_posix(): file.read_text("utf-8") for file in files}


def classes_of(trees):
    """Return the names of all classes that some syntax trees define."""
    nodes = [node for tree in trees for node in ast.walk(tree)]
    return {node.name for node in nodes if isinstance(node, ast.ClassDef)}


def remaining_places():
    """Return the lines that break a rule, by rule and file."""
    sources = sources_of_package()
    trees = {file: ast.parse(source) for file, source in sources.items()}
    class_names = classes_of(trees.values())
    places = {}
    for file, source in sources.items():
        for rule, lines in broken_rules(trees[file], source, class_names).items():
            if lines:
                places.setdefault(rule, {})[file] = lines
    return places


@pytest.fixture(scope="module")
def remaining():
    return remaining_places()


@pytest.mark.parametrize("rule", ["pointing", "packed", "text_times_flag", "positional", "long"])
def test_no_file_has_more_places_than_the_list_allows(remaining, rule):
    allowed = tomllib.loads(ALLOWED.read_text("utf-8")).get(rule, {})
    lines_of = remaining.get(rule, {})
    excess = {file: lines for file, lines in lines_of.items() if len(lines) > allowed.get(file, 0)}
    assert excess == {}, "mend these lines, all of a file that has more places than allowed"
    stale = {file: count for file, count in allowed.items() if count > len(lines_of.get(file, ()))}
    assert stale == {}, "fewer places than listed: `python -m tests.test_plain_code` lowers the list"


@pytest.mark.parametrize(
    ("rule", "source"),
    [
        ("pointing", "found = 1"),
        ("packed", "mean, spread = 1, 2"),
        ("text_times_flag", "name = 'hole' + 's' * (count > 1)"),
        ("positional", "Line(1, 2, 3, 4)"),
        ("long", "def function():\n" + "    total = 1 + 1\n" * 60 + "    return 1\n"),
    ],
)
def test_a_place_is_counted_once_by_its_rule(rule, source):
    counts = {name: len(lines) for name, lines in broken_rules(ast.parse(source), source, {"Line"}).items()}
    assert counts == dict.fromkeys(counts, 0) | {rule: 1}


def test_plain_code_has_no_places():
    source = "mean = 1\nline = Line(1, 2, 3, name=4)\nfirst, second = pair\n" + "# comment\n" * 400
    assert all(lines == [] for lines in broken_rules(ast.parse(source), source, {"Line"}).values())


def lower_list():
    """Write the number of remaining places where it is lower than the one that the list allows."""
    text = ALLOWED.read_text("utf-8")
    allowed = tomllib.loads(text)
    lines = [line for line in text.splitlines() if line.startswith("#")]
    for rule, lines_of in remaining_places().items():
        lines.append(f"\n[{rule}]")
        for file, places in lines_of.items():
            count = min(len(places), allowed.get(rule, {}).get(file, 0))
            if count:
                lines.append(f'"{file}" = {count}')
    ALLOWED.write_text("\n".join(lines) + "\n", "utf-8")


if __name__ == "__main__":
    lower_list()
