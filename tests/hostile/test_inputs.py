"""Inputs that nobody means: refused by name, soon, with an exit code of their own, and never as a bug."""

from __future__ import annotations

import json
import math
import os
import resource
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.helpers.process import CLEAN, COMMAND, TINY, run

LONG = "x" * 5000  # a name that no file can have
DIGITS = "1" * 30_000
BLANKS = " " * 60_000
SOON = 30  # s, on a busy machine: it takes one
MEMORY = 1 << 30  # bytes of addresses
REFUSED = (2, 4, 5)
TARGETS = """\
schema: hdassist.targets/1
unknowns: {gears.j_n: {low: 0, high: 20}}
targets:
  - %s
"""
TARGET = "{quantity: F_ior, M_g: 4, value: 20, tolerance: 1}"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to stand in, with targets, a lot, a trace, a pipe that nobody writes to, and a circle of links."""
    monkeypatch.chdir(tmp_path)
    Path("targets.yaml").write_text(TARGETS % TARGET)
    Path("lot.csv").write_text(f"serial,preset,limit F_ior@4\n1,{TINY},60\n")
    Path("run.csv").write_text("cam_deg,error_arcsec\n" + "".join(f"{k / 2},{k % 7}\n" for k in range(720)))
    os.mkfifo("pipe")
    for name in ("circle", "circle.txt"):
        Path(name).symlink_to(name)
    return tmp_path


class TooLong(BaseException):
    """Is no OSError, which would be told as a fault of a file."""


@pytest.fixture
def alarm():
    """End a test that hangs: in a file that is opened, a pattern that is matched, or a loop."""

    def ring(*_: object) -> None:
        raise TooLong

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(SOON)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


@pytest.fixture(scope="module")
def answer(tmp_path_factory):
    """An answer of accept as its file has it."""
    file = tmp_path_factory.mktemp("answer") / "answer.json"
    trace = file.with_name("run.csv")
    rows = (f"{k},{15 * math.sin(math.radians(k)):.4f}\n" for k in range(361))
    trace.write_text("cam_deg,error_arcsec\n" + "".join(rows))
    asked = ("--limit", "F_ior@4=60", "--measured", f"4={trace}", "--measured-only")
    assert run("accept", TINY, *asked, "--json", "-o", str(file)).returncode in (0, 6)
    return json.loads(file.read_text())


def soon(*args: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in a process with bounded time and memory."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))

    return subprocess.run(
        [*COMMAND, *args], stdin=subprocess.DEVNULL, capture_output=True, text=True, env=CLEAN, cwd=cwd, check=False,
        timeout=SOON, preexec_fn=limit,
    )  # fmt: skip


def require_refused(done: subprocess.CompletedProcess[str], *said: str) -> None:
    """A refusal says what is wrong on stderr, without a traceback, and no answer."""
    assert "internal error" not in done.stderr
    assert "Traceback" not in done.stderr
    assert done.returncode in REFUSED
    assert "error: " in done.stderr or done.returncode == 2
    for words in said:
        assert words in done.stderr


OPENED = {  # every place where a file is named to be read
    "preset": ("check",),
    "presets": ("presets", "validate"),
    "accepted": ("accept",),
    "trace": ("measure", "--ratio", "100"),
    "measured": ("accept", TINY, "--limit", "F_ior@4=60", "--measured"),
    "pitch": ("mount", TINY, "--pitch-b"),
    "targets": ("calibrate", TINY, "--targets"),
    "replay": ("accept", "--replay"),
    "resume": ("accept", "lot.csv", "--resume", "--jsonl"),
}


@pytest.mark.parametrize("file", ["/dev/zero", "pipe"])
@pytest.mark.parametrize("place", OPENED)
def test_endless_device_and_pipe_without_writer_are_refused(folder, alarm, place, file):
    require_refused(run(*OPENED[place], file), file)


@pytest.mark.thorough
@pytest.mark.parametrize("place", ["targets", "replay"])
def test_a_device_without_end_takes_no_memory(folder, place):
    require_refused(soon(*OPENED[place], "/dev/zero", cwd=folder), "/dev/zero")


@pytest.mark.parametrize("file", [LONG, "circle", "."])
@pytest.mark.parametrize("place", OPENED)
def test_impossible_file_name_is_refused_on_reading(folder, place, file):
    require_refused(run(*OPENED[place], file))


def test_a_pipe_with_a_writer_is_read(folder):
    reader, writer = os.pipe()
    os.write(writer, Path("run.csv").read_bytes())
    os.close(writer)
    assert run("measure", f"/dev/fd/{reader}", "--ratio", "100", "--json").stdout == (
        run("measure", "run.csv", "--ratio", "100", "--json").stdout.replace("run.csv", f"/dev/fd/{reader}")
    )
    os.close(reader)


def test_targets_from_standard_input_are_checked_like_a_file(folder):
    none = run("calibrate", TINY, "--targets", "-", stdin=TARGETS % "{quantity: none}")
    require_refused(none, "is not a known quantity")
    require_refused(run("calibrate", "-", "--targets", "-"), "standard input")


WRITTEN = {  # every place where a file is named to be written
    "output": ("check", TINY, "-o"),
    "csv": ("check", TINY, "--csv"),
    "card": ("mount", TINY, "--card"),
    "beside a card": ("mount", TINY, "--card", "card.txt", "-o"),
    "figures beside a card": ("mount", TINY, "--card", "card.txt", "--csv"),
    "lines": ("accept", "lot.csv", "--jsonl"),
    "suite": ("accept", "lot.csv", "--junit"),
    "found": ("calibrate", TINY, "--targets", "targets.yaml", "--write"),
    "new": ("presets", "new", "mine", "-o"),
}


@pytest.mark.parametrize("file", [f"{LONG}.txt", "circle.txt", "circle.txt/x.txt", "x\0.txt"])
@pytest.mark.parametrize("place", WRITTEN)
def test_impossible_file_name_is_refused_on_writing(folder, place, file):
    before = sorted(path.name for path in folder.iterdir())
    require_refused(run(*WRITTEN[place], file), "error: ")
    assert sorted(path.name for path in folder.iterdir()) == before
    assert Path("circle.txt").is_symlink()


@pytest.mark.parametrize(
    ("file", "words"),
    [
        (f"{LONG}.csv", "name too long"), ("circle", "symbolic links"), ("circle.txt", "symbolic links"),
        (".", "directory"), ("./pipe", "is empty"), ("/dev/zero", "the file is binary"), ("pipe", "is empty"),
    ],
)  # fmt: skip
def test_a_trial_whose_record_can_be_no_file_is_refused(folder, file, words):
    require_refused(run("trials", TINY, f"h0={file}"), words)


def preset_with(**lines: str) -> str:
    """The small preset with some of its values replaced."""
    text = Path(TINY).read_text()
    for old, new in lines.items():
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.mark.thorough
@pytest.mark.parametrize(
    "text",
    [
        f"{DIGITS}: 1",
        f"? {DIGITS} : 1",
        preset_with() + f"\nacceptance: {{F_ior: {{? {DIGITS}x : 1}}}}\n",
        preset_with() + f"\nacceptance: {{order_amplitude: {{? {DIGITS}x : 1}}}}\n",
        *(
            preset_with(**{"m: 1.5": f"m: {value}"})
            for value in (
                DIGITS, f"{DIGITS}x", f"1e{DIGITS}", f"'1{BLANKS}x'", f"'1 mm/{BLANKS}x'", f"'1 mm ± 1{BLANKS}x'",
                f"'{DIGITS} mm'", f"'1 {'+' * 60_000}'", f"[{'1, ' * 20_000}]", "1 " * 30_000,
            )
        ),
    ],
    ids=range(14),
)  # fmt: skip
def test_a_long_key_or_number_is_refused_soon(folder, alarm, text):
    Path("long.yaml").write_text(text)
    require_refused(run("presets", "validate", "long.yaml"), "long.yaml:")


@pytest.mark.parametrize("blanks", [2_000, 200_000])
def test_time_to_refuse_a_number_is_independent_of_its_blanks(blanks):
    from hdassist.drive.preset.text import convert, is_spread, read_spread

    begun = time.process_time()
    for read in (convert, read_spread):
        with pytest.raises(ValueError, match="must be a number"):
            read(f"1{' ' * blanks}x", "mm")
    assert not is_spread(f"1{' ' * blanks}x")
    assert time.process_time() - begun < 0.5


@pytest.mark.parametrize(
    ("step", "said"),
    [
        ("1e-7", "0.01 or more"),
        ("1e-320", "0.01 or more"),
        ("1e29", "expected a divisor of 360"),
        ("1e308", "out of range"),
    ],
)
@pytest.mark.parametrize("holes", ["0", "12"])
def test_positions_that_are_asked_for_are_bounded(alarm, step, said, holes):
    done = run("mount", TINY, "--step", step, "--set", f"mounting.holes={holes}")
    require_refused(done, said)
    assert done.returncode == 2


@pytest.mark.parametrize("trial", ["1e308:17.3", "-1e308:17.3", "h1e308:17.3", "h0=1e308", "nan:17.3", "inf:1"])
@pytest.mark.parametrize("holes", ["0", "12"])
def test_a_trial_beyond_what_can_be_measured_is_none(alarm, trial, holes):
    done = run("trials", TINY, trial, "--set", f"mounting.holes={holes}")
    require_refused(done)
    assert done.returncode == 2


@pytest.mark.parametrize("torque", ["1e308", "-1e308", "1.1e7", "0", "nan", "inf"])
def test_trial_torque_beyond_the_preset_range_is_refused(alarm, torque):
    done = run("trials", TINY, "h0=17.3", "--trial-torque", torque)
    is_number = abs(float(torque)) <= 1e30
    words = f"invalid torque {float(torque):g} N·m" if is_number else f"{float(torque):g} is out of range"
    require_refused(done, words)
    assert done.returncode == 2


@pytest.mark.parametrize("value", ["1e308", "1.1e6", "-1", "nan", "inf"])
def test_noise_beyond_what_can_be_measured_is_none(alarm, value):
    done = run("trials", TINY, "h0=17.3", "--noise", value)
    require_refused(done, "Invalid value for '--noise'")
    assert done.returncode == 2


@pytest.mark.parametrize("command", [("check", TINY), ("accept", "lot.csv"), ("trials", TINY, "h0=1"), ("mount", TINY)])
def test_so_many_processes_are_wrong_usage(folder, command):
    done = run(*command, "--jobs", "9" * 400)
    require_refused(done, "--jobs")
    assert done.returncode == 2


@pytest.mark.parametrize("ratio", ["1e308", "-1e308", "1e30", "1e-320", "0", "nan", "inf"])
def test_a_ratio_beyond_what_a_drive_has_is_refused(folder, ratio):
    usual = ratio in ("1e30", "1e-320", "0")
    words = "expected a multiple of 0.5 from 10 to 1000" if usual else "expected a number up to 1e+30"
    require_refused(run("measure", "run.csv", "--ratio", ratio), words)


@pytest.mark.parametrize("serial", ["s" * 4_000_000, '"' + "s" * 4_000_000 + '"', "s" * 20_000])
def test_a_cell_of_a_lot_is_bounded(folder, serial):
    Path("long.csv").write_text(f"serial,preset\n{serial},{TINY}\n")
    require_refused(run("accept", "long.csv"), "long.csv:2:1: the line has", "characters")


def test_lot_with_many_comments_is_refused_with_a_short_message(folder, alarm):
    Path("remarks.csv").write_text("serial,preset\n" + "# c\n" * 60_000 + "1,none\n")
    done = run("accept", "remarks.csv")
    require_refused(done, "none")
    assert len(done.stderr) < 2000


@pytest.mark.parametrize(
    "target",
    [
        "{quantity: {a: 1}}", "{quantity: [1]}", "{quantity: 1}", "{quantity: null}", "[1]", "1",
        "{quantity: F_ior, M_g: {a: 1}, value: 1, tolerance: 1}",
        "{quantity: F_ior, M_g: 4, value: 1, tolerance: {a: 1}}",
        "{quantity: trace, M_g: 4, tolerance: 1, file: {a: 1}}",
        f"{{quantity: trace, M_g: 4, tolerance: 1, file: {LONG}}}",
        "{quantity: trace, M_g: 4, tolerance: 1, file: /dev/zero}",
        "{quantity: trace, M_g: 4, tolerance: 1, file: pipe}",
    ],
)  # fmt: skip
def test_a_target_of_the_wrong_kind_is_a_finding(folder, target):
    Path("wrong.yaml").write_text(TARGETS % target)
    require_refused(run("calibrate", TINY, "--targets", "wrong.yaml"), "wrong.yaml:4:")


@pytest.mark.parametrize("text", ["[" * 100_000, "[" * 100_000 + "]" * 100_000, '{"a":' * 100_000, "9" * 100_000])
@pytest.mark.parametrize("end", ["", "\n"])
def test_an_answer_without_end_is_refused(folder, text, end):
    Path("answer.json").write_text(text + end)
    require_refused(run("accept", "--replay", "answer.json"), "answer.json")


FORGED = "1\nPASS"  # a second line where a name stands


def test_a_line_break_in_a_name_forges_no_line(folder, answer):
    require_refused(run("accept", TINY, "--serial", FORGED), "line break: '1\\nPASS'")
    Path("named.yaml").write_text(preset_with(**{"name: tiny": f"name: {json.dumps(FORGED)}"}))
    require_refused(run("check", "named.yaml"), "named.yaml:3:7: name: must be one line")
    Path("answer.json").write_text(json.dumps(answer | {"serial": FORGED}))
    require_refused(run("accept", "--replay", "answer.json"), "answer.json")


KEYS = ("left_out", "seed", "checks", "preset", "certificate", "rule", "measured", "limits", "reading", "cross_check")
ODD = ("5", "1" + "0" * 400, "{}", '"x"', "null")
WRONG = ("-1", "NaN", "-Infinity", "[[]]", "1" + "0" * 5000)


@pytest.mark.thorough
@pytest.mark.parametrize("value", ODD, ids=lambda text: text[:9])
@pytest.mark.parametrize("key", KEYS)
def test_no_value_of_an_answer_is_a_bug(folder, answer, key, value):
    for told in _with(answer, key):
        Path("answer.json").write_text(json.dumps(told).replace('"HERE"', value))
        done = run("accept", "--replay", "answer.json", "--jobs", "1")
        assert "internal error" not in done.stdout + done.stderr
        assert done.returncode in (0, 3, *REFUSED)  # it may be one that the answer could have had


@pytest.mark.parametrize("value", WRONG, ids=lambda text: text[:9])
@pytest.mark.parametrize("key", KEYS)
def test_a_value_that_no_answer_has_is_refused(folder, answer, key, value):
    for told in _with(answer, key):
        Path("answer.json").write_text(json.dumps(told).replace('"HERE"', value))
        require_refused(run("accept", "--replay", "answer.json", "--jobs", "1"), "answer.json")


def _with(answer, key):
    """The answer with another value at each of the places where it has a key."""
    request = answer["request"]
    told = [{**answer, key: "HERE"}] if key in answer else []
    return told + ([{**answer, "request": {**request, key: "HERE"}}] if key in request else [])


STDOUT = {
    "help": ("--help",),
    "list": ("presets", "list"),
    "new": ("presets", "new", "own"),
    "page": ("explain",),
    "accepted": ("accept", TINY, "--limit", "F_ior@4=60"),
    "lot": ("accept", "lot.csv"),
}


@pytest.mark.thorough
@pytest.mark.parametrize(("asked", "unbuffered"), [*((asked, "") for asked in STDOUT), ("help", "1"), ("list", "1")])
def test_full_device_as_standard_output_is_reported_as_an_error(folder, asked, unbuffered):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*COMMAND, *STDOUT[asked]], stdin=subprocess.DEVNULL, stdout=full, stderr=subprocess.PIPE, text=True,
            env=CLEAN | {"PYTHONUNBUFFERED": unbuffered}, cwd=folder, check=False, timeout=120,
        )  # fmt: skip
    assert done.returncode == 4
    assert "error: cannot write" in done.stderr
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr


@pytest.mark.thorough
@pytest.mark.parametrize(("args", "code"), [(("presets", "list"), 0), (("check", "none"), 4), (("check", "--none"), 2)])
def test_full_device_as_standard_error_keeps_result_and_exit_code(folder, args, code):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [*COMMAND, *args], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=full, text=True, env=CLEAN,
            check=False, timeout=120,
        )  # fmt: skip
    assert done.returncode == code
    assert ("vzp160" in done.stdout) == (code == 0)
