"""`hdassist presets`: streams, exit codes, tables that cut nothing, JSON that others read."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from hdassist import __version__
from hdassist.belief.evidence import evidence_of
from hdassist.drive.loading import SCHEMA_FILE, load_text
from hdassist.drive.preset.fields import Drive, field_table, origin_counts
from hdassist.interface.cli import app
from hdassist.run.errors import DataError, HdassistError, PresetError, UsageError
from hdassist.run.files import preset_names, read_preset
from tests.helpers.process import on_terminal

ROOT = Path(__file__).parents[2]


def run(*arguments: str, stdin: str | bytes | None = None) -> Result:
    return CliRunner().invoke(app, ["presets", *arguments], input=stdin)


def answer(*arguments: str, exit_code: int = 0) -> dict[str, Any]:
    result = run(*arguments, "--json")
    assert result.exit_code == exit_code
    found: dict[str, Any] = json.loads(result.stdout)
    assert found["version"] == __version__
    assert found["exit_code"] == exit_code
    return found


@pytest.fixture
def bad(tmp_path: Path) -> str:
    file = tmp_path / "bad.yaml"
    file.write_bytes(read_preset("vzp160")[0].replace(b"W_0: 0.96", b"W_0: 1.2 m").replace(b"z_b: 202", b"z_b: no"))
    return str(file)


def test_list_shows_each_preset_in_one_line() -> None:
    result = run("list")
    assert (result.exit_code, result.stderr) == (0, "")
    for name, *cells in (
        ("vzp160", "100", "160", "-"),
        ("synthetic-160-162", "80", "80", "-"),
    ):
        (line,) = (line for line in result.stdout.splitlines() if line.startswith(name))
        assert line.split()[1:4] == cells
    assert [line.split()[0] for line in result.stdout.splitlines()][-len(preset_names()) :] == preset_names()


def test_list_as_json() -> None:
    found = answer("list")
    assert found["schema"] == "hdassist.presets-list/1"
    assert [entry["preset"]["name"] for entry in found["presets"]] == preset_names()
    assert {"z_g", "z_b", "m_mm", "values", "description"} <= set(found["presets"][0])


def test_show_gives_the_bytes_as_they_are() -> None:
    assert run("show", "vzp160").stdout_bytes == read_preset("vzp160")[0]


def test_show_reads_standard_input() -> None:
    assert run("show", "-", stdin="name: µ\r\n").stdout_bytes == "name: µ\r\n".encode()


def test_resolved_shows_every_field_with_value_and_origin() -> None:
    result = run("show", "vzp160", "--set", "numerics.n_2=120", "--set", "cam.W_0=0.9598765432101", "--resolved")
    lines = {line.split()[0]: line.split() for line in result.stdout.splitlines() if "." in line.split()[0]}
    assert set(lines) == set(field_table())
    assert lines["cam.W_0"][1:5] == ["0.9598765432101", "mm", "override", "--set"]
    assert lines["supports.C_1"][1:4] == ["1e7", "N/mm", "identified"]
    assert lines["mounting.holes"][1:3] == ["12", "default"]
    assert lines["contact.c_bore"][1:4] == ["1e-7", "mm/N", "assumed"]


def test_resolved_as_json() -> None:
    found = answer("show", "vzp160", "--set", "operation.M_g=80")
    assert found["schema"] == "hdassist.presets-show/1"
    assert found["preset"]["overrides"] == ["operation.M_g=80"]
    assert len(found["preset"]["sha256"]) == 64
    torque = next(row for row in found["fields"] if row["path"] == "operation.M_g")
    assert torque == {
        "path": "operation.M_g", "value": [80], "unit": "N*m", "kind": "override", "ref": "--set",
        "meaning": "load torques on the flexspline, counter-clockwise positive", "range": None,
    }  # fmt: skip
    assert next(row for row in found["fields"] if row["path"] == "gears.j_n")["range"] == [0, 20]


class Terminal(io.StringIO):
    encoding = "utf-8"  # type: ignore[assignment]

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("columns", [80, 100, 200])
def test_on_a_terminal_the_table_fits_and_cuts_no_number(columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr("sys.stdout", terminal)
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setenv("NO_COLOR", "1")
    app(["presets", "show", "vzp160", "--resolved"], standalone_mode=False)
    text = terminal.getvalue()
    assert max(map(len, text.splitlines())) <= columns
    assert "\x1b" not in text and "…" not in text
    for number in ("1e7", "2.66e-5", "80, 800", "14.3"):
        assert re.search(rf"\s{number}\s", text)


def test_in_a_pipe_no_reference_is_wrapped() -> None:
    (line,) = (line for line in run("show", "vzp160", "--resolved").stdout.splitlines() if "contact.c_ball" in line)
    assert line.rstrip().endswith(
        "1.25e-5 to 2.857e-5; ISO/TS 16281 ball, tangent at 100-1000 N; Fig. 2 and 3 allow 1.9e-5 to 2.7e-5"
    )
    assert len(line) > 80


def test_ascii_has_no_other_characters(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(run("new", "x").stdout.replace("as vzp160", "±5 µm"), encoding="utf-8")
    result = run("show", str(file), "--resolved", "--ascii")
    assert result.stdout.isascii()
    assert "+-5 um" in result.stdout


def test_validate_says_ok_on_stdout() -> None:
    result = run("validate", "vzp160", "synthetic-160-162")
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout == "vzp160: OK; assumed values: 16\nsynthetic-160-162: OK; assumed values: 49\n"


def test_validate_counts_assumed_values_until_they_are_declared_given() -> None:
    form = run("new", "x").stdout
    examples = form.count("kind: assumed")
    assert run("validate", "-", stdin=form).stdout == f"-: OK; assumed values: {examples}\n"
    given = form.replace("gears.z_g: {kind: assumed", "gears.z_g: {kind: given")
    assert run("validate", "-", stdin=given).stdout == f"-: OK; assumed values: {examples - 1}\n"
    all_given = re.sub(r", range: [^]}]*]", "", form.replace("kind: assumed", "kind: given"))
    assert run("validate", "-", stdin=all_given).stdout == "-: OK\n"
    assert answer("validate", "vzp160")["values"] == {"given": 33, "identified": 10, "assumed": 16}


def test_validate_shows_every_error_of_every_preset(bad: str) -> None:
    result = run("validate", bad, "vzp160", "vzp161")
    assert result.exit_code == 4
    assert result.stdout == "vzp160: OK; assumed values: 16\n"
    line = Path(bad).read_text(encoding="utf-8").splitlines().index("  W_0: 1.2 m         # mm, 1.2 modules") + 1
    assert f"{bad}:{line}:8: cam.W_0: the unit m is ambiguous" in result.stderr
    assert "gears.z_b: must be a whole number (got no)" in result.stderr
    assert "no such preset or file: vzp161" in result.stderr


def test_validate_as_json_carries_the_findings(bad: str) -> None:
    found = answer("validate", bad, exit_code=4)
    assert found["valid"] is False
    assert {"file", "line", "column", "path", "message", "got", "hint"} == set(found["findings"][0])
    assert [finding["path"] for finding in found["findings"]] == ["gears.z_b", "cam.W_0"]
    several = answer("validate", "vzp160", bad, exit_code=4)
    assert [result["valid"] for result in several["results"]] == [True, False]
    assert [result["exit_code"] for result in several["results"]] == [0, 4]


def test_validate_shows_warnings_on_stderr(tmp_path: Path) -> None:
    file = tmp_path / "a.yaml"
    file.write_text(run("new", "x").stdout + "acceptance: {F_ior: {7: 30}}\n", encoding="utf-8")
    result = run("validate", str(file))
    assert result.exit_code == 0
    assert "the torque of this limit is not in operation.M_g" in result.stderr
    assert answer("validate", str(file))["warnings"]


def test_a_bad_override_is_exit_code_2() -> None:
    result = run("validate", "vzp160", "--set", "cam.W_0=1.2 m")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "--set:1:9: cam.W_0: the unit m is ambiguous" in result.stderr
    assert run("validate", "vzp160").exit_code == 0


def test_a_bad_override_hides_no_invalid_preset(bad: str) -> None:
    several = answer("validate", "vzp160", bad, "--set", "gears.j_n=900", exit_code=4)
    assert [(found["file"], found["error"]["code"]) for found in several["results"]] == [
        ("vzp160", "USAGE"), (bad, "FILE_INVALID"),
    ]  # fmt: skip
    assert [finding["path"] for finding in several["results"][1]["findings"]] == ["gears.z_b", "cam.W_0", "gears.j_n"]


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["show", "vzp161"], DataError),
        (["show", "vzp161", "--resolved"], DataError),
        (["show", "vzp160", "--set", "cam.W_0"], UsageError),
        (["show", "-", "--resolved"], PresetError),
        (["new", ""], UsageError),
        (["new", "x", "-o", "gone/x.yaml"], DataError),
    ],
)
def test_errors_are_those_that_know_their_exit_code(arguments: list[str], error: type[HdassistError]) -> None:
    result = run(*arguments, stdin="")
    assert type(result.exception) is error
    assert result.stdout == ""


def test_new_prints_a_valid_preset() -> None:
    result = run("new", "my drive")
    assert load_text(result.stdout, "f").name == "my drive"
    assert result.stdout.isascii()
    assert run("validate", "-", stdin=result.stdout).stdout.startswith("-: OK; ")


def test_new_writes_a_file_once(tmp_path: Path) -> None:
    file = tmp_path / "my.yaml"
    result = run("new", "mine", "-o", str(file))
    assert (result.exit_code, result.stdout, result.stderr) == (0, "", f"wrote {file}\n")
    assert isinstance(run("new", "other", "-o", str(file)).exception, UsageError)
    assert "name: mine\n" in file.read_text()
    assert run("new", "other", "-o", str(file), "--force").exit_code == 0
    assert "name: other\n" in file.read_text()


@pytest.mark.thorough
@pytest.mark.parametrize("arguments", [["--help"], ["show", "--help"], ["validate", "--help"]])
def test_help_imports_nothing_heavy(arguments: list[str]) -> None:
    code = (
        "import sys; from typer.testing import CliRunner; from hdassist.interface.cli import app\n"
        f"assert CliRunner().invoke(app, {['presets', *arguments]}).exit_code == 0\n"
        "print(*sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, text=True)
    loaded = set(run.stdout.split())
    assert not ({"yaml", "numpy", "cvxpy", "hdassist.drive.preset.fields"}) & loaded


@pytest.mark.thorough
@pytest.mark.parametrize("command", [("presets", "list"), ("presets", "show", "vzp160", "--resolved")])
@pytest.mark.parametrize("columns", [60, 80])
def test_tables_stay_within_a_terminal(command: tuple[str, ...], columns: int) -> None:
    code, page = on_terminal(*command, columns=columns, env={"NO_COLOR": "1"})
    assert code == 0
    assert max(map(len, page.splitlines())) <= columns
    assert "synthetic-160-162" in page or "1e7" in page


def test_presets_list_in_a_pipe_prints_one_line_per_preset() -> None:
    found = run("list")
    lines = found.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    assert "…" not in found.stdout
    for name in preset_names():  # whatever a script would look for stands on one line
        assert re.search(rf"^{name} +\d+ +[\d.]+ +[\d.-]+ +\d+, \d+, \d+$", found.stdout, re.MULTILINE)


def made(*arguments: str) -> Drive:
    """The drive that `presets new` makes."""
    result = run("new", "own", *arguments)
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout.isascii()  # without an option --ascii
    return load_text(result.stdout, "own")


def test_new_takes_what_a_catalogue_says() -> None:
    drive = made("--ratio", "100", "--torque", "67 Nm", "--pitch-diameter", "63.5")
    assert (drive.gears.z_g, drive.gears.z_b, drive.operation.rated) == (200, 202, 67)
    assert drive.operation.M_g == (6.7, 67)
    sources = {path: drive.source[path].ref for path in ("gears.z_g", "gears.m", "operation.rated")}
    assert sources == {
        "gears.z_g": "--ratio 100, two waves",
        "gears.m": "63.5 mm / 200 teeth; --pitch-diameter 63.5",
        "operation.rated": "--torque 67 Nm",
    }


def test_new_is_like_another_drive() -> None:
    drive = made("--like", "synthetic-160-162", "--teeth", "200/202")
    assert drive.gears.m == 0.4
    assert drive.source["flexspline.h_1"].ref.startswith("synthetic-160-162 x 1, in proportion to the diameter")


def test_new_preset_ratio_follows_the_fixed_wheel_of_its_template(tmp_path: Path) -> None:
    file = tmp_path / "b.yaml"
    file.write_bytes(read_preset("vzp160")[0].replace(b"fixed: rigid ", b"fixed: flexspline "))
    drive = made("--like", str(file), "--ratio", "100")
    assert (drive.gears.z_b, drive.mounting.fixed) == (200, "flexspline")


def test_new_keeps_lost_motion_and_accuracy_as_evidence() -> None:
    drive = made("--ratio", "100", "--lost-motion", "1 arcmin", "--accuracy", "90")
    found = {(each.figure, each.value) for each in evidence_of(drive)}
    assert found == {("lost_motion", 60.0), ("play", 5.0), ("accuracy", 90.0)}
    assert drive.source["catalogue.lost_motion"].ref == "--lost-motion 1 arcmin"


def test_new_keeps_the_stiffnesses() -> None:
    assert run("new", "own", "--stiffness", "3.1e4, 5e4, 5.7 Nm/mrad").exit_code != 0  # they fall
    drive = made("--stiffness", "3.1e4, 5e4, 57 Nm/mrad")
    said = drive.catalogue
    assert (said.K_1, said.K_2, said.K_3, said.T_1, said.accuracy) == (31000, 50000, 57000, None, None)
    assert drive.source["catalogue.K_2"].kind == "given"
    assert drive.source["catalogue.K_2"].ref.startswith("--stiffness 31000,50000,57000")
    assert origin_counts(drive)["given"] == 3


def test_new_uses_a_single_catalogue_stiffness_as_K3() -> None:
    drive = made("--ratio", "100", "--stiffness", "5.7e4")
    assert (drive.catalogue.K_1, drive.catalogue.K_2, drive.catalogue.K_3) == (None, None, 57000)
    assert "used as K3" in drive.source["catalogue.K_3"].ref
    with_all = made("--ratio", "100", "--stiffness", "3.1e4,5e4,5.7e4")
    assert drive.gears.pitch_diameter == with_all.gears.pitch_diameter  # the size follows from K3


def test_new_keeps_the_ends_of_the_segments() -> None:
    catalogue = made("--ratio", "100", "--T1", "14", "--T2", "48 N*m").catalogue
    assert (catalogue.T_1, catalogue.T_2) == (14.0, 48.0)


def test_new_keeps_the_holes_of_the_seat() -> None:
    seat = made("--holes", "8", "--allowed-holes", "0, 2,4").mounting
    assert (seat.holes, seat.allowed) == (8, (0, 2, 4))
    assert made("--allowed-holes", "0,6").mounting.holes == 12
    assert made("--holes", "0").mounting.allowed == "all"


def test_schema_is_json() -> None:
    printed = run("schema").stdout
    assert printed.isascii()
    assert json.loads(printed)["$schema"] == "https://json-schema.org/draft/2020-12/schema"


def test_values_are_counted_once(tmp_path: Path) -> None:
    drive = tmp_path / "own.yaml"
    run("new", "own", "--ratio", "100", "--torque", "67", "--lost-motion", "60", "-o", str(drive))
    kinds = [each["kind"] for each in json.loads(run("show", str(drive), "--json").stdout)["fields"]]
    given, assumed = kinds.count("given"), kinds.count("assumed")
    head, modeline = drive.read_text(encoding="utf-8").splitlines()[:2]
    assert modeline == f"# yaml-language-server: $schema={SCHEMA_FILE}"
    assert head == f"# Made by hdassist presets new, scaled from vzp160; values given: {given}, assumed: {assumed}."
    assert run("validate", str(drive)).stdout.endswith(f"OK; assumed values: {assumed}\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["--teeth", "160/162", "--ratio", "100"],
            "--teeth 160/162 contradicts --ratio 100, which needs 200/202 teeth",
        ),
        (["--teeth", "160/163"], "invalid --teeth 160/163: expected z_b - z_g = 2 (two waves)"),
        (["--teeth", "many"], "invalid --teeth 'many': expected two whole numbers"),
        (["--ratio", "82.3"], "a ratio of 82.3 requires 164.6 flexspline teeth"),
        (["--ratio", "1e29"], "a ratio of 1e29 requires"),
        (["--torque", "67 N"], "invalid --torque '67 N': the unit N is ambiguous"),
        (["--ratio", "1e30", "--pitch-diameter", "60"], "a ratio of 1e30 requires"),
        (["--torque", "-1"], "invalid --torque -1: expected a number above 0"),
        (["--pitch-diameter", "63 m"], "invalid --pitch-diameter '63 m': the unit m is ambiguous"),
        (["--pitch-diameter", ""], "invalid --pitch-diameter '': must be a number"),
        (["--pitch-diameter", "1e9"], "do not give a valid drive: gears.m would be 5e+06 mm"),
        (["--pitch-diameter", "20", "--torque", "800"], "contradicts a pitch diameter of 20 mm"),
        (["--lost-motion", "x"], "invalid --lost-motion 'x': must be a number"),
        (["--accuracy", "0"], "invalid --accuracy 0: expected a number above 0"),
        (["--stiffness", "3e4,5e4"], "invalid --stiffness 3e4,5e4: expected one number or three"),
        (["--T1", "48", "--T2", "14"], "--T1 48 N*m must be below --T2 14 N*m"),
        (["--holes", "8.5"], "invalid --holes 8.5: expected whole numbers"),
        (["--holes", "361"], "invalid --holes 361: expected 0 to 360"),
        (["--holes", "0", "--allowed-holes", "0"], "--allowed-holes needs holes"),
        (["--holes", "4", "--allowed-holes", "0,4"], "expected different holes from 0 to 3"),
        (["--allowed-holes", "1,1"], "expected different holes from 0 to 11"),
        (["--stiffness", "3e4,5e4,x"], "invalid --stiffness 'x': must be a number"),
    ],
)
def test_what_new_cannot_make_is_wrong_usage(arguments: list[str], message: str) -> None:
    result = run("new", "own", *arguments)
    assert isinstance(result.exception, UsageError)
    assert message in result.exception.message
    assert result.stdout == ""
