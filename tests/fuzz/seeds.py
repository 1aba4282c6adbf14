"""Inputs of every kind that the tool takes as they are meant, and commands that read them, for a fuzzer to change."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from typer.main import get_command

from hdassist.interface.cli import app
from tests.fuzz import gentle, mutate
from tests.fuzz.drives import preset, toothed
from tests.fuzz.mutate import Rng, pick
from tests.helpers.process import ROOT, SMALL, run
from tests.helpers.support import fresh_preset

Args = tuple[str, ...]
Files = dict[str, bytes]
JOBS = ("--jobs", "1")


@dataclass(frozen=True)
class Input:
    """A command line, the files of the folder that it runs in, and those of them that it may write to.

    sound: of kept work that was edited, the text before: of anything but its beginning not a word may be believed.
    """

    kind: str
    args: Args
    files: Files
    kept: Args = ()
    sound: dict[str, str] = field(default_factory=dict)


DRIVE = preset({**toothed(30), "operation.M_g": [1.0], "acceptance.F_ior": {"1": 60}})  # solved in 0.2 s
ONCE = "".join(
    f"{2 * k},{9 * math.sin(math.radians(2 * k)) + 2 * math.cos(math.radians(4 * k)):.4f}\n" for k in range(181)
)
RATIO = ("--ratio", "15")
TRACES: tuple[tuple[str, Args], ...] = (  # with the options that they need
    ("cam_deg,error_arcsec\n" + ONCE, ()),
    ("# rig 7\n# torque: 1\n" + ONCE.replace(",", ";").replace(".", ",") + "# end\n", ()),
    (
        "enc1 [deg]\tenc2 [deg]\n"
        + "".join(f"{k % 360}\t{k / 15 % 360 + 0.001 * math.sin(k / 57):.6f}\n" for k in range(0, 720, 3)),
        ("--angle", "enc1", "--second", "enc2"),
    ),
    ('"Winkel","Fehler"\n' + "".join(f'"{k}","{k % 7}"\n' for k in range(0, 360, 3)), ()),
    (
        "phi_g error\n"
        + "".join(f"{k / 15:.5f}   {math.sin(k / 40):.5f}\n" for k in [*range(0, 400, 4), *range(400, 0, -4)]),
        (),
    ),
)
COUNTS: tuple[tuple[str, Args], ...] = (  # encoders that count, of 4000 and a million counts a revolution
    (
        "cam,out\n"
        + "".join(
            f"{round(4000 * x)},{round(1e6 * (x / 15 + 2e-5 * math.sin(12.566 * x)))}\n"
            for x in (k / 60 + 0.003 * math.sin(k * k) for k in range(910))
        ),
        ("--angle", "cam", "--second", "out", "--angle-unit", "4000,1000000"),
    ),
)
POSITIONS: tuple[tuple[str, Args], ...] = (
    (
        "target_deg,deviation_arcsec,side\n"
        + "".join(
            f"{10 * k},{9 * math.sin(k / 2) + 2 * n + 5 * (side == '-')},{side}\n"
            for n in range(3)
            for side in "+-"
            for k in range(36)
        ),
        (),
    ),
    (
        "target_deg;output_deg\n"
        + "".join(
            f"{10 * k};{10 * k + 0.003 * math.sin(k / 2) + 0.0002 * n:.6f}\n" for n in range(2) for k in range(36)
        ),
        (),
    ),
)
LOOPS: tuple[tuple[str, Args], ...] = (
    (
        "torque_Nm,twist_arcsec,place\n"
        + "".join(
            f"{4 * math.sin(k / 15.92):.4f},{30 * math.sin(k / 15.92 - 0.15) + math.cos(k / 15.92):.4f},1\n"
            for k in range(126)
        ),
        (),
    ),
)
PITCH: tuple[tuple[str, Args], ...] = (
    (
        "# form: cumulative\n# unit: um\n# sense: cw\n# mark: 3\n"
        + "".join(f"{k}; {(k * 7) % 11 - 5}\n" for k in range(1, 33)),
        (),
    ),
    (
        "tooth,f_pt [um] left,f_pt [um] right\n" + "".join(f"{k},{(-1) ** k},{-((-1) ** k)}\n" for k in range(1, 33)),
        ("--pitch-flank", "left"),
    ),
    ("Zahn\tFp/mm\n" + "".join(f"{k}\t{math.sin(k / 5.0928) / 99:.5f}\n".replace(".", ",") for k in range(32)), ()),
)
LOT = "serial;preset;measured@1;limit F_ior@1\nA1;drive.yaml;run.csv;60\nA2;drive.yaml;run.csv;\n"
LOTS = (
    LOT,
    "# lot 3\nserial,measured,limit order_2,lost_motion,limit lost_motion,note\n"
    "B1,1=run.csv,5,3±1,9,x\nB2,run.csv,4,,,\n",
    "preset\tserial\tmeasured\tgears.j_n\tlimit turn_range\n"
    "drive.yaml\t1\trun.csv\t5,5\t40\nvzp160\t2\t1=run.csv\t\t40\n",
)
TARGETS = """\
schema: hdassist.targets/1
name: rig, drive 17
unknowns:
  gears.j_n: {low: 0, high: 20}
  supports.C_2: {low: 5e3, high: 1e5}
targets:
  - {quantity: F_ior, M_g: 1, phase: 180, value: 20.1, tolerance: 0.5}
  - {quantity: self_error, M_g: 1, low: 0.25, high: 2.0}
  - {quantity: K_2, T_1: 0.5, T_2: 1 N*m, value: 5e3, tolerance: 10 %}
"""
LOADED = {"drive.yaml": DRIVE.encode(), "run.csv": TRACES[0][0].encode()}
MEASURED = ("--measured-only", *JOBS)


@cache
def presets() -> Args:
    """Texts of presets: those of the library, of a test, as one is begun, and the drive of the fuzzer."""
    library = sorted((Path(ROOT) / "presets").glob("*.yaml"))
    texts = (file.read_text(encoding="utf-8") for file in [*library, Path(SMALL)])
    more = "schema: hdassist.preset/1\nname: more\n" + Path(SMALL).read_text(encoding="utf-8").split("name: small\n")[1]
    more += (
        "mounting: {fixed: rigid, holes: 12, allowed: [0, 3]}\nuncertainty: {phases.xi_b: 10}\n"
        "acceptance: {F_ior: {1: 60, all: 70}, order_amplitude: {2: 5}, rule: guard}\n"
        "source: {gears.m: {kind: given, ref: page 6}, gears.j_n: {kind: assumed, ref: x}}\n"
    )
    return *texts, more, fresh_preset("fresh"), DRIVE


@cache
def answers() -> Args:
    """Files of answers: of a lot as lines, of a measured drive, of a predicted one, of several."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        for file, content in {**LOADED, "lot.csv": LOT.encode()}.items():
            (folder / file).write_bytes(content)
        asked = ("--measured", "1=run.csv", *MEASURED, "--json")
        run("accept", "lot.csv", *MEASURED, "--jsonl", "lot.jsonl", cwd=folder)
        return (
            (folder / "lot.jsonl").read_text(),
            run("accept", "drive.yaml", *asked, cwd=folder).stdout,
            run("accept", "drive.yaml", *JOBS, "--json", cwd=folder).stdout,
            run("accept", "drive.yaml", "none", *JOBS, "--json", cwd=folder).stdout,
        )


RUNS: tuple[Args, ...] = (
    ("tolerance", "drive.yaml", "-n", "4", "--results", "kept.jsonl", *JOBS),
    ("sweep", "drive.yaml", "--vary", "gears.x_b=1.2:4:4", "-o", "kept.jsonl", *JOBS),
)


@cache
def results(args: Args) -> str:
    """A file of results of a command."""
    with TemporaryDirectory() as name:
        (Path(name) / "drive.yaml").write_text(DRIVE)
        done = run(*args, cwd=name)
        assert done.returncode == 0, done.stderr
        return (Path(name) / "kept.jsonl").read_text()


def _kept(kind: str, args: Args, files: Files, file: str, given: str, rng: Rng) -> Input:
    """A command that goes on with kept work: edited as anyone may, with checksums that hold, or cut at its end."""
    if rng.random() < 0.5:
        return Input(kind, args, files | {file: gentle.lines_text(given, rng)}, (file,), {file: given})
    if rng.random() < 0.5:
        return Input(kind, args, files | {file: mutate.json_text(given, rng)}, (file,), {file: given})
    return Input(kind, args, files | {file: mutate.kept_text(given, rng)}, (file,))


def preset_input(rng: Rng) -> Input:
    changed = _yaml(pick(rng, presets()), rng)
    how: Args = pick(rng, (("presets", "validate"), ("presets", "show", "--resolved"), ("check", *JOBS)))
    more: Args = pick(rng, ((), (), ("--json",), ("--set", f"cam.W_0={mutate.word(rng)}")))
    return Input("preset", (*how, "given.yaml", *more), {"given.yaml": changed})


def targets_input(rng: Rng) -> Input:
    args = ("calibrate", "drive.yaml", "--targets", "targets.yaml", "--evaluations", "8", *JOBS)
    return Input("targets", args, LOADED | {"targets.yaml": _yaml(TARGETS, rng)})


def _table(text: str, rng: Rng) -> bytes:
    """Return a table changed so that it is mostly refused, or, as often, so that it mostly reaches a result."""
    return gentle.table_text(text, rng) if rng.random() < 0.5 else mutate.table_text(text, rng)


def _yaml(text: str, rng: Rng) -> bytes:
    return gentle.yaml_text(text, rng) if rng.random() < 0.5 else mutate.yaml_text(text, rng)


def counts_input(rng: Rng) -> Input:
    """A recording of two encoders that count."""
    text, form = pick(rng, COUNTS)
    more: Args = pick(rng, ((), ("--json",), ("--robust",), ("--drift", "linear"), ("--wrap", "2000")))
    return Input("counts", ("measure", "given.csv", *RATIO, *form, *more), {"given.csv": _table(text, rng)})


def positions_input(rng: Rng) -> Input:
    """A test at positions of the output, measured or held against a limit."""
    text, form = pick(rng, POSITIONS)
    limit = ("--limit", "positioning=60", "--budget", "encoder=0.3,coupling=0.2,reseating=0.3,temperature=0.4")
    how: Args = pick(
        rng,
        (
            ("measure", "given.csv", *form),
            ("measure", "given.csv", *RATIO, *form, "--json"),
            ("measure", "given.csv", *form, "--error-unit", pick(rng, ("arcmin", "deg", "mm"))),
            ("accept", "drive.yaml", "--measured", "1=given.csv", *form, *limit, *MEASURED),
        ),
    )
    return Input("positions", how, LOADED | {"given.csv": _table(text, rng)})


def loop_input(rng: Rng) -> Input:
    """A torque loop, measured or held against a limit."""
    text, form = pick(rng, LOOPS)
    how: Args = pick(
        rng,
        (
            ("measure", "given.csv", *form),
            ("measure", "given.csv", *form, "--json", "--error-unit", pick(rng, ("arcsec", "arcmin", "deg"))),
            ("accept", "drive.yaml", "--measured", "1=given.csv", "--limit", "lost_motion=60", *MEASURED),
        ),
    )
    return Input("loop", how, LOADED | {"given.csv": _table(text, rng)})


def trace_input(rng: Rng) -> Input:
    text, form = pick(rng, TRACES)
    how: Args = pick(
        rng,
        (
            ("measure", "given.csv", *RATIO, *form),
            ("measure", "given.csv", *form, "--json"),
            ("measure", "given.csv", "given.csv", *RATIO, *form, "--json"),
            ("measure", "given.csv", *RATIO, "--angle", mutate.word(rng), "--no-plot"),
            ("measure", "given.csv", *RATIO, *form, "--drift", "quadratic", "--orders", "1-3", "--wrap", "360"),
            ("accept", "drive.yaml", "--measured", "1=given.csv", *form, *MEASURED),
            ("compare", "drive.yaml", "given.csv", *form, "--no-plot"),
        ),
    )
    return Input("trace", how, LOADED | {"given.csv": _table(text, rng)})


def pitch_input(rng: Rng) -> Input:
    text, form = pick(rng, PITCH)
    more: Args = pick(rng, ((), (), (), ("--pitch-form", "single"), ("--mark-b", mutate.word(rng))))
    if rng.random() < 0.5:  # as it is meant, but for readings and marks
        numbers = re.sub(r"(?<=[,;\t] )\d|(?<=[,;\t])\d", lambda found: str(int(rng.integers(10))), text)
        text, more = numbers, pick(rng, ((), ("--mark-b", str(int(rng.integers(1, 33))))))
        args = ("check", "drive.yaml", "--pitch-b", "given.csv", *form, *more, "--draws", "1", *JOBS)
        return Input("pitch", args, LOADED | {"given.csv": text.encode()})
    args = (pick(rng, ("check", "mount")), "drive.yaml", "--pitch-b", "given.csv", *form, *more, *JOBS)
    return Input("pitch", args, LOADED | {"given.csv": _table(text, rng)})


def lot_input(rng: Rng) -> Input:
    if rng.random() < 0.2:
        drives = {f"lot/{pick(rng, ('a', 'b', 'x y'))}.{pick(rng, ('yaml', 'yml'))}": DRIVE.encode() for _ in range(2)}
        changed = mutate.yaml_text(DRIVE, rng)
        files = {**drives, "lot/a.yaml": changed, "lot/a@1.csv": LOADED["run.csv"], f"lot/{_name(rng)}.csv": b"1,2\n"}
        return Input("lot", ("accept", "lot", *MEASURED), files)
    more: Args = pick(
        rng,
        (
            (),
            ("--preset", "drive.yaml"),
            ("--preset", "drive.yaml"),
            ("--jsonl", "out.jsonl"),
            ("--csv", "-"),
            ("--json",),
        ),
    )
    lot = pick(rng, LOTS)
    changed = gentle.lot_text(lot, rng) if rng.random() < 0.5 else mutate.table_text(lot, rng)
    files = LOADED | {"given.csv": changed}
    return Input("lot", ("accept", "given.csv", *more, *MEASURED), files)


def replay_input(rng: Rng) -> Input:
    more: Args = pick(rng, ((), ("--json",)))
    answer = pick(rng, answers())
    changed = gentle.lines_text(answer, rng) if rng.random() < 0.5 else mutate.json_text(answer, rng)
    return Input("replay", ("accept", "--replay", "given.json", *more, *JOBS), LOADED | {"given.json": changed})


def kept_input(rng: Rng) -> Input:
    args = ("accept", "lot.csv", "--jsonl", "kept.jsonl", "--resume", *MEASURED)
    files = LOADED | {"lot.csv": LOT.encode()}
    if rng.random() < 0.15:
        changed = mutate.json_text(pick(rng, answers()), rng)
        return Input("kept", args, files | {"kept.jsonl": changed}, ("kept.jsonl",), {"kept.jsonl": answers()[0]})
    return _kept("kept", args, files, "kept.jsonl", answers()[0], rng)


def results_input(rng: Rng) -> Input:
    args = pick(rng, RUNS)
    return _kept("results", args, {"drive.yaml": DRIVE.encode()}, "kept.jsonl", results(args), rng)


def options_input(rng: Rng) -> Input:
    """A command with arguments that fit it, and options with values that mostly do not."""
    line, options = pick(rng, list(_commands()))
    args = [*line]
    for _ in range(int(rng.integers(0, 4))):
        name, takes = pick(rng, options)
        args.append(name)
        if takes:
            args.append(_value(name, rng))
    if rng.random() < 0.4:
        at = int(rng.integers(len(args)))
        args[at] = mutate.text(args[at], rng, 1)[:6000] if rng.random() < 0.6 else mutate.word(rng)
    args = [f"x{arg}" if re.match(r"/(?!dev/|$)|\.\./", arg) else arg for arg in args]  # nothing beyond the folder
    files = LOADED | {"lot.csv": LOT.encode(), "targets.yaml": TARGETS.encode(), "pitch.csv": PITCH[0][0].encode()}
    return Input("options", tuple(args), files | {"mine.txt": b"mine\n"})


LINES: dict[str, Args] = {
    "accept": ("drive.yaml", *MEASURED), "calibrate": ("drive.yaml", "--targets", "targets.yaml", "--evaluations", "8"),
    "check": ("drive.yaml",), "compare": ("drive.yaml", "run.csv", "--no-plot"), "explain": ("F_ior",),
    "measure": ("run.csv", "--ratio", "15"), "mount": ("drive.yaml",),
    "stiffness": ("drive.yaml",), "trace": ("drive.yaml",), "trials": ("drive.yaml", "h0=28.1", "h4=17.3"),
    "tolerance": ("drive.yaml", "-n", "3"), "sensitivity": ("drive.yaml", "-n", "16"), "doctor": (),
    "allocate": ("drive.yaml", "--limit", "60", "-n", "20"), "sweep": ("drive.yaml", "--vary", "gears.j_n=5,6"),
    "explore": ("drive.yaml",), "report": ("drive.yaml",), "plan": ("drive.yaml", "--limit", "60"),
    "compensate": ("drive.yaml",),
    "presets list": (), "presets show": ("drive.yaml",), "presets validate": ("drive.yaml",), "presets new": ("x",),
    "presets schema": (),
}  # fmt: skip
MEANT: dict[str, Args] = {
    "--set": ("cam.W_0=1.1", "gears.j_n=5 um", "operation.M_g=[1, 2]", "tolerances.F_i2=±3"), "--torque": ("1", "2.5"),
    "--measured": ("1=run.csv", "run.csv"), "--value": ("lost_motion@1=3±1", "F_ior@1=20±2 arcsec"),
    "--limit": ("F_ior@1=60", "order_2=5", "lost_motion=9"), "--budget": ("encoder=0.3",), "--orders": ("1-12", "2"),
    "--csv": ("-", "new.csv", "mine.txt"), "--output": ("new.txt", "mine.txt"), "-o": ("new.txt", "-"),
    "--card": ("card.html", "card.txt", "-"), "--pitch-b": ("pitch.csv",), "--pitch-g": ("pitch.csv",),
    "--step": ("5", "30"), "--vary": ("cam.W_0=1:1.1:3", "operation.M_g=1,2"), "--results": ("new.jsonl", "mine.txt"),
    "--known": ("phases.xi_b",),
    "-n": ("3", "20"), "--yield": ("0.9",),
    "--verify": ("h5=16.2", "h0=run.csv"), "--jsonl": ("new.jsonl", "mine.txt"), "--junit": ("new.xml",),
    "--lang": ("ru",),
    "--replay": ("lot.csv",), "--write": ("new.yaml",),
    "--preset": ("drive.yaml",),
}  # fmt: skip


@cache
def _commands() -> tuple[tuple[Args, tuple[tuple[str, bool], ...]], ...]:
    """Each command with arguments that fit it, and its options: their names, and whether they take a value."""

    def below(command: object, path: Args) -> Iterator[tuple[Args, object]]:
        for name in getattr(command, "commands", {}):
            yield from below(command.get_command(None, name), (*path, name))  # type: ignore[attr-defined]  # a group of typer
        if not hasattr(command, "commands"):
            yield path, command

    found = []
    for path, command in below(get_command(app), ()):
        names = [
            (name, not getattr(one, "is_flag", False))
            for one in command.params  # type: ignore[attr-defined]  # a group of typer
            if one.param_type_name == "option"
            for name in one.opts
        ]
        found.append(((*path, *LINES[" ".join(path)]), (*names, ("--help", False))))
    return tuple(found)


def _value(name: str, rng: Rng) -> str:
    meant = MEANT.get(name, ("1", "0", "fit", "linear"))
    what = rng.random()
    return (
        str(pick(rng, meant))
        if what < 0.4
        else mutate.text(pick(rng, meant), rng, 1)[:6000]
        if what < 0.7
        else mutate.word(rng)
    )


def _name(rng: Rng) -> str:
    """A name that a file can have."""
    return "".join(c for c in mutate.word(rng) if c not in "/\0")[:50] or "x"


KINDS: dict[str, Callable[[Rng], Input]] = {
    "preset": preset_input, "targets": targets_input, "trace": trace_input, "counts": counts_input,
    "positions": positions_input, "loop": loop_input, "pitch": pitch_input, "lot": lot_input,
    "options": options_input, "replay": replay_input, "kept": kept_input,
    "results": results_input,
}  # fmt: skip
