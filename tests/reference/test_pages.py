"""The reference pages are those that the code declares."""

import pytest

from tests.reference.pages import DOCS, made, symbol_table


@pytest.mark.parametrize("name", ["commands.md", "fields.md", "glossary.md"])
def test_a_page_is_not_stale(name: str) -> None:
    assert (DOCS / name).read_text("utf-8") == made()[DOCS / name], "python -m tests.reference"


def test_the_theory_has_the_symbols_of_the_glossary() -> None:
    assert "\n".join(symbol_table()) in (DOCS / "theory.md").read_text("utf-8")


def test_every_command_and_field_stands_in_them() -> None:
    commands, fields = made()[DOCS / "commands.md"], made()[DOCS / "fields.md"]
    for words in ("## hdassist mount", "### hdassist presets new", "--probability"):
        assert words in commands
    for words in ("| `F_i1` | ", "| um |", "0 to 1000", "| unknown |", "`cost`"):
        assert words in fields
