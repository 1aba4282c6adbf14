"""The worked example of CONTRIBUTING.md: done to a copy of the package, it is a check like the others."""

import csv
import re
import shutil
import textwrap
from pathlib import Path

from tests.process import run_cold

ROOT = Path(__file__).parents[1]


def test_a_check_is_added_as_the_page_says(tmp_path):
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    field, declared, check = (textwrap.dedent(block) for block in re.findall(r" +```\w+\n(.*?) +```", page, re.S)[:3])
    shutil.copytree(ROOT / "hdassist", tmp_path / "hdassist")
    shutil.copytree(ROOT / "presets", tmp_path / "presets")
    changes = {
        "preset/fields.py": ("    order_amplitude: ", textwrap.indent(field, "    ") + "    order_amplitude: "),
        "preset/fields.toml": ("order_amplitude = ", declared + "order_amplitude = "),
        "acceptance/checks.py": (
            "CHECKS = (F_IOR, TURN_RANGE, SELF_ERROR, ORDER_CHECK, LOST_MOTION_CHECK, *STATED_CHECKS, *STIFFNESSES)\n",
            check,
        ),
    }
    for name, (old, new) in changes.items():
        file = tmp_path / "hdassist" / name
        text = file.read_text(encoding="utf-8")
        assert text.count(old) == 1
        file.write_text(text.replace(old, new), encoding="utf-8")

    def run(*args: str):
        return run_cold(*args, env={"PYTHONPATH": str(tmp_path)}, cwd=tmp_path)

    small = str(ROOT / "tests/data/small.yaml")
    done = run("accept", small, "--limit", "wind_up@1=200", "--limit", "wind_up@4=0.1", "--csv", "-")
    told = csv.DictReader(done.stdout.splitlines())
    assert [(row["code"], row["M_g_Nm"], row["verdict"]) for row in told] == [
        ("WIND_UP", "1.0", "PASS"), ("WIND_UP", "4.0", "FAIL"),
    ]  # fmt: skip
    assert done.returncode == 3
    assert "acceptance.wind_up" in run("explain", "WIND_UP").stdout
