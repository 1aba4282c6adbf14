"""The worked examples of CONTRIBUTING.md, done to a copy of the package: each is then one like the others."""

import ast
import csv
import json
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from tests.helpers.process import CLEAN, SMALL, TINY, run_cold

ROOT = Path(__file__).parents[1]
EDIT = re.compile(
    r"^\d\. `([^`]+)`[^`]*?(?:(before|for) `([^`]+)`|a new file)[^`]*:\n\n   ```\w+\n(.*?)^   ```",
    re.MULTILINE | re.DOTALL,
)
EVIDENCE = """
from hdassist.belief.evidence import evidence_of, log_likelihood, stiffness_figures
from hdassist.drive.loading import load_preset

drive = load_preset({small!r})
told, proof = stiffness_figures(drive)
windup = told["windup"]
for share in (1.0, 0.5):
    measured = load_preset({small!r}, [f"measured.windup={{share * windup}} ± 1"])
    (found,) = evidence_of(measured)
    print(found.path, log_likelihood([found], told))
"""


@pytest.fixture
def package(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """A folder with a copy of the package, to which the edits of a section are done."""
    for folder in ("hdassist", "presets", "tests/preset"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    section = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").partition(f"\n## {request.param}\n")[2]
    edits = EDIT.findall(section.partition("\n## ")[0])
    assert len(edits) == section.partition("\n## ")[0].count("\n   ```") // 2
    for name, place, anchor, block in edits:
        file, new = tmp_path / name, textwrap.dedent(block)
        if not place:
            file.write_text(new, encoding="utf-8")
            continue
        before, line, after = re.split(rf"^(.*{re.escape(anchor)}.*\n)", file.read_text("utf-8"), flags=re.M)
        indent = line[: len(line) - len(line.lstrip())]
        file.write_text(before + textwrap.indent(new, indent) + line * (place == "before") + after, encoding="utf-8")
    return tmp_path


def run(package: Path, *args: str):
    return run_cold(*args, env={"PYTHONPATH": str(package)}, cwd=package)


@pytest.mark.thorough
@pytest.mark.parametrize("package", ["A check"], indirect=True)
def test_a_check_is_added_as_the_page_says(package: Path) -> None:
    done = run(package, "accept", SMALL, "--limit", "error_rms@1=200", "--limit", "error_rms@4=0.1", "--csv", "-")
    told = csv.DictReader(done.stdout.splitlines())
    assert [(row["code"], row["M_g_Nm"], row["verdict"]) for row in told] == [
        ("ERROR_RMS", "1.0", "PASS"), ("ERROR_RMS", "4.0", "FAIL"),
    ]  # fmt: skip
    assert done.returncode == 3
    assert "acceptance.error_rms" in run(package, "explain", "ERROR_RMS").stdout


@pytest.mark.thorough
@pytest.mark.parametrize("package", ["A preset field"], indirect=True)
def test_a_preset_field_is_added_as_the_page_says(package: Path) -> None:
    answers = [
        json.loads(run(package, "stiffness", TINY, "--set", f"bearing.k_g={k_g}", "--json").stdout)
        for k_g in ("1", "0.5 ± 0.1")
    ]
    stiff, soft = (answer["positive"][-1]["stiffness_Nm_per_rad"] for answer in answers)
    assert 0.5 * stiff < soft < 0.999 * stiff
    assert "0.3 to 1" in run(package, "explain", "bearing.k_g").stdout
    assert run(package, "presets", "new", "own", "--ratio", "100").stdout.count("bearing.k_g") == 1
    tests = (package / "tests/preset/test_fields.py").read_text(encoding="utf-8")
    assigned = [node for node in ast.parse(tests).body if isinstance(node, ast.Assign)]
    moves = next(node.value for node in assigned if ast.unparse(node.targets[0]) == "MOVES")
    assert "bearing.k_g" in [row.elts[0].value for row in moves.elts]


@pytest.mark.thorough
@pytest.mark.parametrize("package", ["A kind of reference data"], indirect=True)
def test_a_kind_of_evidence_is_added_as_the_page_says(package: Path) -> None:
    told = subprocess.run(
        [sys.executable, "-c", EVIDENCE.format(small=SMALL)], env=CLEAN | {"PYTHONPATH": str(package)}, cwd=package,
        capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip
    assert told[::2] == ["measured.windup"] * 2
    assert float(told[1]) == pytest.approx(0, abs=1e-6)
    assert float(told[3]) < -1


@pytest.mark.thorough
@pytest.mark.parametrize("package", ["A command"], indirect=True)
def test_a_command_is_added_as_the_page_says(package: Path) -> None:
    assert "radii of the teeth" in run(package, "--help").stdout
    assert "only the tips" in run(package, "radii", "--help").stdout
    assert "mid-line of the rim" in run(package, "radii", TINY).stdout
    assert set(json.loads(run(package, "radii", TINY, "--tips", "--json").stdout)["radii_mm"]) == {"r_ag", "r_ab"}
