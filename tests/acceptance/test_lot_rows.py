"""Lots as scripts meet them: no row without a word, no PASS without a measurement that is the drive's own."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from hdassist.features.acceptance.answer import read_answers
from hdassist.features.acceptance.request import Request, read_lot
from hdassist.run.errors import DataError
from tests.helpers.answers import validator_of
from tests.helpers.process import SMALL, run
from tests.helpers.rigs import text

TURNS = np.arange(31 * 60) / 60
BUDGET = ("--budget", "encoder=0.3,coupling=0.2,reseating=0.3,temperature=0.4")
MEASURED = ("--preset", SMALL, "--measured-only")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for seed, name in enumerate(("a.csv", "b.csv")):
        noise = 0.2 * np.random.default_rng(seed).standard_normal(len(TURNS))
        (tmp_path / name).write_text(text([360 * TURNS, 5 * np.sin(4 * np.pi * TURNS) + noise], "cam_deg,error_arcsec"))
    return tmp_path


def accepted(folder: Path, lot: str, *options: str) -> tuple[int, dict[str, Any], str]:
    """Exit code, answers by serial, and messages of a lot."""
    (folder / "lot.csv").write_text(lot)
    done = run("accept", "lot.csv", *options, "--json", cwd=folder)
    answer = json.loads(done.stdout) if done.stdout else {}
    return done.returncode, {each["serial"]: each for each in answer.get("results", [])}, done.stderr


@pytest.mark.parametrize("mark", ["#", "%", "//", '"#'])
def test_row_whose_serial_begins_like_a_comment_is_read(mark: str, folder: Path) -> None:
    end = '"' * mark.startswith('"')
    lot = f"serial;F_ior@1;limit F_ior@1;note\n{mark}17{end};50±1;40;\nK2;20±1;40;x\n# by hand, 17 March\n"
    code, answers, messages = accepted(folder, lot, *MEASURED)
    assert code == 3
    assert {serial: answer["verdict"] for serial, answer in answers.items()} == {
        f"{mark.strip(chr(34))}17": "FAIL",
        "K2": "PASS",
    }
    assert "line 4" in messages


def test_remarks_above_the_heading_need_no_warning(folder: Path) -> None:
    code, answers, messages = accepted(folder, "# lot 7\nserial;F_ior@1;limit F_ior@1\nK2;20±1;40\n", *MEASURED)
    assert (code, [*answers]) == (0, ["K2"])
    assert "warning" not in messages


def test_unclosed_quote_is_refused_with_its_line(folder: Path) -> None:
    code, answers, messages = accepted(folder, 'serial,F_ior@1,limit F_ior@1\n"K1,20±1,30\nK2,20±1,30\n', *MEASURED)
    assert code == 4
    assert "lot.csv:2:1: the quotes are not closed" in messages
    assert answers["K2"]["verdict"] == "PASS"


def test_a_replay_of_no_answers_is_refused(folder: Path) -> None:
    accepted(folder, "serial;F_ior@1;limit F_ior@1\nK2;20±1;40\n", *MEASURED, "--jsonl", "lot.jsonl")
    (folder / "h.jsonl").write_text((folder / "lot.jsonl").read_text().partition("\n")[0] + "\n")
    with pytest.raises(DataError, match="contains no results"):
        read_answers(str(folder / "h.jsonl"))
    assert run("accept", "--replay", "h.jsonl", cwd=folder).returncode == 4


@pytest.mark.thorough
def test_one_recording_for_two_serials_passes_neither(folder: Path) -> None:
    lot = "serial;measured@1;limit F_ior@1\nK1;a.csv;40\nK2;b.csv;40\nK3;copy.csv;1\n"
    (folder / "copy.csv").write_bytes((folder / "a.csv").read_bytes())
    code, answers, _ = accepted(
        folder, lot, *MEASURED, *BUDGET, "--csv", "lot.figures", "--junit", "lot.xml", "--jsonl", "x.jsonl"
    )
    assert code == 6
    assert {name: each["verdict"] for name, each in answers.items()} == {
        "K1": "INCONCLUSIVE", "K2": "PASS", "K3": "INCONCLUSIVE",
    }  # fmt: skip
    notes = {each["code"]: each["text"] for each in answers["K1"]["remarks"]}
    assert "K3" in notes["SHARED_RECORD"]
    rows = {row["serial"]: row for row in csv.DictReader(io.StringIO((folder / "lot.figures").read_text()))}
    assert "K3" in rows["K1"]["reason"]
    suites = {each.get("name"): each for each in ElementTree.parse(folder / "lot.xml").getroot()}
    assert (suites["K1"].get("failures"), suites["K2"].get("failures")) == ("1", "0")
    assert run("accept", "--replay", "x.jsonl", cwd=folder).returncode == 0
    code, answers, _ = accepted(folder, lot, *MEASURED, *BUDGET, "--shared-records")
    assert [each["verdict"] for each in answers.values()] == ["PASS", "PASS", "FAIL"]
    assert "SHARED_RECORD" in str(answers["K1"]["remarks"])


@pytest.mark.thorough
def test_kept_result_is_recomputed_if_a_row_shares_its_recording(folder: Path) -> None:
    lot = "serial;measured@1;limit F_ior@1\nK1;a.csv;40\n"
    more = (*MEASURED, *BUDGET, "--jsonl", "x.jsonl", "--resume")
    assert accepted(folder, lot, *more)[0] == 0
    assert accepted(folder, f"{lot}K2;a.csv;40\n", *more)[0] == 6


@pytest.mark.parametrize("value", ["0±0", "0±1", "0 ± 0"])
def test_no_error_at_all_is_no_measured_value(value: str, folder: Path) -> None:
    done = run("accept", SMALL, "--limit", "F_ior@1=40", "--value", f"F_ior@1={value}", "--measured-only", cwd=folder)
    assert done.returncode == 2
    assert "above 0" in done.stderr


def test_strict_needs_a_measurement_for_every_limit(folder: Path) -> None:
    lot = (
        "serial;F_ior@1;F_ior@4;limit F_ior@1;limit F_ior@4\n"
        "K1;20±1;20±1;300;300\nK2;;20±1;300;300\nK3;;;300;300\nK4;400±1;;300;300\n"
    )
    code, answers, _ = accepted(folder, lot, "--preset", SMALL, "--strict")
    assert [each["verdict"] for each in answers.values()] == ["PASS", "INCONCLUSIVE", "INCONCLUSIVE", "FAIL"]
    assert code == 3
    done = run("accept", SMALL, "--limit", "F_ior@1=300", "--strict", "--draws", "8", cwd=folder)
    assert done.returncode == 6
    assert "nothing" not in done.stderr


def test_a_drive_without_a_result_has_one_word_everywhere(folder: Path) -> None:
    lot = "serial;F_ior@1;limit F_ior@1;measured@4\nK1;20±1;40;\nK1;20±1;40;\nK3;20±1;40;gone.csv\nK4;1±1;9;a.csv;x\n"
    where = ("--csv", "f.csv", "--junit", "f.xml", "--jsonl", "f.jsonl")
    assert accepted(folder, lot, *MEASURED, *where)[0] == 4
    done = json.loads(run("accept", "lot.csv", *MEASURED, "--json", cwd=folder).stdout)
    assert [each["status"] for each in done["results"]] == ["DATA_ERROR"] * 4
    rows = [*csv.DictReader(io.StringIO((folder / "f.csv").read_text()))]
    assert [row["verdict"] for row in rows] == ["DATA_ERROR"] * 4
    assert {row["preset"] for row in rows if row["serial"] == "K3"} == {"small"}
    statuses = ElementTree.parse(folder / "f.xml").getroot().iterfind(".//property[@name='status']")
    assert [each.get("value") for each in statuses] == ["DATA_ERROR"] * 4
    lines = [json.loads(line) for line in (folder / "f.jsonl").read_text().splitlines()]
    for line, schema in zip(lines, ["hdassist.kept/1"] + ["hdassist.accept/2"] * 4, strict=True):
        assert line["schema"] == schema
        assert [fault.message for fault in validator_of(schema).iter_errors(line)] == []
    replayed = run("accept", "--replay", "f.jsonl", "-q", cwd=folder).stdout.splitlines()
    assert [line.split()[0] for line in replayed] == ["K1", "K1", "K3", "K4"]


def test_torque_column_with_a_decimal_comma_names_that_torque(folder: Path) -> None:
    (folder / "lot.csv").write_text("serial;F_ior@3,4\nK1;20±1\n")
    with pytest.raises(DataError, match=r"F_ior@3\.4"):
        read_lot(str(folder / "lot.csv"), Request(SMALL))


def test_a_read_only_file_system_is_named(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import os

    real = os.statvfs(folder)
    monkeypatch.setattr("os.access", lambda *_: False)
    monkeypatch.setattr("os.statvfs", lambda _: type("Found", (), {"f_flag": real.f_flag | os.ST_RDONLY})())
    done = run("check", SMALL, "-o", "page.txt", cwd=folder)
    assert done.returncode == 4
    assert "read-only" in done.stderr
