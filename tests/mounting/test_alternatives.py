"""Other values that agree with the same targets, as a preset keeps them."""

import jsonschema
import numpy as np
import pytest

from hdassist import load_preset
from hdassist.errors import UsageError
from hdassist.mounting.advice import Advice
from hdassist.mounting.curve import Alternative, alternatives, mounting_curve
from hdassist.mounting.page import warnings
from hdassist.preset.schema import preset_schema
from tests.process import SMALL

TWO = "alternatives=[{gears.j_n: 2 um}, {supports.C_3: 3e4}]"


def test_they_are_read_with_units():
    assert load_preset(SMALL, [TWO]).alternatives == ({"gears.j_n": 2}, {"supports.C_3": 3e4})
    assert load_preset(SMALL, ["alternatives="]).alternatives == ()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("[{gears.jn: 2}]", "did you mean gears.j_n"),
        ("[{gears.j_n: -2}]", "out of range"),
        ("[{gears.j_n: x}]", "must be a number"),
        ("[3]", "table of keys"),
        ("{gears.j_n: 2}", "list of tables"),
    ],
)
def test_faults(given, words):
    with pytest.raises(UsageError, match=words):
        load_preset(SMALL, [f"alternatives={given}"])


def test_the_schema_knows_them():
    schema = preset_schema()["properties"]["alternatives"]
    jsonschema.validate([{"gears.j_n": "2 um"}, {"supports.C_3": 3e4}], schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate([{"gears.jn": 2}], schema)


def test_each_has_its_best_hole():
    drive = load_preset(SMALL, [TWO, "mounting.holes=6"])
    found = alternatives(drive, [4.0])
    for values, other in zip(drive.alternatives, found, strict=True):
        assert other.values == values
        alone = mounting_curve(
            drive.with_values(values), [4.0], np.arange(6) * 60.0, every_state=True, cross_check=None
        ).recommended
        assert other.recommended.rotation_deg == alone.rotation_deg
        assert other.recommended.F_ior_arcsec == pytest.approx(alone.F_ior_arcsec, rel=0.02)


def test_an_override_holds_in_them_too():
    drive = load_preset(SMALL, [TWO, "gears.j_n=9", "mounting.holes=2"])
    assert [other.values for other in alternatives(drive, [4.0])] == [{}, {"supports.C_3": 3e4}]


def test_mount_says_when_they_disagree_by_more_than_a_hole():
    drive = load_preset(SMALL, [TWO, "mounting.holes=2"])
    curve = mounting_curve(drive, [4.0], [0.0, 180.0], cross_check=None)
    found = alternatives(drive, [4.0])
    elsewhere = (Alternative({}, curve.worst), found[1])
    assert not warnings(Advice(drive, curve, None, tuple(found), (), ()))
    # opposite is one hole of two, and three of six
    assert not warnings(Advice(drive, curve, None, elsewhere, (), ()))
    six = load_preset(SMALL, [TWO, "mounting.holes=6"])
    (said,) = warnings(Advice(six, curve, None, elsewhere, (), ()))
    assert "alternatives" in said
    assert f"{curve.worst.phase_deg:g}" in said
