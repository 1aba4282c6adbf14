"""Presets with overrides on top: what they replace, and whose fault a fault is."""

from __future__ import annotations

import pytest

from hdassist.run.errors import UsageError
from tests.loading.test_load import errors, load


def usage_error(*overrides: str) -> str:
    with pytest.raises(UsageError) as caught:
        load(overrides=overrides)
    assert caught.value.exit_code == 2
    return caught.value.message


def test_overrides_replace_and_are_remembered() -> None:
    drive = load(overrides=("cam.W_0=950 um", "operation.M_g=[80, 400]", "tolerances.F_i2=60", "acceptance.F_ior=30"))
    assert (drive.cam.W_0, drive.operation.M_g, drive.tolerances.F_i2) == (0.95, (80, 400), 60)
    assert drive.limit(80) == 30
    assert drive.origin.overrides[0] == "cam.W_0=950 um"
    assert drive.origin.sha256 == load().origin.sha256


def test_override_of_an_unreadable_yaml_value_is_still_checked() -> None:
    assert errors(("W_0: 0.96", "W_0: *a"), overrides=("cam.W_0={}",)) == [
        "my.yaml:6:12: cam.W_0: YAML aliases are not allowed (got *a; write the value out)",
        "--set:1:9: cam.W_0: must be a number (got a table of keys; write a number in mm)",
    ]


@pytest.mark.parametrize(
    ("overrides", "limits"),
    [
        (["acceptance.F_ior.80=30"], {"80": 30}),
        (["acceptance.F_ior=60", "acceptance.F_ior.80=30"], {"all": 60, "80": 30}),
        (["acceptance.F_ior={80: 30}", "acceptance.F_ior.80=20"], {"80": 20}),
    ],
)
def test_overrides_of_single_limits(overrides: list[str], limits: dict[str, float]) -> None:
    assert load(overrides=tuple(overrides)).acceptance.F_ior == limits


def test_overrides_reach_names_with_a_dot_in_them() -> None:
    drive = load(
        overrides=("phases.xi_b=1", "uncertainty.phases.xi_b=10", "source.cam.W_0={kind: given, ref: sheet 1}")
    )
    assert drive.uncertainty == {"phases.xi_b": 10}
    assert drive.source["cam.W_0"].ref == "sheet 1"


def test_assumed_range_uses_the_field_unit_and_restricts_no_override() -> None:
    more = "source: {cam.W_0: {kind: assumed, range: [900 um, 1]}}\n"
    assert load(more=more).source["cam.W_0"].range == (0.9, 1)
    assert load(more=more, overrides=("cam.W_0=0.89",)).cam.W_0 == 0.89


def test_the_last_override_wins() -> None:
    assert load(overrides=("cam.W_0=1", "cam.W_0=0.95")).cam.W_0 == 0.95


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["cam.w0=1"], "--set:1:1: cam.w0: unknown key (the nearest name is W_0)"),
        (["tolerances.F_l1=1"], "--set:1:1: tolerances.F_l1: unknown key (the nearest name is F_i1)"),  # as f_p1
        (["cam.W_0=0.95", "gears.z_g=x"], "--set:2:11: gears.z_g: must be a whole number (got x)"),
        (["phases.xi_b=unknwon"],
         "--set:1:13: phases.xi_b: must be a number (got unknwon; the nearest name is unknown)"),
        (["phases.xi_b=north"], "--set:1:13: phases.xi_b: must be a number (got north; write a number in deg)"),
        (["cam.W_0="], "--set:1:9: cam.W_0: needs a value (got nothing; write a number in mm)"),
        (["operation.M_g=[80"], "--set:1:18: not valid YAML: a bracket is not closed, or a comma is missing "
         "(opened in line 1, column 15)"),
        (["operation.M_g=[80, x]"], "--set:1:20: operation.M_g[1]: must be a number (got x; write a number in N*m)"),
        (["gears.z_g.x=3"], "--set:1:1: gears.z_g.x: gears.z_g is not a table of keys"),
        (["cam.W_0"], "--set:1:1: expected section.key=VALUE (got cam.W_0)"),
        (["=3"], "--set:1:1: expected section.key=VALUE (got =3)"),
        (["cam.=3"], "--set:1:1: expected section.key=VALUE (got cam.=3)"),
        ([""], "--set:1:1: expected section.key=VALUE (got nothing)"),
        (["cam.W_\udcb0=1"], r"--set:1:1: expected section.key=VALUE (got cam.W_\udcb0=1)"),  # a byte, not UTF-8
    ],
)  # fmt: skip
def test_bad_overrides_are_wrong_usage(overrides: list[str], message: str) -> None:
    assert usage_error(*overrides) == message


def test_override_that_contradicts_the_file_is_a_usage_error() -> None:
    assert usage_error("gears.z_b=203").startswith("--set:1:11: gears.z_b: only drives with two waves")
    assert usage_error("flexspline.b_w=200").startswith("--set:1:16: flexspline.b_w: the shell must be longer")


def test_invalid_file_is_a_data_error_despite_invalid_overrides() -> None:
    found = errors(("m: 0.8", "m: x"), overrides=("cam.W_0=y",))
    assert [line.split(": ")[0] for line in found] == ["my.yaml:3:32", "--set:1:9"]


def test_errors_only_in_overrides_are_usage_errors() -> None:
    with pytest.raises(UsageError, match=r"--set:2:9: gears\.m: must be a number") as caught:
        load(("W_0: 0.96", ""), overrides=("cam.W_0=0.96", "gears.m=x"))
    assert len(caught.value.message.splitlines()) == 1


def test_an_override_can_put_a_file_right() -> None:
    assert load(("W_0: 0.96", ""), overrides=("cam.W_0=0.96",)).cam.W_0 == 0.96
