"""Proportions that no drive has are remarked upon, with the number and what is usual; those of drives are not."""

from __future__ import annotations

import pytest

from hdassist import load_preset
from hdassist.drive.preset.knowledge import implausible
from hdassist.run.files import preset_names
from tests.helpers.process import run


@pytest.mark.parametrize(
    ("overrides", "path", "said"),
    [
        (["flexspline.h_1=0.7", "flexspline.h_3=7"], "flexspline.h_3", "10 times the thickness of the rim"),
        (["flexspline.h_3=0.2"], "flexspline.h_3", "0.143 times the thickness of the rim"),
        (["flexspline.h_1=0.6", "flexspline.h_3=0.6"], "flexspline.h_1", "0.38% of it"),
        (["flexspline.h_1=4", "flexspline.h_3=4"], "flexspline.h_1", "2.50% of it"),
        (["cam.W_0=0.7"], "cam.W_0", "0.875 modules"),
        (["cam.W_0=1.05"], "cam.W_0", "1.31 modules"),
        (["bearing.d_ball=5"], "bearing.d_ball", "3.1% of it"),
        (["bearing.d_ball=30", "bearing.N=6"], "bearing.d_ball", "18.8% of it"),
        (["operation.M_g=2000"], "operation.M_g", "1.22 times the rated torque of drives of this size"),
        (["operation.rated=500"], "operation.M_g", "800 N*m is 1.6 times the rated torque"),
        (["operation.rated=3000"], "operation.rated", "1.83 times the rated torque of drives of this size"),
    ],
)
def test_what_no_drive_has_is_remarked_upon(overrides: list[str], path: str, said: str) -> None:
    warnings = load_preset("vzp160", overrides).origin.warnings
    (warning,) = (text for text in warnings if f" {path}: " in f" {text}")
    assert said in warning


@pytest.mark.parametrize(
    "overrides",
    [
        ["flexspline.h_1=1.4", "flexspline.h_3=2.1"],
        ["flexspline.h_1=0.64", "flexspline.h_3=0.64"],
        ["flexspline.h_1=3.2", "flexspline.h_3=3.2"],
        ["cam.W_0=0.8"],
        ["cam.W_0=1.016"],
        ["bearing.d_ball=10"],
        ["bearing.N=16"],
        ["operation.M_g=1630"],
        ["operation.M_g=[-800, 80]", "operation.rated=800"],
        ["operation.rated=1630"],
    ],
)
def test_what_drives_have_is_not(overrides: list[str]) -> None:
    assert load_preset("vzp160", overrides).origin.warnings == ()


@pytest.mark.parametrize("name", preset_names())
def test_nor_is_a_preset_of_the_library(name: str) -> None:
    assert load_preset(name).origin.warnings == ()


@pytest.mark.parametrize("path", ["catalogue.K_1", "catalogue.K_3", "measured.K_2"])
@pytest.mark.parametrize(("K", "is_plausible"), [(3.1, False), (3.1e4, True), (3.1e8, False)])
def test_a_stiffness_in_another_unit_is_implausible(path: str, K: float, is_plausible: bool) -> None:
    drive = load_preset("size-25-100", [f"{path}={K}"])
    assert (path not in {found for found, _, _ in implausible(drive)}) == is_plausible


def test_validate_does_not_call_a_stiffness_in_another_unit_ok() -> None:
    result = run("presets", "validate", "size-25-100", "--set", "catalogue.K_1=3.1")
    assert result.returncode == 0
    assert "OK" not in result.stdout
    assert "31000" in result.stderr  # N*m/rad: what a catalogue means that prints 3.1 in 1e4 N*m/rad
