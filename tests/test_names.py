"""One public name, one meaning, one module."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "hdassist"
MOST_WORDS_OF_TEST = 10


@cache
def tree_of(file):
    """The syntax tree of a file, parsed once for all tests."""
    return ast.parse(file.read_text("utf-8"))


def public_names(file):
    """Functions, classes and constants that a module defines for others."""
    for node in tree_of(file).body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.name
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        yield from (name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name))


def test_no_public_name_is_defined_in_two_modules():
    homes = defaultdict(set)
    for file in PACKAGE.rglob("*.py"):
        for name in public_names(file):
            if not name.startswith("_"):
                homes[name].add(str(file.relative_to(PACKAGE)))
    twice = {name: sorted(files) for name, files in homes.items() if len(files) > 1}
    assert not twice


def names_taken():
    """Names that a module of the package, a test or a benchmark takes from another, also by a string, and those that
    declarations and pages for contributors speak of."""
    others = [ROOT / "CONTRIBUTING.md", ROOT / "docs" / "architecture.md"]
    for text in (*PACKAGE.rglob("*.toml"), *others):
        yield from re.findall(r"\w+", text.read_text("utf-8"))
    for root in (PACKAGE, ROOT / "tests", ROOT / "benchmarks"):
        for file in root.rglob("*.py"):
            for node in ast.walk(tree_of(file)):
                if isinstance(node, ast.ImportFrom):
                    yield from (alias.name for alias in node.names)
                elif isinstance(node, ast.Attribute):
                    yield node.attr
                elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                    yield from re.findall(r"\w+", node.value)


def fields_of_answers(file):
    """Classes whose names a JSON schema or the command line shows."""
    for node in tree_of(file).body:
        if isinstance(node, ast.ClassDef):
            bases = {base.id for base in node.bases if isinstance(base, ast.Name)}
            if node.name.endswith("Command") or bases & {"BaseModel", "ClosedRecord", "Section"}:
                yield node.name


def test_what_its_module_alone_uses_is_private():
    taken = set(names_taken())
    alone = {
        f"{file.relative_to(PACKAGE)}: {name}"
        for file in PACKAGE.rglob("*.py")
        for name in set(public_names(file)) - set(fields_of_answers(file)) - taken
        if not name.startswith("_")
    }
    assert alone == set()


def test_no_test_name_has_more_than_ten_words():
    long_names = [
        f"{file.relative_to(ROOT)}: {node.name}"
        for file in (ROOT / "tests").rglob("*.py")
        for node in ast.walk(tree_of(file))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and node.name.startswith("test_")
        and len(node.name.removeprefix("test_").split("_")) > MOST_WORDS_OF_TEST
    ]
    assert long_names == []
