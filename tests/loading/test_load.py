"""Loading presets: every promise about errors, units, lists and warnings."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest

from hdassist.belief.prior import EVIDENCE
from hdassist.drive.loading import load_text
from hdassist.drive.preset.fields import Drive, field_table
from hdassist.run.errors import PresetError, UsageError

BASE = """\
schema: hdassist.preset/1
name: test
gears: {z_g: 200, z_b: 202, m: 0.8, x_g: 3.1, x_b: 3.3, j_n: 7}
flexspline: {h_1: 1.4, h_3: 1.4, b_w: 32, l: 160}
bearing: {N: 24, ring_b: 24, ring_h: 4.0}
cam: {W_0: 0.96}
supports: {C_1: 1.3e6, C_2: 2.3e4, C_3: 8.4e3}
operation: {M_g: [80, 800]}
"""

NO_W_0 = "my.yaml:6:1: cam.W_0: missing key (radial deflection of the flexspline at the major axis, in mm)"
EMPTY = "my.yaml:1:1: the preset is empty (create one with hdassist presets new NAME)"


def load(*changes: tuple[str, str], more: str = "", overrides: tuple[str, ...] = ()) -> Drive:
    text = BASE
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    return load_text(text + more, "my.yaml", overrides)


def errors(*changes: tuple[str, str], more: str = "", overrides: tuple[str, ...] = ()) -> list[str]:
    with pytest.raises(PresetError) as caught:
        load(*changes, more=more, overrides=overrides)
    assert caught.value.exit_code == 4
    assert caught.value.message == "\n".join(map(str, caught.value.findings))
    return [str(finding) for finding in caught.value.findings]


def test_a_preset_with_the_required_fields_only_is_complete() -> None:
    drive = load()
    assert drive.gears.alpha == 20
    assert drive.operation.M_g == (80, 800)
    assert drive.mounting.fixed == "rigid"


def test_origin_carries_file_and_the_hash_of_the_bytes() -> None:
    data = b"\xef\xbb\xbf" + BASE.replace("\n", "\r\n").encode()
    origin = load_text(data, "dir/my.yaml").origin
    assert origin.file == "dir/my.yaml"
    assert origin.sha256 == hashlib.sha256(data).hexdigest()
    assert origin.overrides == origin.warnings == ()
    assert load_text(BASE, "f").origin.sha256 == hashlib.sha256(BASE.encode()).hexdigest()


@pytest.mark.parametrize(
    ("old", "new", "section", "name", "value"),
    [
        ("m: 0.8", "m: 800 um", "gears", "m", 0.8),
        ("j_n: 7", "j_n: 0.007 mm", "gears", "j_n", 7),
        ("j_n: 7", "alpha: 0.35 rad", "gears", "alpha", pytest.approx(20.0535228)),
        ("C_1: 1.3e6", "C_1: 1.3 kN/um", "supports", "C_1", 1.3e6),
        ("[80, 800]", "[80 Nm, 0.8 kN·m]", "operation", "M_g", (80, 800)),
        ("[80, 800]", "80", "operation", "M_g", (80,)),
        ("[80, 800]", "80 N*m", "operation", "M_g", (80,)),
        ("[80, 800]", "-80", "operation", "M_g", (-80,)),
        ("z_g: 200", "z_g: 2e2", "gears", "z_g", 200),
        ("W_0: 0.96", "W_0: 960e-3", "cam", "W_0", 0.96),
    ],
)
def test_units_and_single_items(old: str, new: str, section: str, name: str, value: object) -> None:
    assert getattr(getattr(load((old, new)), section), name) == value


def test_the_model_takes_values_and_no_texts() -> None:
    drive = Drive.model_validate(load(more="uncertainty: {phases.xi_b: 30 arcmin}\nphases: {xi_b: 1}\n").model_dump())
    assert Drive.model_validate(drive.model_dump()) == drive
    with pytest.raises(ValueError, match=r"operation\.M_g"):
        Drive.model_validate(drive.model_dump() | {"operation": {"M_g": "0.8 kN*m"}})


def test_limits_are_read_per_torque_for_all_and_with_units() -> None:
    drive = load(more="acceptance: {F_ior: {80: 0.5 arcmin, 800.0: 12, all: 60}}\n")
    assert [drive.limit(torque) for torque in (80, 800, 5)] == [30, 12, 60]
    assert load(more="acceptance: {F_ior: 30}\n").limit(80) == 30
    assert load().limit(80) is None


def test_uncertainty_is_in_the_unit_of_the_field_it_names() -> None:
    assert load(more="phases: {xi_b: 1}\nuncertainty: {phases.xi_b: 30 arcmin, cam.W_0: 5 um}\n").uncertainty == {
        "phases.xi_b": 0.5,
        "cam.W_0": 0.005,
    }


def test_an_empty_section_is_one_without_keys() -> None:
    assert load(more="numerics:\nsource:\n").numerics.n_max == 40


def test_optional_fields_may_be_empty() -> None:
    assert load(("M_g: [80, 800]", "M_g: [80, 800], rated: ")).operation.rated is None


@pytest.mark.parametrize(
    ("changes", "more", "expected"),
    [
        # keys
        ([("W_0", "w0")], "", [
            NO_W_0,
            "my.yaml:6:7: cam.w0: unknown key (the nearest name is W_0)",
        ]),
        ([("W_0: 0.96", "W_0: 0.96, h_1: 2")], "",
         ["my.yaml:6:18: cam.h_1: unknown key (h_1 belongs to flexspline)"]),
        ([("cam: {W_0: 0.96}\n", "")], "", ["my.yaml:1:1: cam: missing section (it needs W_0)"]),
        ([("cam: {W_0: 0.96}", "cam:")], "", ["my.yaml:6:5: cam: missing section (it needs W_0)"]),
        ([("name: test\n", "")], "", ["my.yaml:1:1: name: missing key (name of the drive)"]),
        ([("name: test", "nmae: test")], "", [
            "my.yaml:1:1: name: missing key (name of the drive)",
            "my.yaml:2:1: nmae: unknown key (the nearest name is name)",
        ]),
        ([("m: 0.8", "m: 0.8, m: 0.9")], "",
         ["my.yaml:3:37: gears.m: duplicate key (it is given first in line 3, column 29)"]),
        ([("m: 0.8", "m:0.8")], "", [
            "my.yaml:3:1: gears.m: missing key (module, in mm)",
            "my.yaml:3:29: gears.m:0.8: unknown key (a space is missing after the colon)",
        ]),
        ([("j_n: 7", "j_n: 7,5")], "",
         ["my.yaml:3:64: gears.5: unknown key (write a decimal point, not a comma)"]),
        ([("schema: hdassist.preset/1\n", "")], "",
         ["my.yaml:1:1: schema: missing key (write schema: hdassist.preset/1)"]),
        ([("preset/1", "preset/2")], "",
         ["my.yaml:1:9: schema: must be hdassist.preset/1 (got hdassist.preset/2)"]),
        # types
        ([("m: 0.8", "m: 12:30")], "", ["my.yaml:3:32: gears.m: must be a number (got 12:30; write a number in mm)"]),
        ([("m: 0.8", "m: no")], "", ["my.yaml:3:32: gears.m: must be a number (got no; write a number in mm)"]),
        ([("m: 0.8", "m: true")], "", ["my.yaml:3:32: gears.m: must be a number (got true; write a number in mm)"]),
        ([("m: 0.8", "m: [0.8]")], "", ["my.yaml:3:32: gears.m: must be a number (got a list; write a number in mm)"]),
        ([("m: 0.8", 'm: "0.8"')], "",
         ['my.yaml:3:32: gears.m: must be a number, not text (got "0.8"; leave out the quotes)']),
        ([("m: 0.8", "m: 1_000")], "",
         ["my.yaml:3:32: gears.m: must be a number (got 1_000; write the number without underscores)"]),
        ([("j_n: 7", "j_n: ")], "", ["my.yaml:3:61: gears.j_n: needs a value "
         "(got nothing; leave out the key to use its default, 0.0)"]),
        ([("z_g: 200", "z_g: 200.5")], "", ["my.yaml:3:14: gears.z_g: must be a whole number (got 200.5)"]),
        ([("z_g: 200", "z_g: 200 teeth")], "",
         ["my.yaml:3:14: gears.z_g: must be a whole number without a unit (got 200 teeth)"]),
        ([("name: test", "name: 58")], "", ["my.yaml:2:7: name: must be text (got 58; put it in quotes)"]),
        ([("name: test", 'name: ""')], "", ['my.yaml:2:7: name: must be one line of 1 to 200 characters (got "")']),
        ([("cam: {W_0: 0.96}", "cam: 0.96")], "", ["my.yaml:6:6: cam: must be a table of keys "
         "(got 0.96; its keys: W_0, coupling, shaft_d, overhang)"]),
        ([("[80, 800]", "2e7")], "",
         ["my.yaml:8:18: operation.M_g: must be from -1e7 to 1e7 N*m (got 2e7)"]),
        ([("[80, 800]", "all")], "", ["my.yaml:8:18: operation.M_g: must be a number "
         "(got all; write a number in N*m)"]),
        ([("m: 0.8", "m: 0.8 ± 1e999")], "",
         ["my.yaml:3:32: gears.m: must be a finite number (got 0.8 ± 1e999)"]),
        ([("[80, 800]", "{a: 1}")], "",
         ["my.yaml:8:18: operation.M_g: must be a list of numbers (got a table of keys)"]),
        ([("[80, 800]", "[80, [1]]")], "",
         ["my.yaml:8:23: operation.M_g[1]: must be a number (got a list; write a number in N*m)"]),
        ([], "mounting: {fixed: rigit}\n",
         ["my.yaml:9:19: mounting.fixed: must be one of rigid, flexspline (got rigit; the nearest name is rigid)"]),
        ([], "mounting: {allowed: some}\n", ["my.yaml:9:21: mounting.allowed: "
         "must be all, or a list of hole numbers (got some)"]),
        ([], "mounting: {allowed: [1, x]}\n",
         ["my.yaml:9:25: mounting.allowed[1]: must be a whole number (got x)"]),
        # ranges, nan, inf
        ([("m: 0.8", "m: 9 cm")], "",
         ["my.yaml:3:32: gears.m: must be from 0.05 to 5 mm (got 9 cm; that is 90 mm)"]),
        ([("z_g: 200", "z_g: 2")], "", ["my.yaml:3:14: gears.z_g: must be from 20 to 1000 (got 2)"]),
        ([("m: 0.8", "m: nan")], "", ["my.yaml:3:32: gears.m: must be a finite number (got nan)"]),
        ([("m: 0.8", "m: .inf")], "", ["my.yaml:3:32: gears.m: must be a finite number (got .inf)"]),
        ([("m: 0.8", "m: 1e999")], "", ["my.yaml:3:32: gears.m: must be a finite number (got 1e999)"]),
        ([("[80, 800]", "[80, 2e7]")], "",
         ["my.yaml:8:23: operation.M_g[1]: must be from -1e7 to 1e7 N*m (got 2e7)"]),
        # units
        ([("W_0: 0.96", "W_0: 1.2 m")], "", ["my.yaml:6:12: cam.W_0: the unit m is ambiguous "
         "(got 1.2 m; write mm or um; m may mean metre or module)"]),
        ([("j_n: 7", "j_n: 7 deg")], "", ["my.yaml:3:62: gears.j_n: deg is a unit of an angle; expected a unit of "
         "a length (got 7 deg; use one of mm, um, nm, cm, inch, in; a number without a unit is in um)"]),
        ([("x_g: 3.1", "x_g: 3.1 mm")], "",
         ["my.yaml:3:42: gears.x_g: must be a number without a unit (got 3.1 mm)"]),
        # tables by name
        ([], "cost: {cam.W_0: {share: 1}}\n",
         ["my.yaml:9:8: cost.cam.W_0: is not the size of a deviation (got cam.W_0; for example tolerances.F_i1)"]),
        ([], "cost: {tolerances.e_hb: {share: -1, price: 2}}\n", [
            "my.yaml:9:33: cost.tolerances.e_hb.share: must be above 0, up to 1e9 (got -1)",
            "my.yaml:9:37: cost.tolerances.e_hb.price: unknown key (known: share, k, least)"]),
        ([], "source: {gears.zg: {kind: given}}\n",
         ["my.yaml:9:10: source.gears.zg: is not a field (got gears.zg; the nearest name is gears.z_g)"]),
        ([], "source: {cam.W_0: {kind: gven}}\n", ["my.yaml:9:26: source.cam.W_0.kind: must be one of "
         "given, assumed, identified (got gven; the nearest name is given)"]),
        ([], "source: {cam.W_0: {ref: 3}}\n", [
            "my.yaml:9:10: source.cam.W_0.kind: missing key (how the value was obtained: given, identified or assumed)",
            "my.yaml:9:25: source.cam.W_0.ref: must be text (got 3; put it in quotes)",
        ]),
        ([("m: 0.8", "m: x")], "source: {cam.W_0: {kind: assumed, range: [1, 2]}}\n", [
            "my.yaml:3:32: gears.m: must be a number (got x; write a number in mm)",
            "my.yaml:9:42: source.cam.W_0.range: the value 0.96 lies outside its range "
            "(got 1 to 2; correct one of them)",
        ]),
        ([("m: 0.8", "m: x")], "uncertainty: {phases.xi_g: 3}\n", [
            "my.yaml:3:32: gears.m: must be a number (got x; write a number in mm)",
            "my.yaml:9:28: uncertainty.phases.xi_g: an uncertainty is given without a value "
            "(got 3; give the value of phases.xi_g too)",
        ]),
        ([("m: 0.8", "m: 9, m: x")], "", [
            "my.yaml:3:35: gears.m: duplicate key (it is given first in line 3, column 29)",
            "my.yaml:3:38: gears.m: must be a number (got x; write a number in mm)",
        ]),
        ([], "source: {cam.W_0: given}\n", ["my.yaml:9:19: source.cam.W_0: must be a table of keys "
         "(got given; its keys: kind, ref, range)"]),
        ([], "source: {cam.W_0: {kind: given, sheet: '6'}}\n",
         ["my.yaml:9:33: source.cam.W_0.sheet: unknown key (known: kind, ref, range)"]),
        ([], "source: {cam.W_0: {kind: assumed, range: [1, 1.1 mm]}}\n", ["my.yaml:9:42: source.cam.W_0.range: "
         "the value 0.96 lies outside its range (got 1 to 1.1; correct one of them)"]),
        ([], "source: {cam.W_0: {kind: given, range: [1, 0.9]}}\n",
         ["my.yaml:9:40: source.cam.W_0.range: the smaller number must be first (got a list)"]),
        ([], "source: {cam.W_0: {kind: given, range: 1}}\n", ["my.yaml:9:40: source.cam.W_0.range: "
         "must be two numbers, the smaller one first (got 1; write them in brackets, as in [0, 20])"]),
        ([], "source: {cam.W_0: {kind: given, range: [0.9, 1 N]}}\n", ["my.yaml:9:40: source.cam.W_0.range: "
         "unknown unit N (got a list; the nearest name is nm)"]),
        ([], "source: {cam.W_0: {kind: given, range: [0.9, .inf]}}\n",
         ["my.yaml:9:40: source.cam.W_0.range: must be a finite number (got a list)"]),
        ([], "source: {cam.W_0: {kind: given, range: [0.9, 11]}}\n", ["my.yaml:9:40: source.cam.W_0.range: "
         "both ends must be from 0.01 to 10 mm (got a list)"]),
        ([], "source: {gears.z_g: {kind: given, range: [190, 210]}}\n",
         ["my.yaml:9:42: source.gears.z_g.range: only a field with a single number can have a range (got a list)"]),
        ([("j_n: 7", "wall")], "",
         ["my.yaml:3:57: gears.wall: unknown key (known: z_g, z_b, m, alpha, x_g, x_b, h_a, h_f, j_n)"]),
        ([], "uncertainty: {xi_b: 3}\n",
         ["my.yaml:9:15: uncertainty.xi_b: is not a field with a single number "
         "(got xi_b; the nearest name is phases.xi_b)"]),
        ([], "uncertainty: {gears.z_g: 1}\n", ["my.yaml:9:15: uncertainty.gears.z_g: "
         "is not a field with a single number (got gears.z_g; for example gears.m)"]),
        ([], "uncertainty: {gears.m: -1 um}\n", ["my.yaml:9:24: uncertainty.gears.m: must be "
         "0 mm or more (got -1 um; that is -0.001 mm)"]),
        ([], "fit: {gears.m: 0.8}\n", ["my.yaml:9:16: fit.gears.m: "
         "must be two or more numbers, beginning with the preset's own value "
         "(got 0.8; write them in brackets, as in [8950, 9020])"]),
        ([], "fit: {gears.m: [0.8, 9]}\n",
         ["my.yaml:9:16: fit.gears.m: each value must be from 0.05 to 5 mm, not 9 (got a list)"]),
        ([], "fit: {gears.m: [0.8, .nan]}\n", ["my.yaml:9:16: fit.gears.m: must be a finite number (got a list)"]),
        ([], "fit: {gears.m: [0.8, {}]}\n", ["my.yaml:9:16: fit.gears.m: must be a number "
         "(got a list; write a number in mm)"]),
        ([], "fit: {gears.z_g: [200, 201]}\n",
         ["my.yaml:9:7: fit.gears.z_g: is not a field with a single number (got gears.z_g; for example gears.m)"]),
        ([], "fit: {gears.m: [0.8, 0.81], cam.W_0: [0.96, 0.95, 0.97]}\n", ["my.yaml:9:38: fit.cam.W_0: "
         "has 3 values, but gears.m has 2 (got a list; give each field the same number of values; "
         "values in the same place belong to one drive)"]),
        ([], "acceptance: {F_ior: {foo: 3}}\n",
         ["my.yaml:9:22: acceptance.F_ior.foo: must be a torque in N*m, or all (got foo)"]),
        ([], "acceptance: {F_ior: {80: 3, 80.0: 4}}\n",
         ["my.yaml:9:29: acceptance.F_ior.80.0: the key is given twice (got 80.0; keep one of the two entries)"]),
        ([], "acceptance: {F_ior: {x: 30, all: 20}}\n",
         ["my.yaml:9:22: acceptance.F_ior.x: must be a torque in N*m, or all (got x)"]),
        ([], "measured: {K_2: 0}\n",
         ["my.yaml:9:17: measured.K_2: must be from 0.001 to 1e12 N*m/rad (got 0)"]),
        ([], "measured: {F_ior: 28}\n", ["my.yaml:9:19: measured.F_ior: must be a table of keys "
         "(got 28; for example {h0@80: 28.1 ± 1})"]),
        ([], "measured: {F_ior: {h4@80: 28}}\n", ["my.yaml:9:27: measured.F_ior.h4@80: "
         "must be a number with its uncertainty (got 28; use, for example, 260 ± 10)"]),
        ([], "measured: {F_ior: {h4@80: 28 ± 0}}\n", ["my.yaml:9:27: measured.F_ior.h4@80: "
         "the value and its uncertainty must both be above 0, up to 1e6 arcsec (got 28 ± 0)"]),
        *([([], f"measured: {{F_ior: {{{key}: 28 ± 1}}}}\n", [f"my.yaml:9:20: measured.F_ior.{key}: "
         f"must be a hole or an angle in deg, at a torque in N*m (got {key}; for example h4@80 or 120@80)"])
          for key in ("h4", "x@80", "h4@0", "h-1@80", "h4@80 Nm")]),
        ([], "measured: {F_ior: {h4@90000: 28 ± 1}}\n", ["my.yaml:9:30: measured.F_ior.h4@90000: "
         "the torque of this value exceeds 100 times the largest torque of the drive, 800 N*m "
         "(got h4@90000; check that the torque is in N*m)"]),
        ([], "measured: {F_ior: {h12@80.5: 28 ± 1}}\n",
         ["my.yaml:9:30: measured.F_ior.h12@80.5: the seat's holes are h0 to h11 (got h12@80.5)"]),
        ([], "measured: {F_ior: {4@80: 28 ± 1}}\n", ["my.yaml:9:26: measured.F_ior.4@80: 4 deg is not a hole of the "
         "seat; its holes are 30 deg apart (got 4@80; write h4 for hole 4)"]),
        ([], "mounting: {holes: 0}\nmeasured: {F_ior: {h4@80: 28 ± 1}}\n", ["my.yaml:10:27: measured.F_ior.h4@80: "
         "the seat has no holes (got h4@80; state an angle in deg, or set the number of holes in mounting.holes)"]),
        ([], "acceptance: {F_ior: 0}\n",
         ["my.yaml:9:21: acceptance.F_ior: must be above 0, up to 1e6 arcsec (got 0)"]),
    ],
)  # fmt: skip
def test_each_thing_that_is_wrong_has_its_message(
    changes: list[tuple[str, str]], more: str, expected: list[str]
) -> None:
    assert errors(*changes, more=more) == expected


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", EMPTY),
        ("# nothing\n~\n", EMPTY),
        ("- a\n", "my.yaml:1:1: a preset must be a table of keys "
         "(got a list; create one with hdassist presets new NAME)"),
        (b"\xff\xfe", "my.yaml:1:1: not UTF-8 text (got byte 0xff; save the file as UTF-8)"),
        (BASE + "phases: [", "my.yaml:9:10: not valid YAML: a value is missing, or a bracket is not closed "
         "(opened in line 9, column 10)"),
    ],
)  # fmt: skip
def test_what_is_no_preset_at_all(text: str | bytes, message: str) -> None:
    with pytest.raises(PresetError) as caught:
        load_text(text, "my.yaml")
    assert caught.value.message == message


def test_all_errors_are_reported_at_once_in_file_sequence() -> None:
    found = errors(
        ("z_b: 202", "z_b: 198"), ("m: 0.8", "m: &a 0.8"), ("l: 160", "l: 20"), ("N: 24", "N: 24, N: 25"),
        ("C_3: 8.4e3", "C_3: .nan, C4: 1"), ("[80, 800]", "[80, 0, x]"), more="colour: red\n",
    )  # fmt: skip
    assert [line.split(": ")[1] for line in found] == [
        "gears.z_b", "gears.m", "flexspline.l", "bearing.N", "supports.C_3", "supports.C4",
        "operation.M_g[2]",
        "colour",
    ]  # fmt: skip


def test_very_many_findings_are_cut_short() -> None:
    found = errors(more="".join(f"key{i}: 1\n" for i in range(1000)))
    assert len(found) == 101
    assert found[-1].endswith("and 900 more")


@pytest.mark.thorough
def test_wrong_field_values_are_refused_without_validator_jargon() -> None:
    wrong = ("text", "[]", "[a]", "{a: 1}", "null", "true", "1e999", "-1e300", "1e300", '"1"', "[[1]]")
    taken = set()
    for path in field_table():
        for value in wrong:
            try:
                load(overrides=(f"{path}={value}",))
            except UsageError as error:
                assert path in error.message
                for word in (
                    "Input",
                    "valid ",
                    "instance",
                    "Literal",
                    "tuple",
                    "dict",
                    "None",
                    "float",
                    "type",
                ):
                    assert word not in error.message, error.message
            else:
                taken.add((path, value))
    may_be_empty = ("bearing.d_ball", "cam.shaft_d", "cam.overhang", "supports.C_3",
                    "operation.rated",
                    *(path for path, field in field_table().items()
                      if path.startswith(("acceptance.", *EVIDENCE)) and field.is_optional),
                    *(path for path, field in field_table().items() if field.unknown))  # fmt: skip
    assert taken == {(path, "null") for path in may_be_empty}


def test_a_limit_for_another_torque_is_a_warning() -> None:
    drive = load(more="acceptance: {F_ior: {80: 30, 900: 20, all: 60}}\n")
    assert drive.origin.warnings == (
        "my.yaml:9:30: acceptance.F_ior.900: the torque of this limit is not in operation.M_g; accept uses the limit, "
        "but check does not (M_g: 80, 800)",
    )


def test_torques_of_one_run_do_not_affect_the_file_limits() -> None:
    limits = "acceptance: {F_ior: {80: 30, 800: 20}}\n"
    assert load(more=limits, overrides=("operation.M_g=80",)).origin.warnings == ()
    (said,) = load(more=limits, overrides=("operation.M_g=80", "acceptance.F_ior.70=9")).origin.warnings
    assert "acceptance.F_ior.70: the torque of this limit is not in operation.M_g; accept" in said


def test_the_frozen_reference_holds_the_numbers_of_the_paper() -> None:
    file = Path(__file__).parents[1] / "validation/vzp160_reference.yaml"
    drive = load_text(file.read_bytes(), file.name)
    assert (drive.gears.z_g, drive.gears.z_b, drive.gears.m, drive.cam.W_0) == (200, 202, 0.8, 0.96)
    assert (drive.supports.C_1, drive.supports.C_2, drive.supports.C_3) == (1.3e6, 2.3e4, 8.4e3)
    assert (drive.phases.xi_g, drive.phases.xi_b, drive.operation.M_g) == (0, 260, (80, 800))
    assert drive.origin.warnings == ()


def test_a_deviation_that_is_not_given_is_not_known() -> None:
    for more in ("", "tolerances:\n", "tolerances: {F_i1: unknown}\n", "tolerances: {F_i1: }\n"):
        drive = load(more=more)
        assert drive.tolerances.F_i1 is None
        assert drive.number("tolerances.F_i1") == 0
    assert load(more="tolerances: {F_i1: 0}\n").tolerances.F_i1 == 0
    assert load(overrides=("phases.xi_b=unknown",)).phases.xi_b is None
    with pytest.raises(UsageError, match=r"cam\.W_0: must be a number"):
        load(overrides=("cam.W_0=unknown",))


def test_an_uncertainty_needs_a_value() -> None:
    with pytest.raises(
        PresetError, match=r"my\.yaml:9:\d+: uncertainty\.phases\.xi_b: an uncertainty is given without a value"
    ):
        load(more="uncertainty: {phases.xi_b: 10}\n")
