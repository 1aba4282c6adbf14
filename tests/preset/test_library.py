"""Finding presets: by name, by path, from standard input, and what is said when there is none."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hdassist.drive.loading import load_preset
from hdassist.drive.preset.fields import field_table, measures, origin_counts
from hdassist.drive.preset.text import read_yaml
from hdassist.features.calibration import read_targets
from hdassist.run.errors import DataError, PresetError, UsageError
from hdassist.run.files import preset_names, read_preset
from tests.helpers.process import posix_only

ROOT = Path(__file__).parents[2]


def test_the_library_holds_the_presets_of_the_repository() -> None:
    assert preset_names() == sorted(file.stem for file in (ROOT / "presets").glob("*.yaml"))
    assert "vzp160" in preset_names()


@pytest.mark.parametrize("name", preset_names())
def test_every_preset_loads_without_warnings_and_sources_its_values(name: str) -> None:
    drive = load_preset(name)
    assert drive.name == name
    assert drive.origin.file == name
    assert drive.origin.warnings == ()
    given = {
        f"{section}.{field}"
        for section in type(drive).model_fields
        if hasattr(getattr(drive, section), "model_fields_set")
        for field in getattr(drive, section).model_fields_set
        if getattr(getattr(drive, section), field) is not None
    }
    assert given == set(drive.source)


@pytest.mark.parametrize("name", preset_names())
def test_assumed_preset_values_have_ranges_and_all_deviations_are_written(name: str) -> None:
    drive = load_preset(name)
    guesses = {path for path, entry in drive.source.items() if entry.kind != "given" and path in measures()}
    without = {path for path in guesses if drive.source[path].range is None}
    assert {path for path in without if path.partition(".")[0] in ("flexspline", "bearing", "cam", "supports")} == set()
    assert {"gears.j_n", "contact.c_t", "contact.c_ball", "cam.W_0"} & without == set()
    written = {f"{section}.{field}" for section in ("tolerances", "phases", "harmonics")
               for field in getattr(drive, section).model_fields_set}  # fmt: skip
    assert {p for p in field_table() if p.startswith(("tolerances.", "phases.", "harmonics.a_"))} <= written


def test_the_synthetic_drive_says_what_it_is() -> None:
    drive = load_preset("synthetic-160-162")
    assert drive.description.startswith("Synthetic")
    assert {source.kind for source in drive.source.values()} == {"assumed"}


def test_vzp160_differs_from_its_reference_only_in_identified_values() -> None:
    reference = load_preset(str(ROOT / "tests/validation/vzp160_reference.yaml"))
    drive = load_preset("vzp160")
    identified = {path for path, entry in drive.source.items() if entry.kind == "identified"}
    whole = {"numerics.nominal_curve", "numerics.stations", "contact.c_t"}
    back = drive.with_values({path: reference.value(path) for path in identified | whole})
    assert {drive.value(f"harmonics.{name}") for name in type(drive.harmonics).model_fields if "a_" in name} == {0.0}
    told = {"name", "description", "source", "harmonics", "fit"}
    assert back.model_dump(exclude=told) == reference.model_dump(exclude=told)


def test_identified_values_of_vzp160_are_bounded_unknowns_of_its_targets() -> None:
    drive = load_preset("vzp160")
    text = (ROOT / "docs/vzp160.targets.yaml").read_bytes()
    unknowns = {unknown.path: unknown for unknown in read_targets(text, "targets", drive).unknowns}
    identified = {path for path, entry in drive.source.items() if entry.kind == "identified"}
    assert identified == set(unknowns) | {"bearing.g_b"}  # which benchmarks.identify leaves free beside them
    others = read_yaml((ROOT / "tests/validation/vzp160_alternatives.yaml").read_bytes(), "alternatives").data
    assert others
    for path, unknown in unknowns.items():
        for value in (drive.value(path), *(other[path] for other in others)):
            assert unknown.low <= value <= unknown.high, path
    assert identified <= set(drive.fit)
    for path in identified:
        low, high = drive.source[path].range or (0.0, 0.0)
        assert low <= min(drive.fit[path]) <= drive.value(path) <= max(drive.fit[path]) <= high, path


def test_a_path_is_read_and_named_as_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "my.yaml").write_bytes(read_preset("vzp160")[0])
    monkeypatch.chdir(tmp_path)
    assert load_preset("my.yaml", ["cam.W_0=0.95"]).cam.W_0 == 0.95
    assert load_preset("./my.yaml").origin.file == "./my.yaml"


def test_the_library_comes_before_a_file_of_the_same_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "vzp160").write_text("name: other")
    monkeypatch.chdir(tmp_path)
    assert load_preset("vzp160").name == "vzp160"
    with pytest.raises(PresetError):
        load_preset("./vzp160")


def test_standard_input_is_named_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(read_preset("vzp160")[0])))
    assert load_preset("-").origin.file == "<stdin>"
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"a: [")))
    with pytest.raises(PresetError, match="<stdin>:1:5: not valid YAML"):
        load_preset("-")


def test_closed_standard_input_is_said_plainly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", None)
    with pytest.raises(DataError, match="cannot read standard input"):
        load_preset("-")


@pytest.mark.parametrize(
    ("name", "message", "hint"),
    [
        ("vzp161", "no such preset or file: vzp161", "the nearest name is vzp160"),
        ("VZP160", "no such preset or file: VZP160", "the nearest name is vzp160"),
        ("qqqq", "no such preset or file: qqqq", "size-65-100, synthetic-160-162, vzp160"),
        ("gone.yaml", "no such file: gone.yaml", "presets of the library:"),
        ("", "no such preset or file: an empty name", "presets of the library:"),
        (".", ". is a directory, not a preset", "name a file in it"),
        ("a\0b", "cannot read a\0b: embedded null", ""),
        pytest.param("x" * 5000, "File name too long", "", marks=posix_only("Windows knows no such error")),
    ],
)
def test_what_cannot_be_read_is_said_plainly(name: str, message: str, hint: str) -> None:
    with pytest.raises(DataError) as caught:
        load_preset(name)
    assert caught.value.exit_code == 4
    assert message in caught.value.message
    assert hint in caught.value.hint


def test_a_file_beside_of_that_name_is_offered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own40.yaml").write_bytes(read_preset("vzp160")[0])
    monkeypatch.chdir(tmp_path)
    here = str(tmp_path / "own40")
    for name, file in {
        "own40": "own40.yaml",
        "./own40": "./own40.yaml",
        here: "own40.yaml",
        "ownn40.yaml": "own40.yaml",
    }.items():
        with pytest.raises(DataError) as caught:
            load_preset(name)
        assert caught.value.hint.startswith("the nearest name is ") and file in caught.value.hint
    with pytest.raises(DataError, match="no such"):
        load_preset("a" * 253)


def test_oversized_or_endless_file_is_not_read_completely() -> None:
    with pytest.raises(PresetError, match="larger than 256 KiB"):
        load_preset("/dev/zero")


def test_bad_overrides_are_wrong_usage() -> None:
    with pytest.raises(UsageError, match="--set:1:1"):
        load_preset("vzp160", ["cam.w0=1"])


def test_the_names_cost_no_heavy_import() -> None:
    code = "import sys; from hdassist.run.files import preset_names as p; p(); print(*sorted(sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    assert not {"pydantic", "yaml", "numpy"} & set(loaded.split())


def test_only_files_with_similar_names_are_suggested_for_any_suffix(tmp_path):
    for name in ("gearset.yaml", "my-drive.yaml", "own.yaml"):
        (tmp_path / name).write_text("", encoding="utf-8")
    for missing, offered in (("nofile.yaml", ""), ("mydrive.yml", "my-drive.yaml"), ("onw.yaml", "own.yaml")):
        with pytest.raises(DataError) as caught:
            load_preset(str(tmp_path / missing))
        meant = re.match(r"the nearest name is (.*?)(?:; |$)", caught.value.hint)
        assert (Path(meant[1]).name if meant else "") == offered


def test_origin_counts_are_those_of_the_preset_file() -> None:
    own = origin_counts(load_preset("size-25-100"))
    assert origin_counts(load_preset("size-25-100", ["operation.M_g=[6.7]"])) == own
