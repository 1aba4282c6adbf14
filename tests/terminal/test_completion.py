"""What a shell offers to complete."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from hdassist.cli.main import app
from hdassist.terminal import completion


def test_names_of_the_library_and_yaml_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "vz-own.yaml").touch()
    (tmp_path / "vz-notes.txt").touch()
    (tmp_path / "vzs").mkdir()
    monkeypatch.chdir(tmp_path)
    assert completion.presets("vz") == ["vzp160", "vz-own.yaml", "vzs/"]
    assert completion.presets("./vz-") == ["./vz-own.yaml"]
    assert completion.presets(f"{tmp_path}/vz-") == [f"{tmp_path}/vz-own.yaml"]
    assert completion.presets("nowhere/") == []


def test_fields_that_can_be_set() -> None:
    assert completion.overrides("tolerances.F") == ["tolerances.F_i1=", "tolerances.F_i2="]
    assert completion.overrides("nothing") == []


def test_a_shell_is_answered() -> None:
    asked = {"_HDASSIST_COMPLETE": "complete_bash", "COMP_WORDS": "hdassist check --set cam.W", "COMP_CWORD": "3"}
    assert CliRunner(env=asked).invoke(app, prog_name="hdassist").stdout.split() == ["cam.W_0="]
    asked |= {"COMP_WORDS": "hdassist sens", "COMP_CWORD": "1"}
    assert CliRunner(env=asked).invoke(app, prog_name="hdassist").stdout.split() == ["sensitivity"]
