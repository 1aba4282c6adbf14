"""hdassist doctor: what it finds of an installation, and what it says where one is broken."""

import json
import re

import pytest

from hdassist import kinematic_error, load_preset
from hdassist.interface.commands import data as doctor
from hdassist.run.run import UNCHECKED
from tests.helpers.process import run


def test_a_sound_installation_is_fine() -> None:
    done = run("doctor", "--ascii")
    assert done.returncode == 0, done.stdout
    assert done.stdout.splitlines()[0] == "this installation: fine"
    for words in ("cvxpy", "daqp", "self-test", "cores", "output"):
        assert words in done.stdout


def test_stored_digits_are_those_of_every_state() -> None:
    error = kinematic_error(load_preset(doctor.PRESET), doctor.M_G, run=UNCHECKED)
    assert error.F_ior_arcsec == pytest.approx(doctor.STORED_F_IOR, abs=doctor.AGREES)


def test_findings_are_there_as_json() -> None:
    told = json.loads(run("doctor", "--json").stdout)
    assert told["schema"] == "hdassist.doctor/1"
    assert {finding["status"] for finding in told["findings"]} <= {"ok", "note"}


def test_other_digits_are_not_trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "STORED_F_IOR", 8.5719)
    done = run("doctor")
    assert done.returncode == 5
    assert done.stdout.startswith("this installation: broken: self-test\n")
    assert re.search(r"^part +status +found\n\S+\nself-test +broken ", done.stdout, re.MULTILINE)
    assert "cannot be trusted: self-test" in done.stderr
