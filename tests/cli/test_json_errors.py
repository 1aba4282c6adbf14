"""--json: a script gets an object from every command, also where the command has no answer."""

import json
from unittest import mock

import pytest

from hdassist.interface.cli import COMMANDS, OTHER_NAMES
from hdassist.interface.commands.data import DoctorFinding
from tests.helpers.process import TINY, run

ARGUMENTS = {  # of each command that takes a preset
    "check": ("PRESET",),
    "trace": ("PRESET",),
    "stiffness": ("PRESET",),
    "tolerance": ("PRESET",),
    "sensitivity": ("PRESET",),
    "allocate": ("PRESET", "--limit", "20"),
    "sweep": ("PRESET", "--vary", "gears.j_n=0,5"),
    "compare": ("PRESET", "run.csv"),
    "report": ("PRESET",),
    "mount": ("PRESET",),
    "trials": ("PRESET", "h0=28.1"),
    "measure": ("run.csv", "--drive", "PRESET"),
    "compensate": ("PRESET",),
    "plan": ("PRESET",),
    "accept": ("PRESET",),
    "calibrate": ("PRESET", "--targets", "targets.yaml"),
    "presets show": ("PRESET",),
    "presets validate": ("PRESET",),
}
WITHOUT_PRESET = {"doctor", "explain", "explore"}  # the last one is no command for scripts
FAULTS = {
    "missing": (None, "FILE_UNREADABLE"),
    "broken": ("gears: [\n", "FILE_INVALID"),
    "unknown": ("schema: hdassist.preset/1\nname: own\nflywheel: 1\n", "FILE_INVALID"),
}


def test_every_command_is_held() -> None:
    assert {name.split()[0] for name in ARGUMENTS} | WITHOUT_PRESET == set(COMMANDS)


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("command", ARGUMENTS)
def test_an_unreadable_preset_is_an_object_with_the_error(tmp_path, command, fault) -> None:
    text, code = FAULTS[fault]
    if text is not None:
        (tmp_path / "own.yaml").write_text(text)
    arguments = (argument.replace("PRESET", "own.yaml") for argument in ARGUMENTS[command])
    done = run(*command.split(), *arguments, "--json", cwd=tmp_path)
    answer = json.loads(done.stdout)
    assert (done.returncode, answer["exit_code"]) == (4, 4)
    name = OTHER_NAMES.get(command, command).replace(" ", "-")
    assert answer["schema"].startswith(f"hdassist.{name}/")
    assert answer["error"]["code"] == code
    assert "own.yaml" in answer["error"]["message"]
    assert done.stderr.count("error: ") == 1


def test_the_object_goes_where_the_answer_would(tmp_path) -> None:
    done = run("mount", "own.yaml", "--json", "-o", "answer.json", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (4, "")
    assert json.loads((tmp_path / "answer.json").read_text())["error"]["code"] == "FILE_UNREADABLE"


def test_the_object_takes_the_place_of_no_rows(tmp_path) -> None:
    rows = tmp_path / "rows.jsonl"
    rows.write_text("kept\n")
    to = ("--json", "-o", rows.name, "--force", "--csv", "nowhere/rows.csv")
    done = run("sweep", TINY, "--vary", "gears.j_n=0,5", *to, cwd=tmp_path)
    assert json.loads(done.stdout)["error"]["code"] == "FILE_UNWRITABLE"
    assert rows.read_text() == "kept\n"


def test_an_answer_is_followed_by_no_error_object() -> None:
    with mock.patch(
        "hdassist.interface.commands.data.self_test", lambda: DoctorFinding("self-test", "broken", "far off")
    ):
        done = run("doctor", "--json")
    assert done.returncode == 5
    assert "error" not in json.loads(done.stdout)


@pytest.mark.parametrize(
    "words",
    [
        ("mount", TINY, "--set", "gears.flywheel=1"),
        ("accept", TINY, "--nonsense"),
        ("trials", TINY, "--jobs", "x"),
        ("presets", "show"),
        ("explain", "no such word"),
        ("nothing",),
        ("check", TINY, "--json", "-o", "there.json"),
    ],
)
def test_wrong_usage_is_an_object_on_standard_output(tmp_path, words) -> None:
    (tmp_path / "there.json").write_text("kept")
    done = run(*words, "--json", cwd=tmp_path)
    answer = json.loads(done.stdout)
    assert answer["schema"] == "hdassist.usage/1"
    assert (done.returncode, answer["exit_code"]) == (2, 2)
    assert answer["error"]["code"] in ("USAGE", "FILE_EXISTS", "FILE_INVALID")
    assert (tmp_path / "there.json").read_text() == "kept"
    assert done.stderr.count("error: ") == 1


def test_wrong_usage_without_json_has_no_object() -> None:
    assert run("accept", TINY, "--nonsense").stdout == ""
