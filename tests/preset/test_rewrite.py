"""Values put into the text of a preset, which stays as it is otherwise."""

import difflib
from pathlib import Path

import pytest

from hdassist import load_preset
from hdassist.errors import DataError
from hdassist.preset.load import load_text
from hdassist.preset.schema import resolved
from hdassist.preset.write import with_found_values
from tests.process import SMALL

VZP160 = (Path(__file__).parents[2] / "presets/vzp160.yaml").read_text(encoding="utf-8")
VZP160 = VZP160.split("\nalternatives:")[0] + "\n"
FOUND = {"gears.j_n": 6.134, "supports.C_2": 20230.0, "contact.c_t": 1.505e-05}


def test_values_and_their_source_change_and_nothing_else():
    text = with_found_values(VZP160, "vzp160", FOUND, 'rig "3"')
    drive = load_text(text, "vzp160")
    assert {path: drive.value(path) for path in FOUND} == FOUND
    rows = {row.path: row for row in resolved(drive)}
    assert all((rows[path].kind, rows[path].ref) == ("identified", 'rig "3"') for path in FOUND)
    removed = [line[2:] for line in difflib.ndiff(VZP160.splitlines(), text.splitlines()) if line.startswith("- ")]
    added = [line[2:] for line in difflib.ndiff(VZP160.splitlines(), text.splitlines()) if line.startswith("+ ")]
    assert len(removed) == len(added) == 6
    assert "  j_n: 6.134        # um, clearance per flank" in added


def test_a_preset_in_flow_style_and_without_sources():
    text = Path(SMALL).read_text(encoding="utf-8")
    found = load_text(with_found_values(text, "small", FOUND, "rig"), "small")
    assert {path: found.value(path) for path in FOUND} == FOUND
    assert set(found.source) == set(FOUND)
    assert found.tolerances == load_preset(SMALL).tolerances


def test_alternatives_are_written_and_replaced():
    others = [{"gears.j_n": 4.0}, {"gears.j_n": 9.5, "contact.c_t": 3e-05}]
    text = with_found_values(VZP160, "vzp160", FOUND, "rig", others)
    assert list(load_text(text, "vzp160").alternatives) == others
    again = with_found_values(text, "vzp160", FOUND, "rig", others[:1])
    assert list(load_text(again, "vzp160").alternatives) == others[:1]
    assert load_text(with_found_values(again, "vzp160", FOUND, "rig"), "vzp160").alternatives == ()


def test_twice_is_once():
    once = with_found_values(VZP160, "vzp160", FOUND, "rig", [{"gears.j_n": 4.0}])
    twice = with_found_values(once, "vzp160", FOUND, "rig", [{"gears.j_n": 4.0}])
    assert [line for line in twice.splitlines() if line] == [line for line in once.splitlines() if line]


@pytest.mark.parametrize(
    "text",
    [
        VZP160.replace("source:\n", "source: {gears.alpha: {kind: given}}\nother_source:\n"),
        VZP160.replace("  j_n: 6.751        # um, clearance per flank\n", ""),
    ],
)
def test_a_text_that_cannot_be_changed_is_refused(text):
    with pytest.raises(DataError) as error:
        with_found_values(text, "mine.yaml", FOUND, "rig")
    assert "mine.yaml" in error.value.message
    assert error.value.hint
