"""The preset to start from, and values put into the text of a preset, which stays as it is otherwise."""

from __future__ import annotations

import difflib
import re
from pathlib import Path

import pytest

from hdassist import load_preset
from hdassist.drive.loading import load_text, with_changes, with_found_values
from hdassist.drive.preset.fields import field_table, resolved_fields
from hdassist.run.errors import DataError, UsageError
from tests.helpers.process import SMALL
from tests.helpers.support import fresh_preset


def test_presets_new_writes_a_valid_preset_of_assumed_values() -> None:
    drive, like = load_text(fresh_preset("my-drive"), "f"), load_preset("vzp160")
    assert drive.name == "my-drive"
    assert drive.origin.warnings == ()
    assert {source.kind for source in drive.source.values()} == {"assumed"}
    assert (drive.gears, drive.flexspline) == (like.gears, like.flexspline)


def test_line_of_a_new_preset_states_unit_and_meaning() -> None:
    lines = dict(re.findall(r"^  (\w+): \S+ .*?# (.*)$", fresh_preset("x").split("\nsource:")[0], re.MULTILINE))
    for path, field in field_table().items():
        name = path.split(".")[1]
        assert field.is_required <= (name in lines)
        if name in ("x_g", "W_0", "E", "e_hb", "phi_hb"):
            assert lines[name] == ", ".join(filter(None, (field.unit, field.meaning)))


@pytest.mark.thorough
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
    assert load_text(fresh_preset(name), "f").name == name


@pytest.mark.parametrize("name", ["", "a\nb", "\x00", "x" * 201, "\ud800"])
def test_other_names_are_wrong_usage(name: str) -> None:
    with pytest.raises(UsageError):
        fresh_preset(name)


VZP160 = (Path(__file__).parents[2] / "presets/vzp160.yaml").read_text(encoding="utf-8")
FOUND = {"gears.j_n": 6.134, "supports.C_2": 20230.0, "contact.c_t": 1.505e-05}


def test_values_and_their_source_change_and_nothing_else():
    text = with_found_values(VZP160, "vzp160", FOUND, 'rig "3"')
    drive = load_text(text, "vzp160")
    assert {path: drive.value(path) for path in FOUND} == FOUND
    rows = {row.path: row for row in resolved_fields(drive)}
    assert all((rows[path].kind, rows[path].ref) == ("identified", 'rig "3"') for path in FOUND)
    assert [rows[path].range for path in FOUND] == [(0, 20), (5e3, 1e5), (0.3e-5, 6e-5)]
    before = VZP160.partition("\n# Equally likely")[0]  # the fit goes
    removed = [line[2:] for line in difflib.ndiff(before.splitlines(), text.splitlines()) if line.startswith("- ")]
    added = [line[2:] for line in difflib.ndiff(before.splitlines(), text.splitlines()) if line.startswith("+ ")]
    assert len(removed) == len(added) == 6
    assert "  j_n: 6.134        # um, clearance per flank" in added


def test_a_preset_in_flow_style_and_without_sources():
    text = Path(SMALL).read_text(encoding="utf-8")
    found = load_text(with_found_values(text, "small", FOUND, "rig"), "small")
    assert {path: found.value(path) for path in FOUND} == FOUND
    assert set(found.source) == set(FOUND)
    assert found.tolerances == load_preset(SMALL).tolerances


def test_a_range_that_the_found_value_has_left_goes():
    found = load_text(with_found_values(VZP160, "vzp160", {"gears.j_n": 21.0}, "rig"), "vzp160")
    assert found.source["gears.j_n"].range is None


def test_twice_is_once():
    once = with_found_values(VZP160, "vzp160", FOUND, "rig")
    twice = with_found_values(once, "vzp160", FOUND, "rig")
    assert [line for line in twice.splitlines() if line] == [line for line in once.splitlines() if line]


@pytest.mark.parametrize(
    "layout", ["contact:\n  c_ball: 2e-5  # mm/N\n", "contact: {c_ball: 2e-5}\n", "contact:\n", ""]
)
def test_a_field_that_was_left_to_its_default_is_added(layout):
    small = Path(SMALL).read_text(encoding="utf-8")
    start = small.index("contact:")
    rest = small[start:].partition("\n")[2]
    while rest.startswith((" ", "#")):
        rest = rest.partition("\n")[2]
    found = load_text(with_found_values(small[:start] + layout + rest, "mine.yaml", {"contact.k_face": 9.5}, "rig"), "")
    assert found.contact.k_face == 9.5
    assert found.contact.c_ball == load_text(small[:start] + layout + rest, "").contact.c_ball
    assert found.source["contact.k_face"].kind == "identified"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (VZP160[VZP160.index("\nsource:") :], "\nsource: {gears.j_n: {kind: assumed, range: [0, 20]}}\n"),
        ("\ngears:", "\n# of all pairs\n\ngears:"),
        ("\n  j_n: ", "\n  j_n:\n    "),
    ],
)
def test_a_text_of_any_layout_can_be_changed(old, new):
    text = VZP160.replace(old, new)
    assert text != VZP160
    found = load_text(with_found_values(text, "mine.yaml", FOUND, "rig"), "mine.yaml")
    assert {path: found.value(path) for path in FOUND} == FOUND
    assert found.source["gears.j_n"].range == (0, 20)


def test_a_text_that_is_no_preset_is_refused():
    with pytest.raises(DataError, match=r"mine\.yaml:[0-9]+:6: cam: must be a table of keys"):
        with_found_values(VZP160.replace("\ncam:", "\ncam: [1]\nother_cam:"), "mine.yaml", FOUND, "rig")


@pytest.mark.parametrize(
    "numerics",
    ["numerics: {n_max: 20, n_2: 40, n_phase: 4}", "numerics: {}", "numerics:", "",
     "numerics:  # few\n    # words\n    n_phase: 4  # fast", "numerics: {nominal_curve: linear}"],
)  # fmt: skip
def test_preset_records_the_model_of_its_identified_values(numerics: str) -> None:
    small = Path(SMALL).read_text(encoding="utf-8")
    start = small.index("numerics:")
    text = small[:start] + numerics + small[small.index("\n", start) :]
    curve = "linear" if "linear" in numerics else "inextensible"
    model = {"nominal_curve": "inextensible", "stations": 5}
    drive = load_text(with_found_values(text, "small", FOUND, "rig", model=model), "small")
    assert drive.numerics == load_text(text, "small").numerics.model_copy(update=model | {"nominal_curve": curve})
    assert not drive.origin.warnings
    warnings = load_text(with_found_values(text, "small", FOUND, "rig"), "small").origin.warnings
    assert ["stations" in warning for warning in warnings] == [True] if curve == "linear" else [False, True]


def test_changes_keep_comments_and_sequence_and_become_assumed_values() -> None:
    changed = with_changes(VZP160.encode(), "vzp160", ["gears.j_n=7.5", "operation.M_g=[80]", "mounting.holes=6"])
    lines = list(difflib.ndiff(VZP160.splitlines(), changed.splitlines()))
    assert {line[2:] for line in lines if line.startswith("- ")} == {
        "  j_n: 0.48         # um, clearance per flank",
        "  M_g: [80, 800]    # N*m",
        '  gears.j_n: {kind: identified, range: [0, 20], ref: "tooth thinning; Fig. 2 and 3 allow 0 to 3 um"}',
        '  operation.M_g: {kind: given, ref: "p. 6, Fig. 2 and 3"}',
    }
    assert {line[2:] for line in lines if line.startswith("+ ")} == {
        "  j_n: 7.5          # um, clearance per flank",
        "  M_g: [80]         # N*m",
        "  holes: 6",
        '  gears.j_n: {kind: assumed, range: [0.0, 20.0], ref: "changed manually; was identified"}',
        '  operation.M_g: {kind: assumed, ref: "changed manually; was given"}',
    }
    drive = load_text(changed, "vzp160")
    assert (drive.gears.j_n, drive.operation.M_g, drive.mounting.holes) == (7.5, (80.0,), 6)
    assert drive.source["gears.j_n"].kind == "assumed" and drive.source["gears.m"].kind == "given"


def test_a_changed_value_outside_its_range_leaves_the_range() -> None:
    changed = with_changes(VZP160.encode(), "vzp160", ["gears.j_n=30"])
    source = load_text(changed, "vzp160").source["gears.j_n"]
    assert (source.kind, source.range) == ("assumed", None)


def test_invalid_changes_and_changes_outside_fields_are_refused() -> None:
    text = VZP160.encode()
    with pytest.raises(UsageError, match="must be from"):
        with_changes(text, "vzp160", ["gears.j_n=-1"])
    with pytest.raises(DataError, match="cannot be saved"):
        with_changes(text, "vzp160", ["uncertainty.gears.j_n=1"])


@pytest.mark.thorough
@pytest.mark.parametrize("override", ["measured.F_ior.h0@80=29 ± 3", "acceptance.F_ior.80=30"])
@pytest.mark.parametrize("limit", ["", "acceptance: {F_ior: 45}\n"])
def test_an_entry_of_a_table_is_written(override: str, limit: str) -> None:
    text = f"{VZP160}\n{limit}" if "acceptance:" not in VZP160 else VZP160
    there = load_text(with_changes(text.encode(), "vzp160", [override]), "vzp160")
    wanted = load_text(text, "vzp160", [override])
    assert there.acceptance == wanted.acceptance and there.measured == wanted.measured


def test_a_list_of_lines_can_be_changed() -> None:
    text = VZP160.replace("M_g: [80, 800]", "M_g:\n  - 80\n  - 800")
    assert load_text(with_changes(text.encode(), "vzp160", ["operation.M_g=[80]"]), "vzp160").operation.M_g == (80,)
