"""Other values that agree with the same targets, as a preset keeps them."""

import jsonschema
import pytest

from hdassist import load_preset
from hdassist.errors import UsageError
from hdassist.preset.schema import preset_schema
from tests.process import SMALL


def test_they_are_read_with_units():
    two = "alternatives=[{gears.j_n: 2 um}, {supports.C_3: 3e4}]"
    assert load_preset(SMALL, [two]).alternatives == ({"gears.j_n": 2}, {"supports.C_3": 3e4})
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
        jsonschema.validate([{"gears.j_n": True}], schema)
