"""Samples kept in the user's cache: the same answer with and without them, and nothing believed that does not hold."""

import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief import draws
from hdassist.belief.evidence import Evidence, stiffness_figures
from hdassist.belief.prior import prior_of
from hdassist.belief.samples import SamplingEffort, draw_samples
from hdassist.drive.solve.loadcase import LoadCase
from hdassist.run import kept
from hdassist.run.errors import UntrustedError
from hdassist.run.run import Run
from tests.helpers import process
from tests.helpers.process import TINY, keep_answers, posix_only, run

OPEN = "phases.phi_hb=unknown"
FEW = SamplingEffort(effective=8, settling_draws=16, most_draws=64, batch=8)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A cache of its own, in which samples are kept, for this process and for commands."""
    keep_answers(tmp_path / "cache", monkeypatch)
    return tmp_path / "cache" / kept.OWN_FOLDER


@pytest.fixture
def solved(monkeypatch):
    """Draws that were solved, by their values."""
    solved = []
    conflict = draws.first_conflict
    monkeypatch.setattr(draws, "first_conflict", lambda drive: solved.append(drive) or conflict(drive))
    return solved


def drawn(*overrides, effort=FEW, torques=(4.0,), **options):
    prior = prior_of(load_preset(TINY, ["operation.M_g=4", OPEN, *overrides]))
    return draw_samples(prior, torques, effort=effort, **options)


def kept_file(folder):
    (path,) = folder.glob("samples-*")
    return path


def same(first, other):
    # read back, or drawn again by the same arithmetic
    arrays = ("shares", "F_ior_arcsec", "weights", "turned_arcsec")
    assert all(np.array_equal(getattr(first, name), getattr(other, name)) for name in arrays)
    assert first.figures.keys() == other.figures.keys()
    assert all(np.array_equal(values, other.figures[name]) for name, values in first.figures.items())
    assert (first.draws, first.refused, first.certificate) == (other.draws, other.refused, other.certificate)


# of draws that share all but the deviations several are made at once, more than were asked for
@pytest.mark.thorough
@pytest.mark.parametrize("more", ["name=any", "measured.F_ior={h0@4: 120 ± 20, h2@4: 95 ± 20}"])
def test_a_command_answers_the_same_with_kept_samples_as_without(folder, solved, more):
    sets = [word for each in (OPEN, more, "operation.M_g=4", "mounting.holes=6") for word in ("--set", each)]
    asked = ("check", TINY, *sets, "--draws", "10", "--json")
    first = run(*asked)
    count = len(solved)
    assert run(*asked).stdout == first.stdout
    assert len(solved) == count > 0
    for file in folder.glob("samples-*"):  # two with a measured value: samples with it, and the predicted range without
        file.unlink()
    assert run(*asked).stdout == first.stdout
    assert len(solved) == 2 * count


def test_cached_samples_equal_the_drawn_ones(folder, solved):
    wide = "source.cam.W_0={kind: assumed, range: [1.6, 2.1], ref: judged}"
    K_1 = stiffness_figures(load_preset(TINY, ["operation.M_g=4"]))[0]["K_1"]
    options = {
        "evidence": (Evidence("catalogue.K_1", "K_1", K_1, 0.02),),
        "rotations_deg": (0.0, 90.0),
        "effort": SamplingEffort(4, 8, 64, 16),
        "figures_of": lambda drive: stiffness_figures(drive),
        "figures_name": "again",
    }
    first = drawn(wide, **options)
    assert first.refused
    assert len(first.weights) + sum(first.refused.values()) < first.draws  # and some are weeded
    count = len(solved)
    same(drawn(wide, **options), first)
    assert len(solved) == count


def test_cached_draws_are_extended_and_kept_for_smaller_runs(folder, solved):
    few = drawn()
    more = drawn(effort=replace(FEW, effective=16))
    assert len(solved) == more.draws == 2 * few.draws
    same(drawn(), few)
    same(drawn(effort=replace(FEW, effective=16)), more)
    assert len(solved) == more.draws


def test_other_questions_have_other_samples(folder, solved, monkeypatch):
    drawn()
    asked = [
        {"torques": (5.0,)}, {"run": Run(seed=1)}, {"rotations_deg": (0.0, 90.0)}, {"overrides": ("gears.j_n=17",)},
        {"overrides": ("tolerances.e_hb=20±2",)},
        {"evidence": (Evidence("catalogue.accuracy", "accuracy", 50.0, 0.25, "limit"),)},
        {"figures_of": stiffness_figures, "figures_name": "stiffness"},
    ]  # fmt: skip
    for number, options in enumerate(asked, 2):
        drawn(*options.pop("overrides", ()), **options)
        assert len(list(folder.glob("samples-*"))) == number
    monkeypatch.setattr(draws, "digits_depend_on", lambda: ["another"])
    drawn()
    assert len(list(folder.glob("samples-*"))) == number + 1
    count = len(solved)
    drawn("acceptance.F_ior=12", "name=other")  # no draw depends on these
    assert len(solved) == count


def test_figures_without_a_name_are_not_kept(folder, solved):
    for _ in range(2):
        drawn(figures_of=stiffness_figures)
    assert len(solved) == 16
    assert not list(folder.glob("samples-*"))


def forged(path, change):
    """A kept file with its draws changed, and a checksum that holds."""
    first, _, data = path.read_bytes().partition(b"\n")
    draws = json.loads(data)
    draws = change(draws) or draws
    data = json.dumps(draws).encode()
    path.write_bytes(first.split()[0] + b" " + sha256(data).hexdigest().encode() + b"\n" + data)


FORGERIES = {
    "not a number": lambda draws: draws[3].update(F_ior_arcsec=[float("nan")]),
    "infinite": lambda draws: draws[3].update(weight=float("inf")),
    "a weight whose square overflows": lambda draws: draws[3].update(weight=1e305),
    "negative": lambda draws: draws[3].update(F_ior_arcsec=[-1.0]),
    "a text": lambda draws: draws[3].update(F_ior_arcsec=["12"]),
    "unproven": lambda draws: draws[3]["proof"].update(complementarity=1e-3),
    "a share above 1": lambda draws: draws[3].update(shares=[1.5]),
    "a field more": lambda draws: draws[3].update(more=1),
    "no list": lambda draws: {"draws": draws},
    "null": lambda draws: draws.__setitem__(3, None),
}


@pytest.mark.thorough
@pytest.mark.parametrize("change", FORGERIES.values(), ids=FORGERIES)
def test_a_forged_draw_is_not_believed(folder, solved, change):
    first = drawn()
    forged(kept_file(folder), change)
    same(drawn(), first)
    assert len(solved) == 2 * first.draws
    same(drawn(), first)  # and kept again
    assert len(solved) == 2 * first.draws


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: data[:-10], lambda data: b"", lambda data: data.replace(b"0.", b"1.", 1), lambda data: b"\0" * 99,
        lambda data: b"0" * 64 + data[64:], lambda data: b"[" * 100_000,
        lambda data: b"%s %s\n" % (data[:64], sha256(b"[" * 10**6).hexdigest().encode()) + b"[" * 10**6,
    ],
)  # fmt: skip
def test_a_damaged_file_is_not_believed(folder, solved, damage):
    first = drawn()
    path = kept_file(folder)
    path.write_bytes(damage(path.read_bytes()))
    same(drawn(), first)
    assert len(solved) == 2 * first.draws


def test_draws_of_another_question_under_its_name_are_not_believed(folder, solved):
    path_of = {}
    first = drawn()
    path_of["first"] = kept_file(folder)
    other = path_of["first"].read_bytes()
    path_of["first"].unlink()
    drawn(run=Run(seed=1))
    kept_file(folder).write_bytes(other)
    count = len(solved)
    assert not np.array_equal(drawn(run=Run(seed=1)).shares, first.shares)
    assert len(solved) == count + 8


@pytest.mark.parametrize("what", ["a file", "a folder", pytest.param("a pipe", marks=posix_only("named pipes"))])
def test_a_cache_that_cannot_be_used_is_done_without(folder, solved, what):
    first = drawn()
    path = kept_file(folder)
    path.unlink()
    if what == "a file":
        folder.rename(folder.with_name("moved"))
        folder.write_text("not a folder")
    elif what == "a folder":
        path.mkdir()
    else:
        os.mkfifo(path)
    same(drawn(), first)


def test_samples_that_contradict_are_kept_too(folder, solved):
    evidence = tuple(Evidence(f"catalogue.{name}", name, 1e-2, 0.01) for name in ("K_1", "K_2"))
    for _ in range(2):
        with pytest.raises(UntrustedError, match="contradicts"):
            drawn(evidence=evidence)
    assert len(solved) == 64


def test_nothing_is_kept_where_it_is_not_wanted(folder, monkeypatch):
    monkeypatch.setenv(kept.NO_CACHE, "1")
    drawn()
    assert not list(folder.glob("samples-*"))


@pytest.mark.thorough
def test_doctor_reports_folder_and_size_of_the_cache(folder, monkeypatch):
    drawn()
    found = {each["what"]: each["found"] for each in json.loads(run("doctor", "--json").stdout)["findings"]}
    assert found["cache"].startswith(f"{folder}, ")
    assert "MB; HDASSIST_CACHE sets another folder, --empty-cache deletes them" in found["cache"]
    monkeypatch.setitem(process.CLEAN, kept.NO_CACHE, "1")
    assert "no results are cached" in " ".join(run("doctor").stdout.split())
    monkeypatch.setitem(process.CLEAN, kept.FOLDER, "/proc/nowhere")
    assert "/proc/nowhere cannot be used" in " ".join(run("doctor").stdout.split())


@pytest.mark.thorough
def test_cached_results_depend_on_the_source_compiled_or_not(tmp_path):
    copy = tmp_path / "hdassist"
    shutil.copytree(Path(kept.__file__).parents[1], copy, ignore=shutil.ignore_patterns("__pycache__"))
    ask = [sys.executable, "-c", "from hdassist.run.kept import program; print(program()[0])"]

    def source():
        found = subprocess.run(
            ask, cwd=tmp_path, env=process.CLEAN | {"PYTHONPATH": str(tmp_path)}, capture_output=True
        )
        return found.stdout

    first = source()
    assert list(copy.rglob("*.pyc"))
    assert source() == first != b""
    (copy / "drive" / "solve" / "walk.c").write_text("/* another */")
    assert source() != first


def test_samples_with_turns_are_those_of_a_command_without_turns(folder, solved):
    turned = drawn(rotations_deg=(0.0, 90.0))
    count = len(solved)
    again = drawn()
    assert len(solved) == count > 0
    for path in folder.glob("samples-*"):
        path.unlink()
    same(again, drawn())
    assert len(solved) == 2 * count
    assert turned.certificate.states > again.certificate.states
    drawn(effort=replace(FEW, effective=16))
    kept = {path.name: path.read_bytes() for path in folder.glob("samples-*")}
    drawn(rotations_deg=(0.0, 90.0))  # fewer: those that are kept stay
    assert kept.items() <= {path.name: path.read_bytes() for path in folder.glob("samples-*")}.items()


@pytest.mark.thorough
def test_check_reuses_the_samples_of_mount_with_equal_results(folder, solved):
    drive = (TINY, "--set", OPEN, "--set", "operation.M_g=4", "--draws", "8", "--json")
    alone = run("check", *drive).stdout
    for path in folder.glob("*"):
        path.unlink()
    run("mount", *drive)
    solved.clear()
    assert run("check", *drive).stdout == alone
    assert not solved


@pytest.mark.thorough
def test_self_error_and_steps_are_the_same_kept_as_computed(folder, monkeypatch):
    asked = ("check", TINY, "--set", OPEN, "--limit", "F_ior=1", "--draws", "8", "--json")
    first = run(*asked).stdout
    assert {path.name.partition("-")[0] for path in folder.iterdir()} >= {"self", "options", "samples", "again"}
    solved = []
    monkeypatch.setattr("hdassist.drive.error.cycle.ContactSystems", lambda *_: solved.append(1))
    assert run(*asked).stdout == first
    assert not solved
    for path in folder.glob("self-*"):
        path.write_bytes(path.read_bytes()[:-9])  # one that does not hold is computed
    monkeypatch.undo()


class Many(ThreadPoolExecutor):
    """Threads that say how many they are, and keep count of their tasks."""

    size, tasks = 6, 0

    def submit(self, *task, **more):
        self.tasks += 1
        return super().submit(*task, **more)


@pytest.mark.thorough
@pytest.mark.parametrize("effective", [40, 100])
def test_many_processes_work_ahead_and_change_nothing(effective):
    effort = SamplingEffort(effective=effective, most_draws=512, batch=16)
    with Many(Many.size) as executor:
        many = drawn(effort=effort, run=Run(executor))
    same(drawn(effort=effort), many)
    assert executor.tasks == many.draws + Many.size


@pytest.fixture
def states(monkeypatch):
    """Rotations of the states that were solved, but for climbs."""
    found = []
    solve = LoadCase.solve

    def solving(*arguments, **options):
        answers = solve(*arguments, **options)
        found.extend(answers.rotation_arcsec.tolist())
        return answers

    monkeypatch.setattr(LoadCase, "solve", solving)
    return found


# with holes: of a free seat check looks in fewer directions than mount
REPORTED = (TINY, "--set", OPEN, "--set", "operation.M_g=4", "--set", "mounting.holes=6", "--draws", "8")


@pytest.mark.thorough
def test_report_reuses_check_and_mount_with_equal_results(folder, states):
    alone = run("report", *REPORTED, "--json").stdout
    of_report = sorted(states)
    shutil.rmtree(folder)
    states.clear()
    run("check", *REPORTED)
    of_check = len(states)
    assert run("report", *REPORTED, "--json").stdout == alone
    assert sorted(states) == of_report  # by both together what the report solves by itself
    assert 0 < of_check < len(of_report)
    shutil.rmtree(folder)
    run("check", *REPORTED)
    run("mount", *REPORTED)
    run("stiffness", *REPORTED[:5])
    states.clear()
    assert run("report", *REPORTED, "--json").stdout == alone
    assert not states


@pytest.mark.thorough
@pytest.mark.parametrize("turns", [(0.0, 90.0), (90.0,)])
@pytest.mark.parametrize("options", [{}, {"torques": (4.0, 5.0)}, {"overrides": ("catalogue.accuracy=60",)}])
def test_turns_are_the_same_beside_draws_that_were_kept_without(folder, turns, options):
    evidence = (Evidence("catalogue.accuracy", "accuracy", 50.0, 0.25, "limit"),)
    options = {"evidence": evidence, "rotations_deg": turns, **options}
    first = drawn(*options.pop("overrides", ()), **options)
    shutil.rmtree(folder)
    drawn(**options | {"rotations_deg": ()})
    same(drawn(**options), first)


@pytest.mark.thorough
def test_answers_that_do_not_hold_are_computed(folder):
    alone = run("report", *REPORTED, "--json").stdout
    kinds = {kind: folder.glob(f"{kind}-*") for kind in ("curve", "cycle", "twists")}
    whole = {path: (kind, path.read_bytes()) for kind, (path,) in kinds.items()}
    for change in (b"NaN,", b"-1.0,", b"[1.0],", b"7.5,"):
        for path, (kind, content) in whole.items():
            first, _, data = content.partition(b"\n")
            damaged = data.replace(b'"' if kind == "cycle" else b"[", b"[" + change, 1)
            path.write_bytes(first.split()[0] + b" " + sha256(damaged).hexdigest().encode() + b"\n" + damaged)
        assert run("report", *REPORTED, "--json").stdout == alone
        assert not any(path.read_bytes().partition(b"\n")[2].startswith(b"[" + change) for path in whole)
