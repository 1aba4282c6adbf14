"""A resolved preset says every value and where it is from; the JSON Schema accepts what presets accept."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from hdassist.drive.loading import load_text, preset_schema
from hdassist.drive.preset.fields import ResolvedField, field_table, resolved_fields
from hdassist.drive.preset.text import read_yaml
from hdassist.run.errors import UsageError
from hdassist.run.files import preset_names, read_preset
from tests.helpers.support import fresh_preset

SCHEMA = preset_schema()
VALIDATOR = Draft202012Validator(SCHEMA)
TEXT = fresh_preset("test")


def accepts(path: str, value: Any) -> bool:
    data = copy.deepcopy(read_yaml(TEXT, "f").data)
    section, _, name = path.partition(".")
    if name:
        data.setdefault(section, {})[name] = value
    else:
        data[section] = value
    return not list(VALIDATOR.iter_errors(data))


def test_it_is_a_schema_and_knows_every_field() -> None:
    Draft202012Validator.check_schema(SCHEMA)
    for path, field in field_table().items():
        section, name = path.split(".")
        table = SCHEMA["properties"][section]["anyOf"][0]
        assert table["properties"][name]["description"].startswith(field.meaning)


@pytest.mark.parametrize("name", preset_names())
def test_it_accepts_the_library(name: str) -> None:
    assert list(VALIDATOR.iter_errors(read_yaml(read_preset(name)[0], name).data)) == []


_GIVEN_RANGE = "{cam.W_0: {kind: given, range: [0.9, 1]}}"
# units, keys of limits, empty lists, and a range that would have no effect
LEFT_TO_VALIDATION = ("0.8 m", "3.1 mm", "[]", "{x: 30}", "260±10 um", "200±1", _GIVEN_RANGE)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("path", "written", "value", "good"),
    [
        ("gears.m", "800 um", "800 um", True),
        ("gears.m", "800 µm", "800 µm", True),
        ("gears.m", "0.8 m", "0.8 m", False),
        ("gears.m", "9", 9, False),
        ("gears.z_g", "200.0", 200.0, True),
        ("gears.z_g", "200.5", 200.5, False),
        ("gears.x_g", "3.1 mm", "3.1 mm", False),
        ("gears.q", "1", 1, False),
        ("operation.M_g", "80", 80, True),
        ("operation.M_g", "80 Nm", "80 Nm", True),
        ("operation.M_g", "[80, 0.8 kN·m]", [80, "0.8 kN·m"], True),
        ("operation.M_g", "[]", [], False),
        ("operation.M_g", "[2e7]", [2e7], False),
        ("operation.rated", "", None, True),
        ("cam.W_0", "", None, False),
        ("acceptance.F_ior", "30", 30, True),
        ("acceptance.F_ior", "0.5 arcmin", "0.5 arcmin", True),
        ("acceptance.F_ior", "{80: 30, all: 60}", {"80": 30, "all": 60}, True),
        ("acceptance.F_ior", "{x: 30}", {"x": 30}, False),
        ("acceptance.F_ior", "{80: 0}", {"80": 0}, False),
        ("catalogue.K_1", "9 N*m/arcmin", "9 N*m/arcmin", True),
        ("catalogue.K_1", "-3", -3, False),
        ("catalogue.accuracy", "1.5 arcmin", "1.5 arcmin", True),
        ("mounting.fixed", "flexspline", "flexspline", True),
        ("mounting.fixed", "none", "none", False),
        ("mounting.allowed", "all", "all", True),
        ("mounting.allowed", "3", 3, True),
        ("mounting.allowed", "[1, 2]", [1, 2], True),
        ("mounting.allowed", "some", "some", False),
        ("tolerances", "", None, True),
        ("cam", "", None, False),
        ("name", "58", 58, False),
        ("schema", "hdassist.preset/2", "hdassist.preset/2", False),
        ("colour", "red", "red", False),
        (
            "cost",
            "{tolerances.e_hb: {share: 2, k: 1.5, least: 10}}",
            {"tolerances.e_hb": {"share": 2, "k": 1.5, "least": 10}},
            True,
        ),
        ("cost", "{tolerances.e_hb: {share: 0}}", {"tolerances.e_hb": {"share": 0}}, False),
        ("cost", "{cam.W_0: {share: 1}}", {"cam.W_0": {"share": 1}}, False),
        ("source", "{cam.W_0: {kind: given}}", {"cam.W_0": {"kind": "given"}}, True),
        ("source", "{cam.W_1: {kind: given}}", {"cam.W_1": {"kind": "given"}}, False),
        ("source", "{cam.W_0: {kind: guessed}}", {"cam.W_0": {"kind": "guessed"}}, False),
        ("source", "{cam.W_0: {ref: x}}", {"cam.W_0": {"ref": "x"}}, False),
        (
            "source",
            "{cam.W_0: {kind: assumed, range: [0.9, 1]}}",
            {"cam.W_0": {"kind": "assumed", "range": [0.9, 1]}},
            True,
        ),
        ("source", _GIVEN_RANGE, {"cam.W_0": {"kind": "given", "range": [0.9, 1]}}, False),
        ("source", "{cam.W_0: {kind: assumed, range: 1}}", {"cam.W_0": {"kind": "assumed", "range": 1}}, False),
        ("source", "{cam.W_0: {kind: assumed, range: [1]}}", {"cam.W_0": {"kind": "assumed", "range": [1]}}, False),
        ("phases.xi_b", "260±10 deg", "260±10 deg", True),
        ("flexspline.k_t", "1.4 ± 0.1", "1.4 ± 0.1", True),
        ("phases.xi_b", "260±10 um", "260±10 um", False),
        ("gears.z_g", "200±1", "200±1", False),
        ("uncertainty", "{cam.W_0: 5 um}", {"cam.W_0": "5 um"}, True),
        ("uncertainty", "{cam.W_0: -1}", {"cam.W_0": -1}, False),
        ("uncertainty", "{mounting.fixed: 1}", {"mounting.fixed": 1}, False),
    ],
)
def test_schema_accepts_valid_values_and_refuses_others_except_for_units(
    path: str, written: str, value: Any, good: bool
) -> None:
    assert accepts(path, value) is (good or written in LEFT_TO_VALIDATION)
    try:
        load_text(TEXT, "f", [f"{path}={written}"])
        valid = True
    except UsageError:
        valid = False
    assert valid is good


SOURCES = """source:
  gears.z_g: {kind: given, ref: sheet 1}
  gears.m: {kind: assumed, ref: usual, range: [0.7, 900 um]}
  cam.W_0: {kind: identified, ref: measured}
  numerics.n_2: {kind: assumed, ref: enough}
"""


def rows(*overrides: str) -> dict[str, ResolvedField]:
    return {row.path: row for row in resolved_fields(load_text(TEXT.partition("source:")[0] + SOURCES, "f", overrides))}


def test_every_field_has_one_row_with_its_declaration() -> None:
    assert list(rows()) == list(field_table())
    row = rows()["cam.W_0"]
    assert (row.value, row.unit) == (0.96, "mm")
    assert row.meaning == "radial deflection of the flexspline at the major axis"
    assert all(row.meaning for row in rows().values())  # none has a type alone


def test_kinds_of_origin() -> None:
    found = rows("gears.m=0.79", "acceptance.F_ior.80=30", "material={nu: 0.29}")
    kinds = {path: (row.kind, row.ref) for path, row in found.items()}
    assert kinds["gears.z_g"] == ("given", "sheet 1")
    assert kinds["gears.z_b"] == ("given", "")
    assert kinds["cam.W_0"] == ("identified", "measured")
    assert kinds["gears.m"] == ("override", "--set")
    assert kinds["acceptance.F_ior"] == ("override", "--set")
    assert kinds["material.nu"] == ("override", "--set")
    assert kinds["numerics.n_2"] == ("default", "enough")
    assert kinds["numerics.n_max"] == ("default", "")
    assert found["gears.m"].range is None
    assert rows()["gears.m"].kind == "assumed"
    assert rows()["gears.m"].range == (0.7, 0.9)
