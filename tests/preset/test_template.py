"""The preset to start from is valid, complete and honest about its numbers."""

from __future__ import annotations

import pytest

from hdassist.errors import UsageError
from hdassist.preset.fields import fields
from hdassist.preset.kinds import unit_of
from hdassist.preset.load import load_text
from hdassist.preset.write import new_preset


def test_it_is_valid_as_it_stands_and_says_that_its_numbers_are_examples() -> None:
    drive = load_text(new_preset("my-drive"), "f")
    assert drive.name == "my-drive"
    assert drive.origin.warnings == ()
    assert "example" in drive.description.lower()
    assert "EVERY NUMBER BELOW IS AN EXAMPLE" in new_preset("x")


def test_it_names_every_field_with_unit_and_meaning() -> None:
    lines = new_preset("x").splitlines()
    for path, info in fields():
        name = path.split(".")[1]
        (line,) = (line for line in lines if line.lstrip("# ").startswith(f"{name}: ") or f" {name}:" in line[:14])
        assert line.endswith(str(info.description))
        assert f"# {unit_of(info)}" in line
        assert info.is_required() <= (not line.startswith("#"))


def test_what_is_commented_out_is_valid_too() -> None:
    text = new_preset("x")
    opened = "\n".join(
        line[1:] if line.startswith(("#  ", "#material", "#contact", "#phases", "#mounting", "#acceptance",
                                     "#numerics", "#source")) else line
        for line in text.splitlines()
        if "d_ball:" not in line
    )  # fmt: skip
    drive = load_text(opened, "f")
    assert drive.model_dump(exclude={"source"}) == load_text(text, "f").model_dump(exclude={"source"})
    assert "numerics" in drive.model_fields_set


@pytest.mark.parametrize(
    "name",
    [
        "null",
        "true",
        "58",
        "1e3",
        "a: b",
        "a #b",
        "- x",
        'say "hi"',
        "it's",
        "é",
        "[x",
        "&a",
        "@",
        " x ",
        "12:30",
    ],
)
def test_any_printable_name_survives(name: str) -> None:
    assert load_text(new_preset(name), "f").name == name


@pytest.mark.parametrize("name", ["", "a\nb", "\x00", "x" * 201, "\ud800"])
def test_other_names_are_wrong_usage(name: str) -> None:
    with pytest.raises(UsageError):
        new_preset(name)
