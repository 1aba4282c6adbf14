"""Lots and replays of `hdassist accept` as their users meet them."""

from __future__ import annotations

import csv
import io
import json
import re
import signal
import subprocess
import time
from pathlib import Path
from xml.dom.minidom import parseString

import numpy as np
import pytest
from pydantic import TypeAdapter

from hdassist.features.acceptance import accept as lotwork
from hdassist.features.acceptance.answer import ANSWERS, answer_differences, read_answers
from hdassist.features.acceptance.request import Request
from hdassist.interface.commands.acceptance import AcceptOptions, accept_lot
from hdassist.run.kept import KeptOwner, RecordKind, open_kept
from tests.helpers.process import CLEAN, COMMAND, SMALL, TINY, in_a_line, run
from tests.helpers.rigs import drive_error, text

TURNS = np.arange(30 * 60) / 60
LOT = """\
serial;F_ior@1;limit F_ior@1;measured@4;limit F_ior@4;phases.xi_b
17-1;28,5 ± 1;40;run.csv;60;
17-2;55±1;40;;;
17-3;39,8±1;40;;;
17-4;;40;gone.csv;60;
17-5;28±1;40;;;here
"""
STATED = ("--measured-only", "--budget", "encoder=0,coupling=0,reseating=0,temperature=0")
MEASURED = ("accept", "lot.csv", "--preset", SMALL, *STATED)


FORM = ("item", "checksum")  # of kept work


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A lot with PASS, FAIL, INCONCLUSIVE and two broken rows, and a trace."""
    error = drive_error(np.random.default_rng(3), 30)(TURNS)
    error += 0.3 * np.random.default_rng(0).standard_normal(len(TURNS))
    (tmp_path / "run.csv").write_text(text([360 * TURNS, error], "cam_deg,error_arcsec"))
    (tmp_path / "lot.csv").write_text(LOT)
    return tmp_path


def untimed(value):
    if isinstance(value, dict):
        # a hint names files that are near by
        return {key: untimed(inner) for key, inner in value.items() if key not in (*FORM, "time", "hint")}
    if isinstance(value, float):
        return float(f"{value:.9g}")  # a process of its own may have other kernels of linear algebra
    return [untimed(inner) for inner in value] if isinstance(value, list) else value


@pytest.fixture
def here(folder):
    """Runs a command in the folder: exit code, stdout, stderr."""

    def run_here(*args):
        done = run(*args, cwd=folder)
        return done.returncode, done.stdout, done.stderr

    return run_here


@pytest.mark.thorough
def test_a_lot_on_paper_and_in_files(folder, here):
    files = ("--jsonl", "a.jsonl", "--csv", "a.csv", "--junit", "a.xml")
    result = run(*MEASURED, *files, "--jobs", "2", cwd=folder)
    assert result.returncode == 4
    head, why, *_ = result.stdout.splitlines()
    assert head == "lot.csv, 5 drives: 1 PASS, 1 FAIL, 1 INCONCLUSIVE, 2 DATA_ERROR"
    assert why.startswith("yield: 50 % (9 to 91), 1 PASS among 2 drives")
    verdicts = ["PASS", "FAIL", "INCONCLUSIVE", "DATA_ERROR", "DATA_ERROR"]
    page = [line for line in result.stdout.splitlines() if line.startswith("17-")]
    assert [line.split()[:2] for line in page] == [[f"17-{n}", v] for n, v in enumerate(verdicts, 1)]
    assert "F'_ior at 1 N·m: 55.00 ± 1.00″, limit ≤ 40, margin" in page[1]
    words = in_a_line(result.stdout)
    assert "margin 0.20, guard band 0.82, reported value; within the guard band" in words
    turning = f"next hdassist mount {SMALL} h0=55 --limit F_ior@1=40 --trial-torque 1"
    assert f"17-2 (F'_ior is 1.38 times the limit) {turning}" in words
    assert "lot.csv:5:10: measured@4: no such file: gone.csv" in page[3]
    for words in (
        "error: 17-4: lot.csv:5:10: measured@4: no such file: gone.csv",
        "error: 17-5: lot.csv:6:16: phases.xi_b: must be a number (got here; write a number in deg)"
        "\n  hint: hdassist explain DATA",
        "wrote a.jsonl",
    ):
        assert words in result.stderr
    code, out, _ = here(*MEASURED, "--json", "--jobs", "1")
    assert code == 4
    told = json.loads(out)
    assert told["schema"] == "hdassist.accept/2"
    assert told["exit_code"] == 4
    assert told["lot"]["rows"] == 5
    assert told["summary"]["verdicts"] == {"PASS": 1, "FAIL": 1, "INCONCLUSIVE": 1, "DATA_ERROR": 2, "BROKEN": 2}
    owner, *written = [json.loads(line) for line in (folder / "a.jsonl").read_text().splitlines()]
    assert (owner["command"], owner["inputs"]) == ("accept", {})
    assert untimed(written) == untimed(told["results"])
    rows = list(csv.DictReader(io.StringIO((folder / "a.csv").read_text(encoding="utf-8"))))
    assert [(row["serial"], row["verdict"]) for row in rows] == [
        ("17-1", "PASS"), ("17-1", "PASS"), ("17-2", "FAIL"), ("17-3", "INCONCLUSIVE"),
        ("17-4", "DATA_ERROR"), ("17-5", "DATA_ERROR"),
    ]  # fmt: skip
    root = parseString((folder / "a.xml").read_bytes()).documentElement
    assert root is not None
    assert [root.getAttribute(key) for key in ("tests", "failures", "errors")] == ["6", "2", "2"]
    code, out, said = here(*MEASURED, *files)
    assert (code, out) == (2, "")
    assert "a.jsonl already exists" in said


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("rows", "code"),
    [
        (["PASS"], 0),
        (["INCONCLUSIVE", "FAIL", "PASS"], 3),
        (["FAIL", "DATA_ERROR", "INCONCLUSIVE"], 4),
        (["UNTRUSTED", "BUG", "DATA_ERROR", "PASS"], 1),
    ],
)
def test_the_worst_drive_makes_the_exit_code(tmp_path, rows, code, monkeypatch, capsys):
    noise = np.random.default_rng(2).standard_normal(len(TURNS))
    (tmp_path / "noise.csv").write_text(text([360 * TURNS, noise], "cam_deg,error_arcsec"))
    cells = {"PASS": "20±1;", "FAIL": "50±1;", "INCONCLUSIVE": "40±1;", "DATA_ERROR": "20±1;none.csv", "BUG": "20±1;",
             "UNTRUSTED": "20±1;noise.csv"}  # fmt: skip
    lines = ["serial;F_ior@1;measured@4", *(f"{name};{cells[name]}" for name in rows)]
    (tmp_path / "lot.csv").write_text("\n".join(lines) + "\n")
    real = lotwork.accept

    def broken(request, *rest, **options):
        return 1 / 0 if request.serial == "BUG" else real(request, *rest, **options)

    monkeypatch.setattr(lotwork, "accept", broken)
    monkeypatch.setattr("hdassist.run.run.start_method", lambda: "fork")  # workers have the patch
    base = Request(SMALL, limits=("F_ior=40",), measured_only=True)
    options = AcceptOptions(quiet=True, jobs=2)
    found = accept_lot(str(tmp_path / "lot.csv"), base, options, options.open())
    assert found == code
    words = [line.split()[1] for line in capsys.readouterr().out.splitlines()]
    assert words == [name.replace("UNTRUSTED", "DATA_ERROR").replace("BUG", "DATA_ERROR") for name in rows]


@pytest.mark.thorough
def test_an_interrupt_keeps_what_is_done_and_resume_goes_on(tmp_path, here):
    phases = [10 * n for n in range(6)]
    lot = "serial,phases.xi_b\n" + "".join(f"d{n},{xi}\n" for n, xi in enumerate(phases))
    (tmp_path / "lot.csv").write_text(lot)
    args = ("accept", "lot.csv", "--preset", SMALL, "--limit", "F_ior@4=30", "--jobs", "1", "--jsonl", "a.jsonl")
    with subprocess.Popen(
        [*COMMAND, *args, "--csv", "a.csv"], cwd=tmp_path, env=CLEAN, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        begun = time.monotonic()
        while not ((tmp_path / "a.jsonl").exists() and (tmp_path / "a.jsonl").read_bytes().count(b"\n") > 2):
            assert time.monotonic() - begun < 120
            time.sleep(0.02)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=120)
    kept = (tmp_path / "a.jsonl").read_text().splitlines()[1:]
    assert process.returncode == 130
    assert 0 < len(kept) < 6
    told = re.search(
        r"(\d) of 6 rows are stored in a\.jsonl; to continue, repeat the command with --resume", said.decode()
    )
    assert told is not None and len(kept) - int(told[1]) in (0, 1)  # a line may be on its way as the stop comes
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.jsonl", "lot.csv", "run.csv"]
    with (tmp_path / "a.jsonl").open("a") as stream:
        stream.write(kept[0].replace('"item":0', f'"item":{len(kept)}')[:200])  # a crash in the middle of a line
    result = run(*args, "--resume", "-q", cwd=tmp_path)
    assert f"a.jsonl: {len(kept)} of 6 rows are already computed" in result.stderr
    assert [line.split()[0] for line in result.stdout.splitlines()] == [f"d{n}" for n in range(6)]
    lines = (tmp_path / "a.jsonl").read_text().splitlines()[1:]
    assert lines[: len(kept)] == kept
    assert [json.loads(line)["serial"] for line in lines] == [f"d{n}" for n in range(6)]
    lot = (tmp_path / "lot.csv").read_text()
    (tmp_path / "lot.csv").write_text(lot.replace("\nd", "\nother"))
    code, _, told = here(*args, "--resume")
    assert code == 2
    assert "none of its results belongs to a drive of this lot" in told
    assert (tmp_path / "a.jsonl").read_text().splitlines()[1:] == lines


@pytest.mark.thorough
def test_a_lot_whose_files_have_all_changed_is_done_again(folder, here):
    (folder / "lot.csv").write_text("\n".join([*LOT.splitlines()[:1], "17-1;;;run.csv;60;"]) + "\n")
    args = (*MEASURED, "--jsonl", "a.jsonl", "--resume", "-q")
    assert here(*args)[:2] == (0, "17-1 PASS\n")
    before = json.loads((folder / "a.jsonl").read_text().splitlines()[1])["measured"][0]["sha256"]
    with (folder / "run.csv").open("a") as stream:
        stream.write("# looked at again\n")
    code, out, told = here(*args)
    assert (code, out) == (0, "17-1 PASS\n")
    assert "warning: a.jsonl: the files, the options or the version have changed; all rows are computed again" in told
    (answer,) = (folder / "a.jsonl").read_text().splitlines()[1:]
    assert json.loads(answer)["measured"][0]["sha256"] != before


@pytest.mark.thorough
def test_replay_agrees_differs_or_says_which_file_changed(folder, here):
    one = ("accept", SMALL, "--limit", "F_ior@4=60", "--measured", "4=run.csv", "--serial", "17-1", *STATED)
    assert here(*one, "--json", "-o", "one.json")[0] == 0
    assert here(*MEASURED, "--jsonl", "lot.jsonl", "-q")[0] == 4
    code, out, _ = here("accept", "--replay", "one.json", "--json")
    told = json.loads(out)
    assert (code, told["schema"], told["agrees"]) == (0, "hdassist.accept-replay/2", True)
    code, out, _ = here("accept", "--replay", "lot.jsonl")
    assert code == 0
    assert [line.split(",")[0] for line in out.split("\n\n")] == [f"17-{n}" for n in range(1, 6)]
    assert out.count(": agrees\n") == 5
    with (folder / "run.csv").open("a") as stream:
        stream.write("10801,1\n")
    code, out, said = here("accept", "--replay", "one.json")
    assert code == 4
    assert "run.csv has changed: sha256" in said


def test_a_kept_answer_that_was_changed_is_refused(folder, here):
    args = (*MEASURED, "--jsonl", "a.jsonl", "-q")
    assert here(*args)[0] == 4
    owner, first, second, *rest = (folder / "a.jsonl").read_text().splitlines()
    assert json.loads(second)["verdict"] == "FAIL"
    for old, new, again in (
        ('"FAIL"', '"PASS"', (*args, "--resume")),
        ('"value":55.0', '"value":54.0', (*args, "--resume")),
        ('"value":55.0', '"value":Infinity', ("accept", "--replay", "a.jsonl")),
    ):
        lines = [owner, first, second.replace(old, new), *rest]
        (folder / "a.jsonl").write_text("\n".join(lines) + "\n")
        code, out, said = here(*again)
        assert (code, out) == (4, "")
        assert "a.jsonl:3: invalid record: the checksum does not match" in said
        assert (folder / "a.jsonl").read_text().splitlines() == lines


def test_an_answer_with_a_field_without_a_name_is_refused(folder, here):
    _, answer, _ = here(*MEASURED, "--json")
    (folder / "a.json").write_text(json.dumps({**json.loads(answer)["results"][0], "": 1}))
    code, out, said = here("accept", "--replay", "a.json")
    assert (code, out) == (4, "")
    assert "a.json:1: a result is incomplete: '': " in said


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda told: {"results": True}, "a.json contains no results"),
        (lambda told: told | {"measured": [{}]}, "a.json:1: a result is incomplete: measured.0.file"),
        (lambda told: told | {"rule": {}}, "a.json:1: a result is incomplete: rule.measured"),
        (lambda told: told | {"certificate": {"engine": 1}}, "a.json:1: a result is incomplete: certificate"),
        (lambda told: told | {"exit_code": 7}, "a.json:1: a result is incomplete: exit_code: expected 3, got 7"),
        (lambda told: told | {"verdict": None}, "a.json:1: a result is incomplete: expected either"),
        (lambda told: told | {"checks": []}, "a.json:1: a result is incomplete: checks: a result with a verdict needs"),
        (lambda told: told | {"pitch": [{"file": "x"}]}, "a.json:1: a result is incomplete: pitch.0."),
    ],
)
def test_invalid_json_result_is_refused_by_its_first_invalid_field(folder, here, change, words):
    _, answer, _ = here("accept", TINY, "--limit", "F_ior@4=9", "--value", "F_ior@4=28±1", *STATED, "--json")
    (folder / "a.json").write_text(json.dumps(change(json.loads(answer))))
    code, out, said = here("accept", "--replay", "a.json")
    assert (code, out) == (4, "")
    assert words in said


@pytest.mark.thorough
@pytest.mark.parametrize("change", [{"measured": [{}]}, {"exit_code": 7}, {"checks": []}, {"samples": {"draws": "x"}}])
def test_invalid_kept_result_is_refused_despite_a_valid_checksum(folder, here, change):
    (folder / "few.csv").write_text("".join(LOT.splitlines(keepends=True)[:2]))
    args = ("accept", "few.csv", "--preset", SMALL, *STATED, "--jsonl", "a.jsonl")
    assert here(*args)[0] == 0
    path = str(folder / "a.jsonl")
    with open_kept(path, KeptOwner(command="accept", inputs={}), ANSWERS) as kept:
        (fields,) = (json.loads(ANSWERS.adapter.dump_json(each)) for each in kept.records())
    with open_kept(path, KeptOwner(command="accept", inputs={}), RecordKind(TypeAdapter(dict)), force=True) as kept:
        kept.append([fields | change])
    for again in ((*args, "--resume"), ("accept", "--replay", "a.jsonl")):
        code, out, said = here(*again)
        assert (code, out) == (4, "")
        assert f"a.jsonl:2: invalid record: {next(iter(change))}" in said


FORGED = {
    "a limit and its margin": lambda told: told["checks"][0].update(limit=61.0, margin=told["checks"][0]["margin"] + 1),
    "a value": lambda told: told["checks"][0].update(value=told["checks"][0]["value"] * (1 + 1e-4)),
    "a guard": lambda told: told["checks"][0].update(guard=0.1),
    "a check twice": lambda told: told["checks"].append(told["checks"][0]),
    "no check": lambda told: told["checks"].pop(),
    "F'_ior of a trace": lambda told: told["measured"][0].update(F_ior_arcsec=12.0),
    "the torque of a trace": lambda told: told["measured"][0].update(M_g_Nm=5.0),
    "the rows of a trace": lambda told: told["measured"][0].update(rows=7),
    "states": lambda told: told["certificate"].update(states=10),
    "a cross-check": lambda told: told["certificate"].update(
        cross_check={"solver": "CLARABEL", "states": 9, "max_difference_arcsec": 0.0}
    ),
    "the seed": lambda told: told.update(seed=5),
    "a remark": lambda told: told.update(remarks=told["remarks"][1:]),
    "how sure it is": lambda told: told["rule"].update(sure=0.9),
    "the serial": lambda told: told.update(serial="17-2"),
    "a check left out": lambda told: told.update(left_out=["one more"]),
    "the code of a remark": lambda told: told["remarks"][0].update(code="RATED"),
}
REWORDED = {
    "a reason": lambda told: told["checks"][0].update(reason="so"),
    "a warning": lambda told: told.update(warnings=["x"]),
    "remarks": lambda told: [remark.update(text="so") for remark in told["remarks"]],
    "why a cycle is open": lambda told: [check["full_cycle"].update(why_open="so") for check in told["checks"][:1]],
    "another version": lambda told: told.update(version="0.9"),
}


@pytest.mark.thorough
def test_replay_compares_verdicts_numbers_and_codes_and_no_words(folder, here):
    error = drive_error(np.random.default_rng(3), 30)(TURNS[:480])
    (folder / "run.csv").write_text(text([360 * TURNS[:480], error], "cam_deg,error_arcsec"))
    limits = ("--limit", "F_ior@4=60", "--limit", "self_error@4=60")
    asked = ("accept", TINY, *limits, "--measured", "4=run.csv", "--serial", "17-1", "--jobs", "1")
    code, out, _ = here(*asked, "--json")
    assert code == 3  # for its remarks
    answers = [json.loads(out)]
    for change in [*FORGED.values(), *REWORDED.values()]:
        answers.append(json.loads(out))
        change(answers[-1])
        assert answers[-1] != answers[0]
    (folder / "all.json").write_text(json.dumps({"schema": "hdassist.accept/1", "results": answers}))
    now, *changed = read_answers(str(folder / "all.json"))
    forged, reworded = changed[: len(FORGED)], changed[len(FORGED) :]
    assert now.certificate.max_residual == answers[0]["certificate"]["max_residual"]
    assert now.certificate.engine
    by_another_engine = json.loads(out)
    by_another_engine["certificate"].update(engine="numpy", fallbacks=3, max_residual=9e-9)
    by_another_engine["certificate"]["residuals"].update(equilibrium=9e-9)
    (folder / "other.json").write_text(json.dumps(by_another_engine))
    assert answer_differences(*read_answers(str(folder / "other.json")), now) == []
    found = [answer_differences(each, now) for each in forged]
    assert all(found), [name for name, each in zip(FORGED, found, strict=True) if not each]
    assert [each.key.rpartition(".")[2] for each in found[0]] == ["limit", "margin"]
    assert [answer_differences(each, now) for each in reworded] == [[]] * len(REWORDED)
    (folder / "two.json").write_text(json.dumps({"schema": "hdassist.accept/1", "results": answers[:2]}))
    code, out, _ = here("accept", "--replay", "two.json", "--jobs", "1")
    assert code == 3
    assert re.findall(r"^17-1, .*: (\w+)$", out, re.MULTILINE) == ["agrees", "differs"]
    assert "F'_ior at 4 N·m.limit: 61 then, 60 now" in out


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        ([], 2, "no drive is named"),
        (["lot.csv", "vzp160"], 2, "cannot be combined with other drives or lots"),
        (["lot.csv", "--serial", "1"], 2, "measured values apply to a single drive"),
        (["lot.csv", "--preset", SMALL, "--budget", "luck=1"], 2, "--budget luck=1"),
        (["lot.csv", "--preset", SMALL, "--set", "gears.zz=1"], 2, "gears.zz: unknown key"),
        (["lot.csv", "--csv", "-", "--junit", "-"], 2, "can use standard output"),
        (["lot.csv", "--resume"], 2, "--jsonl FILE"),
        (["vzp160", "--resume", "--jsonl", "x"], 2, "--preset, --jsonl and --resume apply to lots only"),
        (["none.csv"], 4, "no such file: none.csv"),
        (["--replay", "lot.csv"], 4, "is not valid JSON"),
        (["--replay", "none.json"], 4, "no such file: none.json"),
        (
            ["--replay", "x.json", "--limit", "F_ior=3"],
            2,
            "--replay takes its inputs and options from the stored result",
        ),
        (
            ["--replay", "x.json", "--set", "acceptance.rule=simple"],
            2,
            "--replay takes its inputs and options from the stored result",
        ),
        (["--replay", "x.json", "--serial", "a"], 2, "--replay takes its inputs and options from the stored result"),
    ],
)
def test_faults_end_clearly(folder, here, args, code, words):
    before = set(folder.iterdir())
    ended, out, said = here("accept", *args)
    assert (ended, out) == (code, "")
    assert words in said
    assert set(folder.iterdir()) == before


def test_hint_of_stored_results_names_resume_before_force(folder, here):
    (folder / "a.jsonl").write_text("{}\n")
    (folder / "a.csv").write_text("\n")
    code, _, said = here(*MEASURED, "--jsonl", "a.jsonl", "--csv", "a.csv")
    assert code == 2
    assert said.startswith("error: a.jsonl already exists") and said.index("--resume") < said.index("--force")
    assert (folder / "a.jsonl").read_text() == "{}\n"


def test_two_runs_do_not_write_the_same_answers(folder):
    args = (*MEASURED, "--jsonl", "a.jsonl", "--resume")
    assert run(*args, cwd=folder).returncode == 4  # a broken row
    before = (folder / "a.jsonl").read_bytes()
    with open_kept(str(folder / "a.jsonl"), KeptOwner(command="accept", inputs={}), ANSWERS):
        second = run(*args, cwd=folder)
    assert second.returncode == 2
    assert second.stdout == ""
    assert "a.jsonl is being written by another run" in second.stderr
    assert (folder / "a.jsonl").read_bytes() == before
    assert len((folder / "a.jsonl").read_text().splitlines()) == 6


def test_resumed_lot_replaces_only_the_tables_of_its_last_run(folder, here):
    args = (*MEASURED, "--jsonl", "a.jsonl", "--csv", "a.csv", "--junit", "a.xml", "-q", "--resume")
    assert here(*args)[0] == 4
    first = [(folder / name).read_text(encoding="utf-8") for name in ("a.csv", "a.xml")]
    assert here(*args)[0] == 4  # the same rows, broken ones done again
    again = [(folder / name).read_text(encoding="utf-8") for name in ("a.csv", "a.xml")]
    assert [text.count("\n") for text in again] == [text.count("\n") for text in first]
    for name in ("a.csv", "a.xml"):
        (folder / name).write_text("serial,preset\n<?xml mine")
        code, out, said = here(*args)
        assert (code, out) == (2, "")
        assert f"{name} already exists" in said
        assert (folder / name).read_text() == "serial,preset\n<?xml mine"
        (folder / name).unlink()


@pytest.mark.thorough
def test_an_answer_of_another_schema_is_refused_by_its_number(folder, here):
    assert here(*MEASURED, "--json", "-o", "a.json")[0] == 4
    assert here(*MEASURED, "--jsonl", "a.jsonl", "-q")[0] == 4
    told = json.loads((folder / "a.json").read_text())["results"][0]
    assert told["schema"] == "hdassist.accept/2"
    (folder / "old.json").write_text(json.dumps({**told, "schema": "hdassist.accept/1", "solver": "engine"}))
    with open_kept(
        str(folder / "old.jsonl"), KeptOwner(command="accept", inputs={}), RecordKind(TypeAdapter(dict))
    ) as kept:
        kept.append([{**told, "schema": "hdassist.accept/1"}])
    for args in (
        ("--replay", "old.json"),
        ("--replay", "old.jsonl"),
        (*MEASURED[1:], "--jsonl", "old.jsonl", "--resume"),
    ):
        code, out, said = here("accept", *args)
        assert (code, out) == (4, "")
        assert (
            "the schema is hdassist.accept/1, but this version of hdassist reads and writes hdassist.accept/2" in said
        )


@pytest.mark.parametrize(
    "text", ['{"results": []}', '{"results": [], "mine": 1}\n', "[]\n", '{"schema": "mine/1"}\n', "mine", "\n \n"]
)
def test_resume_refuses_a_file_not_written_by_hdassist(folder, text):
    (folder / "a.jsonl").write_text(text)
    done = run(*MEASURED, "--jsonl", "a.jsonl", "--resume", cwd=folder)
    assert (done.returncode, done.stdout) == (2, "")
    assert "a.jsonl exists and was not written by hdassist" in done.stderr
    assert (folder / "a.jsonl").read_text() == text


def test_a_lot_without_one_answer_says_so(folder, here):
    (folder / "lot.csv").write_text("serial;F_ior@1;limit F_ior@1\na;28;40\nb;;x\n")
    code, page, _ = here("accept", "lot.csv", "--preset", SMALL, "--measured-only")
    assert code == 4
    assert page.splitlines()[:2] == [
        "lot.csv, 2 drives: 2 DATA_ERROR", "no yield, because no drive has PASS or FAIL; the table gives the reasons"
    ]  # fmt: skip


def test_a_fault_that_many_rows_share_is_named_once(folder, here):
    (folder / "lot.csv").write_text("serial;F_ior@1\n" + "".join(f"{k};28\n" for k in range(4)))
    code, page, said = here("accept", "lot.csv", "--preset", SMALL, "--measured-only")
    assert code == 4
    assert page.count("has no acceptance limit") == said.count("has no acceptance limit") == 1
    assert page.count("as 0") == 3
    assert said.rstrip().endswith("note: the same errors occur in 3 further rows")


def test_an_empty_limit_is_named_by_its_cell(folder, here):
    (folder / "lot.csv").write_text("serial;F_ior@1;limit F_ior@1;limit lost_motion\na;28±1;40;\nb;28±1;;\nc;28±1;;\n")
    code, page, said = here("accept", "lot.csv", "--preset", SMALL, "--measured-only", "--csv", "figures.csv")
    assert code == 4
    cell = "limit F_ior@1 (and 1 more): the cell is empty, and small has no acceptance limit"
    assert f"error: b: lot.csv:3: {cell}" in in_a_line(said)
    assert f"lot.csv:4: {cell}" in (folder / "figures.csv").read_text()
    assert "as b" in page


def test_preset_error_is_reported_for_every_row_that_uses_it(folder):
    (folder / "lot.csv").write_text("serial;preset;limit F_ior@1\n1;none;9\n2;none;9\n3;folder;9\n")
    (folder / "folder").mkdir()
    done = run("accept", "lot.csv", "--json", cwd=folder)
    answers = json.loads(done.stdout)["results"]
    assert [answer["serial"] for answer in answers] == ["1", "2", "3"]
    assert [answer["error"]["message"].partition(": ")[2] for answer in answers] == (
        ["preset: no such preset or file: none"] * 2 + ["preset: folder is a directory, not a preset"]
    )
    assert all(answer["request"]["limits"] == ["F_ior@1=9"] for answer in answers)


@pytest.mark.parametrize(
    ("text", "words"), [("serial;mine\n1;2\n", "mine: no column of a lot file has this name"), ("", "empty")]
)
def test_unusable_table_is_an_error_in_json_too(folder, here, text, words):
    (folder / "bad.csv").write_text(text)
    code, out, said = here("accept", "bad.csv", "--preset", SMALL, "--json", "--junit", "bad.xml")
    told = json.loads(out)
    assert (code, told["exit_code"], told["file"]["name"]) == (4, 4, "bad.csv")
    assert words in told["error"]["message"]
    assert words in said
    assert not (folder / "bad.xml").exists()


def test_a_record_in_place_of_a_lot_points_to_measure(folder, here):
    (folder / "run.csv").write_text("phi_h_deg,error_arcsec\n0,1\n1,2\n")
    code, _, err = here("accept", "run.csv")
    assert code == 4
    assert "no column has a name that is valid in a lot" in err
    assert "hdassist measure run.csv or hdassist accept PRESET --measured TORQUE=run.csv" in err


@pytest.mark.thorough
def test_identical_recordings_raise_a_warning_and_common_errors_print_once(folder, here):
    (folder / "copy.csv").write_bytes((folder / "run.csv").read_bytes())
    rows = ["serial;measured@4;limit F_ior@4", "A;run.csv;60", "B;copy.csv;60", "C;gone.csv;60"]
    (folder / "lot.csv").write_text("\n".join(rows) + "\n")
    words = "A, B contain the same recording: run.csv, copy.csv"
    code, out, told = here(*MEASURED, "--json")
    assert (code, json.loads(out)["warnings"]) == (4, [words])
    assert f"warning: {words}" in told
    code, _, told = here("accept", "lot.csv", *STATED)
    assert code == 4
    assert told.count("preset: missing") == 1
    assert "note: the same errors occur in 2 further rows" in told


def test_drive_nearest_to_its_limit_is_turned_first(folder, here):
    rows = [
        "serial;F_ior@1;limit F_ior@1;F_ior@4;limit F_ior@4;phases.xi_b",
        "far;50±1;0,5;;;",
        "near;50±1;40;60±1;30;61",
    ]
    (folder / "lot.csv").write_text("\n".join(rows) + "\n")
    words = in_a_line(here(*MEASURED)[1])
    turning = f"next hdassist mount {SMALL} h0=60 --set phases.xi_b=61 --limit F_ior@4=30 --trial-torque 4"
    assert words.index("near (") < words.index("far (") < words.index(turning)
