"""A resolved preset says every value and where it is from."""

from __future__ import annotations

from hdassist.loading.load import load_text
from hdassist.preset.fields import field_table
from hdassist.preset.schema import ResolvedField, resolved_fields
from tests.support import fresh_preset

TEXT = fresh_preset("test")


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
    assert row.meaning == "radial deformation of the flexspline at the major axis"
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
