"""Relations between two runs of check, mount, plan, stiffness or trace that ask the same question in two ways.

A drive is drawn at random, asked once as it is and once with its preset rewritten: in other units, in another order,
by `--set` in place of the file, as its mirror image. Both runs have to give the same numbers, but for the signs and the
hole numbers of a mirror image.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tests.fuzz.mutate import Rng
from tests.fuzz.seeds import DRIVE
from tests.helpers.process import run

Document = dict[str, Any]
Args = tuple[str, ...]
HOLES = 12
TRIALS = (0, 2, 5, 7)  # holes in which F'_ior is taken as measured
CLOSE = 1e-6  # of a number; two routes to it round otherwise
NOTHING = 1e-6  # arcsec
QUICK = ("--draws", "1", "--jobs", "1", "--json")
UNITS: dict[str, tuple[str, float]] = {  # of a field, another unit and its factor
    "tolerances": ("mm", 1e-3), "phases": ("rad", np.pi / 180), "bearing.g_b": ("mm", 1e-3), "gears.j_n": ("mm", 1e-3),
}  # fmt: skip
VOLATILE = {  # keys that say how and of which text an answer was made, or are words
    "sha256", "overrides", "name", "certificate", "cross_check", "warnings", "next", "version", "head", "file",
    "order", "text", "preset", "source", "steps",
}  # fmt: skip


@dataclass(frozen=True)
class Relation:
    """A pair of runs of a command that have to agree.

    texts: of their presets; args: of their command lines; figures_of: what of each answer is compared.
    """

    name: str
    texts: tuple[str, str]
    args: tuple[Args, Args]
    figures_of: tuple[Callable[[Document], Any], Callable[[Document], Any]]


def random_drive(rng: Rng) -> Document:
    """Return a preset whose deviations are all known."""
    drive: Document = json.loads(DRIVE)
    tolerances = drive["tolerances"]
    for name in ("F_i1", "F_i2", "e_hb", "e_hh"):
        tolerances[name] = float(rng.integers(5, 60))
    for name in drive["phases"]:
        drive["phases"][name] = float(rng.integers(-180, 180))
    drive["gears"]["j_n"] = float(rng.integers(0, 12))
    drive["operation"]["M_g"] = [float(rng.integers(1, 5))]
    return drive


def text_of(drive: Document) -> str:
    """Return a preset as YAML, of which JSON is a part."""
    return json.dumps(drive)


def in_another_order(drive: Document, rng: Rng) -> Document:
    """Return the same preset with its sections and keys in another order."""
    keys = [list(drive)[k] for k in rng.permutation(len(drive))]
    return {key: in_another_order(drive[key], rng) if isinstance(drive[key], dict) else drive[key] for key in keys}


def in_other_units(drive: Document) -> Document:
    """Return the same preset with lengths, angles and torques in other units."""
    changed = deepcopy(drive)
    for path, (unit, factor) in UNITS.items():
        section, _, name = path.partition(".")
        for key in [name] if name else list(changed[section]):
            changed[section][key] = f"{changed[section][key] * factor!r} {unit}"
    changed["operation"]["M_g"] = [f"{M_g * 1e3!r} N*mm" for M_g in drive["operation"]["M_g"]]
    return changed


def by_set(drive: Document, path: str) -> tuple[Document, Args]:
    """Return the preset with another value of a field, and the option that puts the own one back."""
    section, name = path.split(".")
    changed = deepcopy(drive)
    changed[section][name] = 1.0
    return changed, ("--set", f"{path}={drive[section][name]!r}")


def mirrored(drive: Document) -> Document:
    """Return the mirror image of a drive: directions and torques turn the other way."""
    changed = deepcopy(drive)
    changed["phases"] = {name: -angle for name, angle in drive["phases"].items()}
    changed["operation"]["M_g"] = [-M_g for M_g in drive["operation"]["M_g"]]
    return changed


def figures(answer: Document) -> Any:
    """Return an answer without the keys that are words, or say how it was made."""
    if isinstance(answer, dict):
        amplitude = answer.get("amplitude_arcsec", 1.0)
        if isinstance(amplitude, float) and amplitude < NOTHING:
            return {}  # the phase of no amplitude is rounding
        return {key: figures(value) for key, value in answer.items() if key not in VOLATILE}
    if isinstance(answer, list):
        return [figures(entry) for entry in answer]
    return answer


def F_ior(answer: Document) -> list[float]:
    """Return F'_ior [arcsec] at each torque of `check`."""
    return [point["F_ior_arcsec"] for point in answer["operating_points"]]


def by_hole(answer: Document) -> list[tuple[int, Any]]:
    """Return F'_ior of `mount` at each torque, by the number of the hole."""
    return sorted((position["hole"], position["F_ior_arcsec"]) for position in answer["positions"])


def by_mirrored_hole(answer: Document) -> list[tuple[int, Any]]:
    """Return the same of a mirror image, by the number that the hole has in the drive itself."""
    return sorted((-hole % HOLES, F_ior_arcsec) for hole, F_ior_arcsec in by_hole(answer))


def relations(seed: int) -> Iterator[Relation]:
    """Yield the relations of one random drive."""
    rng = np.random.default_rng([59, seed])
    drive = random_drive(rng)
    text = text_of(drive)
    torque = drive["operation"]["M_g"][0]
    field = ("tolerances.F_i2", "tolerances.e_hb", "phases.xi_b", "gears.j_n")[seed % 4]
    for command in (("check",), ("mount",), ("compensate",), ("stiffness",), ("trace", "-n", "1")):
        is_sampled = command[0] in ("check", "mount", "compensate")
        args = (*command, "drive.yaml", *(QUICK if is_sampled else ("--json",)))
        other = text_of(in_another_order(drive, rng))
        yield Relation(f"{command[0]}: order of keys", (text, other), (args, args), (figures, figures))
        yield Relation(f"{command[0]}: units", (text, text_of(in_other_units(drive))), (args, args), (figures, figures))
        other, option = by_set(drive, field)
        yield Relation(f"{command[0]}: --set", (text, text_of(other)), (args, (*args, *option)), (figures, figures))
    args = ("check", "drive.yaml", *QUICK)
    yield Relation("check: mirror image", (text, text_of(mirrored(drive))), (args, args), (F_ior, F_ior))
    several = deepcopy(drive)
    several["operation"]["M_g"] = [torque, torque + 1, torque + 2]
    alone = ("check", "drive.yaml", *QUICK, "--torque", f"{torque + 1:g}")

    def middle(answer: Document) -> list[float]:
        return [point["F_ior_arcsec"] for point in answer["operating_points"] if point["M_g_Nm"] == torque + 1]

    yield Relation("check: a torque beside others", (text_of(several), text), (args, alone), (middle, middle))

    args = ("mount", "drive.yaml", *QUICK)
    pair = (text, text_of(mirrored(drive)))
    yield Relation("mount: mirror image", pair, (args, args), (by_hole, by_mirrored_hole))
    values = [f"h{hole}={value:.2f}" for hole, value in zip(TRIALS, rng.uniform(20, 90, len(TRIALS)), strict=True)]
    shuffled = [values[k] for k in rng.permutation(len(values))]
    orders = (("mount", "drive.yaml", *values, *QUICK), ("mount", "drive.yaml", *shuffled, *QUICK))
    yield Relation("mount: order of values", (text, text), orders, (figures, figures))
    named = [value.replace("=", f"@{torque:g}=") for value in values]
    ways = (
        ("mount", "drive.yaml", *values, "--trial-torque", f"{torque:g}", *QUICK),
        ("mount", "drive.yaml", *named, *QUICK),
    )
    yield Relation("mount: --trial-torque and @", (text, text), ways, (by_hole, by_hole))
    limit = ("--limit", "60", "--json", "--jobs", "1")
    ways = (("plan", "drive.yaml", *limit), ("plan", "drive.yaml", *limit))
    yield Relation("plan: units", (text, text_of(in_other_units(drive))), ways, (figures, figures))


def _answer(text: str, args: Args) -> Document:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "drive.yaml").write_text(text, encoding="utf-8")
        done = run(*args, cwd=folder)
    assert done.returncode in (0, 3, 6), f"{args}: exit {done.returncode}: {done.stderr}"
    answer: Document = json.loads(done.stdout)
    return answer


def fault(relation: Relation) -> str:
    """Return what two runs differ by; empty if they agree."""
    first, second = (_answer(text, args) for text, args in zip(relation.texts, relation.args, strict=True))
    of_first, of_second = relation.figures_of
    return "; ".join(_differences(of_first(first), of_second(second), ""))


def _differences(first: Any, second: Any, path: str) -> Iterator[str]:
    if isinstance(first, dict) and isinstance(second, dict):
        if first.keys() != second.keys():
            yield f"{path}: other keys: {sorted(first.keys() ^ second.keys())}"
        for key in first.keys() & second.keys():
            yield from _differences(first[key], second[key], f"{path}.{key}")
    elif isinstance(first, list | tuple) and isinstance(second, list | tuple):
        if len(first) != len(second):
            yield f"{path}: {len(first)} and {len(second)} entries"
        else:
            for place, pair in enumerate(zip(first, second, strict=True)):
                yield from _differences(*pair, f"{path}[{place}]")
    elif isinstance(first, float) and isinstance(second, float | int):
        if abs(first - second) > CLOSE * max(abs(first), abs(second), 1.0):
            yield f"{path}: {first} and {second}"
    elif first != second:
        yield f"{path}: {first!r} and {second!r}"


def study(drives: int, seed: int) -> bool:
    """Print each relation that does not hold, and how many were asked; whether all hold."""
    asked, violated = 0, 0
    for number in range(seed, seed + drives):
        for relation in relations(number):
            asked += 1
            if found := fault(relation):
                violated += 1
                print(f"{number} {relation.name}: {found[:600]}", flush=True)
    print(f"{asked} relations of {drives} drives, {violated} violated")
    return violated == 0
