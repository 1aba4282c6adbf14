"""Presets of published sizes are what `hdassist presets new` makes, and their targets fit them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from benchmarks.catalogue import MM_A_SIZE, PAGE, ROOT, SIZES, files, presets
from hdassist import load_preset, stiffness
from hdassist.drive.loading import load_text
from hdassist.drive.preset.knowledge import CATALOGUE_K3, REFERENCE, TORQUE_DENSITY
from hdassist.features.calibration import read_targets
from hdassist.run.run import UNCHECKED
from tests.helpers.process import TINY


@pytest.mark.thorough
def test_every_file_is_what_the_command_makes() -> None:
    made = files()
    assert {path for path, text in made.items() if path.read_text(encoding="utf-8") != text} == set()
    names = {path.stem for path in made if path.parent.name == "presets"}
    assert len(names) == 12
    assert names == {file.stem for file in (ROOT / "presets").glob("*-*.yaml")} - {"synthetic-160-162"}


@pytest.mark.parametrize("size", SIZES, ids=lambda size: size.name)
def test_targets_start_from_the_preset(size: object) -> None:
    name = size.name  # type: ignore[attr-defined]
    drive = load_preset(name)
    found = read_targets((ROOT / f"docs/targets/{name}.targets.yaml").read_bytes(), name, drive)
    said = drive.catalogue
    known = [(target.value, target.asked["T_1"], target.asked["T_2"]) for target in found.targets]
    assert known == [(K, said.T_1, said.T_2) for K in (said.K_1, said.K_2, said.K_3)]
    assert (said.lost_motion, said.play) == (60, 5)


def test_documented_catalogue_example_equals_the_preset_of_its_size() -> None:
    (example,) = re.findall(
        r"```yaml\n(catalogue:.*?)```", (ROOT / "docs/design.md").read_text(encoding="utf-8"), re.DOTALL
    )
    drive = load_text(Path(TINY).read_text(encoding="utf-8") + example, "page")
    assert drive.catalogue == load_preset("size-25-100").catalogue


def test_catalogues_are_similar_to_themselves_as_the_rules_have_it() -> None:
    d = MM_A_SIZE * np.array([size.size for size in SIZES])
    K3 = np.array([size.K[2] for size in SIZES]) * 1e4 * (REFERENCE / d) ** 3 / CATALOGUE_K3
    assert np.all(np.abs(K3[2:] - 1) < 0.03)
    np.testing.assert_allclose(K3[:2], [0.72, 0.90], atol=0.01)
    density = np.array([size.rated for size in SIZES]) / d**3
    assert np.all((TORQUE_DENSITY[0] <= density) & (density * 1.3 <= TORQUE_DENSITY[1]))


def test_they_say_what_they_are() -> None:
    for name, _ in presets():
        drive = load_preset(name)
        assert "not been compared with measurements" in drive.description
        assert drive.source["operation.rated"].kind == "given"
        assert drive.source["gears.m"].kind == "assumed"


def test_the_page_shows_what_comes_out_for_each_size() -> None:
    """One row anew: K1 to K3 near the catalogue's; without clearance of the bearing K1 is half as much again."""
    rows = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| `size-")]
    assert [row.split("`")[1] for row in rows] == [size.name for size in SIZES]
    size, row = next((size, row) for size, row in zip(SIZES, rows, strict=True) if size.size == 25)
    drive = load_preset(size.name)
    tight = drive.with_values({"bearing.g_b": 0.0})
    K, stiffer = (
        [segment.stiffness / 1e4 for segment in stiffness(each, points=4, run=UNCHECKED).positive]
        for each in (drive, tight)
    )
    assert f"| {', '.join(f'{k:.3g}' for k in K)} |" in row
    np.testing.assert_allclose(K, size.K, rtol=0.11)
    assert 1.45 < stiffer[0] / size.K[0] < 1.55
