"""One public name, one meaning, one module; texts that name things."""

import ast
import re
import tokenize
from collections import Counter, defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "hdassist"
IN_PLACE_OF_A_NOUN = {"what": 20, "told": 1, "said": 3, "nothing": 3}  # words, and how many of 10 000 they may be


def public_names(file):
    """Functions, classes and constants that a module defines for others."""
    for node in ast.parse(file.read_text("utf-8")).body:
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


def texts():
    """Docstrings and comments of the package, and the pages."""
    for file in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                yield ast.get_docstring(node) or ""
        with file.open("rb") as stream:
            yield from (each.string for each in tokenize.tokenize(stream.readline) if each.type == tokenize.COMMENT)
    yield from (page.read_text("utf-8") for page in (ROOT / "README.md", *(ROOT / "docs").glob("*.md")))


def test_texts_name_things():
    counted = Counter(word for text in texts() for word in re.findall(r"[a-z]+", text.lower()))
    share = {word: 10_000 * counted[word] / counted.total() for word in IN_PLACE_OF_A_NOUN}
    assert {word: found for word, found in share.items() if found >= IN_PLACE_OF_A_NOUN[word]} == {}
