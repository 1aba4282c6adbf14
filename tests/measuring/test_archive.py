"""An archive of measured drives: what is added stays, whoever reads it, and a change is told from its uncertainty."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from pydantic import TypeAdapter

from hdassist.features.measuring.archive import (
    ARCHIVE_FILE,
    OWNER,
    ArchiveEntry,
    add_to_archive,
    histories,
    is_cut_off,
    read_archive,
    read_conditions,
)
from hdassist.features.measuring.full_cycle import with_full_cycle
from hdassist.features.measuring.measure import Measurement, measure
from hdassist.interface.pages.measure import history_report
from hdassist.run.errors import DataError, UsageError
from hdassist.run.kept import RecordKind, open_kept
from tests.helpers.paper import on_paper
from tests.helpers.process import in_a_line, run
from tests.helpers.rigs import drive_error, recorded, text

TURNS = np.arange(30 * 60) / 60
ERROR = drive_error(np.random.default_rng(3), 30)(TURNS)
ANYTHING = RecordKind(TypeAdapter(dict))
STATED = ("--budget", "encoder=0,coupling=0,reseating=0.3,temperature=0")


@pytest.fixture(scope="module")
def measured() -> Measurement:
    noise = 0.3 * np.random.default_rng(0).standard_normal(len(TURNS))
    return measure(replace(recorded(TURNS, ERROR + noise), sha256="ab" * 32), ratio=30)


def entry(day: str = "2026-01-01", F_ior: float = 20.0, u: float = 0.5, **more) -> ArchiveEntry:
    fields = {"serial": "17-1", "hole": "h4", "M_g_Nm": 80.0, "file": "run.csv", "sha256": "ab", "direction": 1}
    interval = {"low_arcsec": F_ior - 2 * u, "high_arcsec": F_ior + 2 * u}
    found = {"F_ior_is_lower_bound": False, "unstated": (), "standard_uncertainty_arcsec": u, **interval}
    return ArchiveEntry(date=day, F_ior_arcsec=F_ior, **(fields | found | more))


@pytest.mark.thorough
def test_an_archive_as_its_users_meet_it(tmp_path):
    budget, days = ("--ratio", "30", *STATED), ("2025-03-01", "2026-03-01", "2026-04-01")
    for k, (day, factor) in enumerate(zip(days, (1.0, 1.0, 1.2), strict=True)):
        noise = 0.3 * np.random.default_rng(k).standard_normal(len(TURNS))
        (tmp_path / f"{k}.csv").write_text(text([360 * TURNS, factor * ERROR + noise], "cam_deg,error_arcsec"))
        into = ("--archive", "rig", "--serial", "17-1", "--conditions", f"hole=h4,torque=80,temperature=23,date={day}")
        for words in (f"added for 17-1, {day}", "not added again"):
            done = run("measure", f"{k}.csv", *budget, *into, "--json", cwd=tmp_path)
            assert done.returncode == 0
            assert words in done.stderr
    asked = ("measure", "--history", "17-1", "--archive", "rig")
    told = json.loads(run(*asked, "--json", cwd=tmp_path).stdout)
    assert (told["schema"], told["verdict"]) == ("hdassist.measure-history/1", "changed by more than its uncertainty")
    assert [(each["date"], each["hole"], each["M_g_Nm"]) for each in told["entries"]] == [(d, "h4", 80) for d in days]
    assert told["entries"][2]["F_ior_arcsec"] > 1.1 * told["entries"][0]["F_ior_arcsec"]
    page = run(*asked, cwd=tmp_path)
    assert (page.returncode, page.stderr) == (0, "")
    assert page.stdout.startswith(
        "17-1 in rig, measured 3 times: changed by more than its uncertainty\nhole h4, 80 N·m"
    )
    assert max(map(len, page.stdout.splitlines())) <= 80
    assert run(*asked, "--csv", "-", cwd=tmp_path).stdout.count("\n") == 4


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        ((), 2, "expected FILE, FILE --archive DIR --serial S"),
        (("--history", "17-1"), 2, "expected FILE, FILE --archive DIR --serial S"),
        (("run.csv", "--history", "17-1", "--archive", "rig"), 2, "expected FILE, FILE --archive DIR --serial S"),
        (("run.csv", "--archive", "rig"), 2, "expected FILE, FILE --archive DIR --serial S"),
        (("run.csv", "--serial", "17-1"), 2, "expected FILE, FILE --archive DIR --serial S"),
        (("run.csv", "--archive", "rig", "--serial", "a", "--conditions", "moon=1"), 2, "invalid --conditions moon=1"),
        (("run.csv", "--archive", "rig", "--serial", "a", "--conditions", "date=1.3.26"), 2, "date: Invalid isoformat"),
        (("run.csv", "--archive", "rig", "--serial", "a", "--conditions", "hole=4"), 2, "hole: String should match"),
        (("run.csv", "--archive", "none/rig", "--serial", "a"), 4, "cannot write none/rig/archive.jsonl"),
        (("--history", "17-1", "--archive", "rig"), 4, "no such file: rig/archive.jsonl"),
    ],
)
def test_faults_end_clearly(tmp_path, args, code, words):
    (tmp_path / "run.csv").write_text(text([360 * TURNS, ERROR], "cam_deg,error_arcsec"))
    done = run("measure", *args, "--ratio", "30", "-o", "page.txt", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (code, "")
    assert words in done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.csv"]


def test_values_of_the_model_are_not_compared_with_fitted_orders():
    fitted, modelled = entry(F_ior=57.0), entry("2026-02-01", F_ior=66.0, sha256="cd", is_by_model=True)
    assert histories([fitted, modelled]) == ()
    later = entry("2026-03-01", F_ior=57.1, sha256="ef", is_by_model=True)
    (found,) = histories([fitted, modelled, later])
    assert found.is_changed


def test_a_file_of_an_earlier_version_is_added_once_more(tmp_path, measured):
    folder = str(tmp_path)
    assert add_to_archive(folder, read_conditions("17-1", []), measured)
    assert add_to_archive(folder, read_conditions("17-1", []), with_full_cycle(measured))
    (found,) = read_archive(folder, "17-1")
    assert found.is_by_model


def test_archive_reads_entries_of_other_versions_and_names_other_schemas(tmp_path, measured):
    folder, path = str(tmp_path), tmp_path / ARCHIVE_FILE
    add_to_archive(folder, read_conditions("17-1", ["date=2026-01-01"]), measured)
    (known,) = read_archive(folder, "17-1")
    later = json.loads(path.read_text().splitlines()[1])
    later = {key: value for key, value in later.items() if key not in ("item", "checksum")}
    with open_kept(str(path), OWNER, ANYTHING) as kept:
        kept.append([{**later, "version": "9.0.0", "humidity": 0.4, "date": "2027-01-01", "sha256": "cd" * 32}])
    assert [(each.version, each.date) for each in read_archive(folder, "17-1")] == [
        (known.version, "2026-01-01"), ("9.0.0", "2027-01-01"),
    ]  # fmt: skip
    assert not add_to_archive(folder, read_conditions("17-1", []), measured)
    for name, value in (("standard_uncertainty_arcsec", 0.0), ("date", "soon"), ("F_ior_arcsec", 1e300)):
        before = path.read_bytes()
        with open_kept(str(path), OWNER, ANYTHING) as kept:  # a checksum that holds
            kept.append([{**later, name: value}])
        with pytest.raises(DataError, match=rf"archive\.jsonl:4: invalid record: {name}"):
            read_archive(folder, "17-1")
        path.write_bytes(before)
    with open_kept(str(path), OWNER, ANYTHING) as kept:
        kept.append([{**later, "schema": "hdassist.archive/2"}])
    with pytest.raises(DataError, match=r"archive\.jsonl:4: invalid record: schema: the schema is hdassist\.archive/2"):
        read_archive(folder, "17-1")


def test_archive_refuses_a_changed_line_and_ignores_a_cut_line(tmp_path, measured):
    folder, path = str(tmp_path), tmp_path / ARCHIVE_FILE
    for serial in ("17-1", "17-2"):
        add_to_archive(folder, read_conditions(serial, []), measured)
    whole = path.read_bytes()
    assert not is_cut_off(folder)
    path.write_bytes(whole[:-40])  # the power was lost
    assert is_cut_off(folder)
    assert [each.serial for each in read_archive(folder, "17-1")] == ["17-1"]
    with pytest.raises(DataError, match="contains no measurement of 17-2"):
        read_archive(folder, "17-2")
    add_to_archive(folder, read_conditions("17-2", []), measured)
    assert path.read_bytes() == whole
    for wrong in (whole.replace(b'"serial":"17-1"', b'"serial":"17-9"'), whole.replace(b'"item":0', b'"item":1')):
        path.write_bytes(wrong)
        with pytest.raises(DataError, match=r"archive\.jsonl:2: invalid record"):
            read_archive(folder, "17-1")
        with pytest.raises(DataError, match=r"archive\.jsonl:2: invalid record"):
            add_to_archive(folder, read_conditions("17-3", []), measured)
        assert path.read_bytes() == wrong
    path.write_text("mine\n")
    with pytest.raises(UsageError, match="was not written by hdassist"):
        add_to_archive(folder, read_conditions("17-3", []), measured)
    with pytest.raises(DataError, match="contains no measurement"):
        read_archive(folder, "17-1")


def test_archive_corrects_a_condition_if_the_recording_is_added_again(tmp_path, measured):
    folder = str(tmp_path)
    assert add_to_archive(folder, read_conditions("17-1", ["torque=80,hole=h4,date=2026-01-01"]), measured)
    for texts, is_new in ((["torque=800"], True), ([], False), (["torque=800,hole=h4"], False), (["hole=h5"], True)):
        assert add_to_archive(folder, read_conditions("17-1", texts), measured) is is_new
    (entry,) = read_archive(folder, "17-1")
    assert (entry.M_g_Nm, entry.hole, entry.date) == (800.0, "h5", "2026-01-01")
    assert len((tmp_path / ARCHIVE_FILE).read_text().splitlines()) == 1 + 3  # it only grows
    assert entry.F_ior_arcsec == measured.F_ior_arcsec
    assert add_to_archive(folder, read_conditions("17-2", ["hole=h5"]), measured)  # another drive's is its own


def test_writers_at_once_lose_nothing(tmp_path, measured):
    def add(k: int) -> bool:
        found = replace(measured, trace=replace(measured.trace, sha256=f"{k:064}"))
        return add_to_archive(str(tmp_path), read_conditions("17-1", []), found)

    with ThreadPoolExecutor(8) as threads:
        assert all(threads.map(add, range(16)))
    assert {each.sha256 for each in read_archive(str(tmp_path), "17-1")} == {f"{k:064}" for k in range(16)}


def test_only_what_is_alike_and_whole_is_compared():
    more = [entry(hole="h5"), entry(M_g_Nm=None), entry(direction=-1), entry(F_ior_is_lower_bound=True)]
    assert histories([entry(), *more]) == ()
    (found,) = histories([entry(), *more, entry(F_ior=20.5)])
    assert [each.F_ior_arcsec for each in found.entries] == [20.0, 20.5]
    assert found.chi_square == pytest.approx(0.5)  # (0.5 / 0.5)^2 / 2
    assert found.probability == pytest.approx(0.4795, abs=1e-4)
    assert found.is_changed is False
    page = on_paper(history_report("17-1", "rig", [entry(), *more, entry(F_ior=20.5)]))
    assert "no change beyond its uncertainty" in page
    assert "left out 1 result that is only a lower bound, from part of the cycle" in in_a_line(page)
    assert "nothing to compare" in on_paper(history_report("17-1", "rig", [entry(unstated=("reseating",))]))


def test_a_change_is_told_from_chance():
    rng, days = np.random.default_rng(1), ["2024-01-01", "2024-07-01", "2025-01-01", "2025-12-31"]
    years = np.array([0, 182, 366, 730]) / 365.25
    false, seen, count = 0, 0, 300
    for _ in range(count):
        noise = 0.5 * rng.standard_normal((3, 4))
        same = [entry(d, 20 + noise[k, i], hole=f"h{k}") for k in range(3) for i, d in enumerate(days)]
        false += any(each.is_changed for each in histories(same))
        (worn,) = histories([entry(d, v) for d, v in zip(days, 20 + 2 * years + noise[0], strict=True)])
        seen += worn.is_changed
    assert false < 0.08 * count  # 5 % are meant
    assert seen > 0.9 * count
