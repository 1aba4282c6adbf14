"""Presets side by side: the differences, what they do, and what is said where something is not known."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset, mounting_curve, stiffness
from hdassist.comparing.changes import ErrorChange, drive_changes, paired_draws
from hdassist.comparing.fields import field_differences, other_origins
from hdassist.comparing.presets import compare_drives
from hdassist.comparing.presets_command import is_preset
from hdassist.comparing.presets_page import drives_answer
from hdassist.model.unknown import unknowns
from hdassist.run.run import UNCHECKED
from hdassist.terminal.console import Style
from hdassist.terminal.output import Output
from tests.process import SMALL, run

M_G = 4.0
FAST = ("mounting.holes=4",)  # few holes: the less to compute
BETTER = ("tolerances.F_i2=25", "gears.j_n=8")


def small(*overrides: str):
    return load_preset(SMALL, [*FAST, *overrides, f"operation.M_g={M_G}"])


def F_ior(drive) -> float:
    return kinematic_error(drive, M_G, run=UNCHECKED).F_ior_arcsec


@pytest.fixture(scope="module")
def better():
    """The small drive beside one with a better rigid wheel and more clearance."""
    return compare_drives([small(), small(*BETTER)], [M_G])


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """A folder with two presets: the better one does not say where its cam's offset points."""
    folder = tmp_path_factory.mktemp("presets")
    text = Path(SMALL).read_text(encoding="utf-8")
    (folder / "a.yaml").write_text(text, encoding="utf-8")
    (folder / "b.YML").write_text(text.replace("F_i2: 40", "F_i2: 25").replace(" phi_hb: 0,", ""), encoding="utf-8")
    return folder


def test_what_differs_is_told_with_unit_and_origin():
    one, other = small(), small(*BETTER, "mounting.allowed=[0,3]", "catalogue.K_1=3e3", "uncertainty.phases.xi_b=10")
    found = {field.path: field for field in field_differences([one, other])}
    assert list(found) == [
        "gears.j_n",
        "tolerances.F_i2",
        "mounting.allowed",
        "catalogue.K_1",
        "uncertainty.phases.xi_b",
    ]
    assert [(row.value, row.unit, row.kind) for row in found["gears.j_n"].rows] == [
        (6, "um", "given"), (8, "um", "override"),
    ]  # fmt: skip
    assert [path for path, field in found.items() if field.moves] == ["gears.j_n", "tolerances.F_i2"]
    assert other_origins([one, small("cam.W_0=0.58")]) == ("cam.W_0",)


def test_the_numbers_are_those_of_the_drives_alone(better):
    here, there, F_i2, j_n = map(F_ior, (small(), small(*BETTER), small(BETTER[0]), small(BETTER[1])))
    [found] = better.changes
    assert better.sheets[1].check.points[0].error.F_ior_arcsec == there
    assert found.whole.change_arcsec == pytest.approx(there - here, abs=1e-6)
    assert [change.path for change in found.single] == ["tolerances.F_i2", "gears.j_n"]
    assert [float(c.change_arcsec[0, 0]) for c in found.single] == pytest.approx([F_i2 - here, j_n - here], abs=1e-6)
    assert (found.impossible, better.sense(1, 0)) == ((), -1)
    alone = stiffness(small(*BETTER), run=UNCHECKED)
    assert better.sheets[1].stiffness.positive == alone.positive
    holes = mounting_curve(small(), [M_G], [0.0, 90.0, 180.0, 270.0], run=UNCHECKED)
    assert drives_answer(better, seed=0).to_json()["presets"][0]["best"]["hole"] == holes.recommended.hole


def test_the_verdict_comes_first(better):
    line = drives_answer(better, seed=0).summary_line()
    values = [sheet.check.points[0].error.F_ior_arcsec for sheet in better.sheets]
    share = 100 * (1 - values[1] / values[0])
    assert line == (
        f"B against A: 4 N·m: F'_ior {values[0]:.2f} -> {values[1]:.2f} arcsec, {share:.0f} % less, most by "
        f"tolerances.F_i2 alone; best hole {better.sheets[0].advice.chosen.hole}; 2 fields differ"
    )


def test_a_direction_is_a_verdict_only_where_it_is_sure(better):
    [found] = better.changes

    def sense(*changed: float, open_: bool = False) -> int | None:
        whole = ErrorChange("", np.array(changed)[:, None], np.full((len(changed), 1), 20.0))
        sheets = better.sheets
        if open_:
            check = replace(sheets[1].check, unknown=unknowns(small("tolerances.e_hb=unknown")))
            sheets = (sheets[0], replace(sheets[1], check=check))
        return replace(better, sheets=sheets, changes=(replace(found, whole=whole),)).sense(1, 0)

    assert [sense(0.001), sense(-3.0), sense(3.0)] == [0, -1, 1]
    assert sense(*[-3.0] * 15, 1.0) is None
    assert sense(-3.0, open_=True) is None  # there is no range over it


def test_what_is_not_known_lies_alike_in_both():
    one, other = (
        small("tolerances.e_hb=unknown"),
        small("tolerances.e_hb=unknown", "phases.xi_b=unknown", "gears.m=0.51"),
    )
    first, second = paired_draws([one, other], 5)
    a, b = ({u.path: u for u in unknowns(drive)}["tolerances.e_hb"] for drive in (one, other))
    assert a.high < b.high
    assert [d.tolerances.e_hb / a.high for d in first] == pytest.approx([d.tolerances.e_hb / b.high for d in second])
    assert len({d.phases.xi_b for d in second}) == 5
    assert not any(map(unknowns, (*first, *second)))
    assert paired_draws([small()], 5) == [[small()]]


def test_fields_that_are_no_drive_alone_are_said_and_not_computed():
    one = small("tolerances.F_i2=0", "phases.xi_b=unknown")
    other = small("phases.xi_b=90", "gears.z_g=62", "gears.z_b=64", "cam.W_0=0.57")
    fields = [field for field in field_differences([one, other]) if field.moves]
    found = drive_changes(one, other, [M_G], fields)
    # teeth go in pairs; and the size of a deviation alone leaves its direction open
    assert set(found.impossible) >= {"gears.z_g", "gears.z_b", "tolerances.F_i2"}
    assert {change.path for change in found.single} == {"phases.xi_b", "cam.W_0"}
    assert [float(c.change_arcsec[0, 0]) for c in found.single if c.path == "phases.xi_b"] == [0]


def test_what_one_preset_does_not_know_makes_ranges_and_no_verdict(files):
    fast = [word for text in FAST for word in ("--set", text)]
    result = run("compare", "a.yaml", "b.YML", "--torque", "3", "--draws", "4", "--json", *fast, cwd=files)
    assert result.returncode == 0, result.stderr
    told = json.loads(result.stdout)
    assert [preset["rated_Nm"] for preset in told["presets"]] == [4, 4]
    assert (told["schema"], told["M_g_Nm"]) == ("hdassist.compare-presets/1", [3])
    assert [preset["file"] for preset in told["presets"]] == ["a.yaml", "b.YML"]
    known, open_ = told["presets"]
    assert known["operating_points"][0]["belief"]["p95_arcsec"] is None
    assert open_["operating_points"][0]["belief"]["p95_arcsec"] > 0
    assert (open_["order"], open_["best"], known["order"]) == ("none", None, "turn")
    [changed] = told["changes"]
    assert changed["pairs"] == 4
    assert changed["together"]["least_arcsec"] < changed["together"]["greatest_arcsec"]
    assert [field["field"] for field in told["differences"]] == ["tolerances.F_i2", "phases.phi_hb"]
    assert told["differences"][1]["values"][1] == {"value": None, "origin": "unknown", "reference": ""}


@pytest.mark.parametrize(
    ("name", "preset"),
    [("vzp160", True), ("./vzp160", False), ("a.yaml", True), ("b.YML", True), ("run.csv", False), ("-", False)],
)
def test_a_preset_is_a_name_of_the_library_or_a_yaml_file(name, preset):
    assert is_preset(name) is preset


@pytest.mark.parametrize(
    ("args", "code", "words"),
    [
        (["b.YML", "run.csv"], 2, "run.csv is taken for a trace, and b.YML for a preset"),
        (["b.YML", "--drift", "linear"], 2, "how a trace is read says nothing of presets"),
        (["size-14-100"], 2, "no torque that all presets have (small: 1, 4 N*m; "),
        (["b.YML", "--torque", "0"], 2, "--torque must be a torque in N*m, and not 0"),
        (["none.yaml"], 4, "no such file: none.yaml"),
        (["b.YML", "--set", "gears.j_n=-1"], 2, "gears.j_n: out of range"),
    ],
)
def test_what_cannot_be_meant_is_refused(files, args, code, words):
    result = run("compare", "a.yaml", *args, "-o", "page.txt", cwd=files)
    assert (result.returncode, result.stdout) == (code, "")
    assert words in result.stderr
    assert not (files / "page.txt").exists()


def test_three_presets_are_held_against_the_first(better):
    sheets = (*better.sheets, better.sheets[0])
    fields = field_differences([sheet.drive for sheet in sheets])
    three = replace(better, sheets=sheets, differences=fields, changes=better.changes * 2)
    answer = drives_answer(three, seed=0)
    first, second = answer.summary_line().splitlines()
    assert (first[:11], second[:11]) == ("B against A", "C against A")
    assert (first.rpartition("; ")[2], second.rpartition("; ")[2]) == ("2 fields differ", "no field differs")
    assert len(answer.to_json()["changes"]) == 2
    assert len(answer.figures()[1]) == 3


def test_the_page_is_short_and_has_the_rest_on_request(better):
    out = Output(Style(ascii=True, codes=False, width=80))
    short, long = (
        out.page(drives_answer(better, seed=0, details=details).page(out.style)) for details in (False, True)
    )
    assert short.startswith("B against A: ")
    assert max(map(len, short.splitlines())) <= 80
    plain = re.sub(r"\s+", " ", short)
    assert "differs gears.j_n, tolerances.F_i2 next hdassist report" in plain
    assert "-o report.html more --details proof" in plain
    for words in ("what differs", "origin of B", "certificate: "):
        assert words in long
        assert words not in short
