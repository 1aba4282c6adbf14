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
    field, declared, check, value = (
        textwrap.dedent(block) for block in re.findall(r" +```(?:python|toml)\n(.*?) +```", page, re.S)
    )
    shutil.copytree(ROOT / "hdassist", tmp_path / "hdassist")
    shutil.copytree(ROOT / "presets", tmp_path / "presets")
    changes = {
        "preset/fields.py": ("    order_amplitude: ", textwrap.indent(field, "    ") + "    order_amplitude: "),
        "preset/fields.toml": ("order_amplitude = ", declared + "order_amplitude = "),
        "acceptance/checks.toml": ("[checks.ORDER]\n", check + "\n[checks.ORDER]\n"),
        "acceptance/decision.py": ('    "ORDER": lambda', textwrap.indent(value, "    ") + '    "ORDER": lambda'),
    }
    for name, (old, new) in changes.items():
        file = tmp_path / "hdassist" / name
        text = file.read_text(encoding="utf-8")
        assert text.count(old) == 1
        file.write_text(text.replace(old, new), encoding="utf-8")

    def run(*args: str):
        return run_cold(*args, env={"PYTHONPATH": str(tmp_path)}, cwd=tmp_path)

    small = str(ROOT / "tests/data/small.yaml")
    done = run("accept", small, "--limit", "error_rms@1=200", "--limit", "error_rms@4=0.1", "--csv", "-")
    told = csv.DictReader(done.stdout.splitlines())
    assert [(row["code"], row["M_g_Nm"], row["verdict"]) for row in told] == [
        ("ERROR_RMS", "1.0", "PASS"), ("ERROR_RMS", "4.0", "FAIL"),
    ]  # fmt: skip
    assert done.returncode == 3
    assert "acceptance.error_rms" in run("explain", "ERROR_RMS").stdout
