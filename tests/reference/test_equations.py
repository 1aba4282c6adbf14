"""Equations of the theory keep the numbers by which the code cites them, and are drawn without a script."""

import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest
from docutils.nodes import SkipNode, math_block

ROOT = Path(__file__).parents[2]
THEORY = (ROOT / "docs/theory.md").read_text("utf-8")
NUMBERS = re.findall(r"\\tag\{(\w+)\}", THEORY)


def test_each_number_stands_once_and_in_order():
    assert " ".join(NUMBERS) == "1 2 2a 3 4 5 6 6a 6b 6c 7 8 8a 8b 8c 9 9a 9b 9c 9d 10 11 12 13 14 15 16"


@pytest.mark.parametrize("room", ["drive/model", "drive/solve", "drive/error", "features"])
def test_equations_that_the_code_cites_are_there(room):
    files = [*(ROOT / "hdassist" / room).glob("*.py"), *(ROOT / "hdassist" / room).glob("*.c")]
    cited = {n for file in files for n in re.findall(r"equations? \((\d+[a-d]?)\)", file.read_text("utf-8"))}
    assert cited <= set(NUMBERS)


def test_an_equation_is_drawn_with_its_number_and_no_script():
    conf = runpy.run_path(str(ROOT / "docs/conf.py"))
    drawn = SimpleNamespace(body=[])
    for equation in re.findall(r"\$\$(.*?)\$\$", THEORY, flags=re.DOTALL):
        with pytest.raises(SkipNode):
            conf["display_math"](drawn, math_block("", equation))
    page = "".join(drawn.body)
    assert page.count("<math") == page.count("</math>") == len(NUMBERS)
    assert re.findall(r">\((\w+)\)</span>", page) == NUMBERS
    assert "tag" not in page and "script" not in page
    assert conf["html_math_renderer"] == "mathml" and conf["extensions"] == ["myst_parser"]


def test_theory_drawings_exist_and_support_dark_screens():
    names = re.findall(r"\]\(figures/([\w-]+)\.svg\)", THEORY)
    assert sorted(names) == ["contact-sets", "drive", "mesh-zones", "ring-harmonics", "torus", "turning-support"]
    for name in names:
        drawing = (ROOT / f"docs/figures/{name}.svg").read_text("utf-8")
        assert "prefers-color-scheme: dark" in drawing and 'class="paper"' in drawing and "<title>" in drawing
