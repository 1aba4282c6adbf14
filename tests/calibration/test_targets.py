"""Targets of a calibration: what is read, and what is refused with its place."""

import numpy as np
import pytest

from hdassist import load_preset
from hdassist import trace as solved_trace
from hdassist.calibration.quantities import REPORTING, TargetQuantities
from hdassist.calibration.targets import SoughtField, read_targets
from hdassist.errors import PresetError
from hdassist.model.kinematics import Kinematics
from hdassist.run.run import UNCHECKED
from tests.process import SMALL
from tests.rigs import text as written

GOOD = """\
schema: hdassist.targets/1
name: rig 3
unknowns:
  gears.j_n: {low: 0, high: 15 um}
  contact.c_t: {low: 1e-5, high: 2e-4, scale: log}
targets:
  - {quantity: F_ior_max, M_g: 80, value: 31, tolerance: 7 %}
  - {quantity: self_error, M_g: 4, low: 0.25, high: 2.0}
  - {quantity: torsional_stiffness, from: 1, to: 4, low: 5e3}
  - {quantity: lost_motion, M_g: 0.2, value: 4 arcmin, tolerance: 6 arcsec}
"""


def read(text: str, file: str = "rig.yaml"):
    return read_targets(text.encode(), file, load_preset(SMALL))


def test_what_is_written_is_what_is_meant():
    targets = read(GOOD)
    assert targets.name == "rig 3"
    assert [(u.path, u.low, u.high, u.log) for u in targets.unknowns] == [
        ("gears.j_n", 0, 15, False),
        ("contact.c_t", 1e-5, 2e-4, True),
    ]
    first, second, third, fourth = targets.targets
    assert (first.value, first.tolerance) == (31, pytest.approx(2.17))
    assert (first.low, first.high) == (pytest.approx(28.83), pytest.approx(33.17))
    assert (second.value, second.low, second.high) == (None, 0.25, 2.0)
    assert (third.low, third.high) == (5e3, float("inf"))
    assert (fourth.value, fourth.tolerance) == (pytest.approx(240), pytest.approx(6))
    assert fourth.words == "lost_motion, M_g 0.2 N*m"


@pytest.mark.parametrize(
    ("old", "new", "place", "words"),
    [
        ("gears.j_n:", "gears.jn:", "4:3", "did you mean gears.j_n"),
        ("gears.j_n:", "gears.z_g:", "4:3", "names no measure"),
        ("low: 0,", "low: 8,", "4:14", "outside the bounds"),
        ("high: 15 um", "high: 500", "4:14", "beyond what a preset allows"),
        ("high: 15 um", "high: 15 kg", "4:29", "unit"),
        ("low: 1e-5,", "low: 0,", "5:16", "low must be above 0, below high"),
        ("scale: log", "scale: cubic", "5:47", "linear or log"),
        ("low: 1e-5, ", "", "5:3", "missing key"),
        ("F_ior_max", "F_ior_most", "7:16", "did you mean F_ior"),
        ("M_g: 80, ", "", "7:5", "asked with it"),
        ("M_g: 80", "M_g: 0", "7:32", "undetermined"),
        ("7 %", "-7 %", "7:58", "above 0"),
        (", tolerance: 7 %", "", "7:5", "missing key"),
        ("low: 0.25, high: 2.0", "low: 3, high: 2.0", "8:5", "low must be below high"),
        (", low: 5e3", "", "9:5", "needs either a value"),
        ("low: 5e3", "weight: 5", "9:", "unknown key"),
        ("7 %", "true %", "7:58", "a share like 5 %"),
        ("M_g: 80", "M_g: true", "7:32", "must be a number"),
        ("value: 31", "value: .inf", "7:43", "must be a finite number"),
        ("value: 31", "value: 31, low: 3", "7:5", "needs either a value"),
        ("low: 0.25, high: 2.0", "low: 0, high: 2, tolerance: 0", "8:64", "above 0"),
        ("schema: hdassist.targets/1", "schema: other", "1:9", "must be hdassist.targets/1"),
        ("name: rig 3", "name: rig 3\nname: rig 4", "3:1", "duplicate key"),
    ],
)
def test_every_fault_has_its_place(old, new, place, words):
    assert old in GOOD
    with pytest.raises(PresetError) as error:
        read(GOOD.replace(old, new, 1))
    assert error.value.exit_code == 4
    assert [f for f in error.value.findings if str(f).startswith(f"rig.yaml:{place}") and words in str(f)], error.value


def test_a_field_starts_from_its_default_and_takes_its_bounds_from_the_source():
    def unknowns(line: str, *sets: str):
        text = GOOD.replace("  gears.j_n: {low: 0, high: 15 um}\n", f"  {line}\n")
        return read_targets(text.encode(), "rig.yaml", load_preset(SMALL, sets)).unknowns[0]

    ranged = "source.gears.j_n={kind: assumed, range: [2, 12]}"
    assert unknowns("contact.k_face: {low: 5, high: 20}").start == load_preset(SMALL).contact.k_face
    assert unknowns("gears.j_n:", ranged) == SoughtField("gears.j_n", 2, 12, False, 6)
    assert unknowns("gears.j_n: {scale: log}", ranged).log
    assert unknowns("gears.j_n: {high: 8}", ranged) == SoughtField("gears.j_n", 2, 8, False, 6)
    # a field that has neither value nor default starts in the middle
    assert unknowns("bearing.d_ball: {low: 2, high: 4}").start == 3
    assert unknowns("bearing.d_ball: {low: 2, high: 8, scale: log}").start == pytest.approx(4)
    with pytest.raises(PresetError, match=r"missing key, and no range at source\.gears\.j_n of the preset"):
        unknowns("gears.j_n: {low: 0}")


@pytest.mark.parametrize("text", ["", "- 1", "schema: hdassist.targets/1", "schema: [", GOOD.split("targets:\n")[0]])
def test_incomplete_texts(text):
    with pytest.raises(PresetError):
        read(text)


def test_all_faults_at_once():
    with pytest.raises(PresetError) as error:
        read(GOOD.replace("gears.j_n", "gears.jn").replace("7 %", "no").replace("self_error", "self"))
    assert len(error.value.findings) == 3


def test_a_trace_is_read_beside_the_targets(tmp_path):
    rows = "phi_h_deg,error_arcsec\n" + "".join(f"{3 * k},{k % 5}\n" for k in range(40))
    (tmp_path / "trace.csv").write_text(rows)
    line = "  - {quantity: trace, M_g: 4, file: trace.csv, tolerance: 0.5}\n"
    target = read(GOOD + line, str(tmp_path / "rig.yaml")).targets[-1]
    assert target.trace[0][:2] == (0, 3)
    assert target.trace[1][:6] == (0, 1, 2, 3, 4, 0)
    for spoiled, words in (
        (rows.replace("6,2", "6,two"), r"trace\.csv:4:3: error_arcsec: must be a number"),
        (rows.replace("60,0", "6,0"), r"trace\.csv:22:1: phi_h_deg: the angle runs backwards"),
        ("\n".join(rows.split("\n")[:10]), "9 rows"),
        ("x\n", "no rows of numbers"),
    ):
        (tmp_path / "trace.csv").write_text(spoiled)
        with pytest.raises(PresetError, match=words):
            read(GOOD + line, str(tmp_path / "rig.yaml"))
    with pytest.raises(PresetError, match="cannot be read"):
        read(GOOD + line.replace("trace.csv", "none.csv"), str(tmp_path / "rig.yaml"))


@pytest.mark.parametrize("more", ["value: 0", "low: 3", "high: 3"])
def test_a_trace_has_no_value_of_its_own(tmp_path, more):
    line = f"  - {{quantity: trace, M_g: 4, file: none.csv, tolerance: 0.5, {more}}}\n"
    with pytest.raises(PresetError, match="unknown key"):
        read(GOOD + line, str(tmp_path / "rig.yaml"))


def test_what_was_said_of_a_key_is_not_said_of_its_target_again(tmp_path):
    line = "  - {quantity: trace, M_g: 4, file: none.csv, tolerance: 0.5}\n"
    with pytest.raises(PresetError, match=r"targets\[4\]\.file: cannot be read") as error:
        read(GOOD + line, str(tmp_path / "rig.yaml"))
    assert len(error.value.findings) == 1
    with pytest.raises(PresetError, match="anchors are not allowed") as error:
        read(GOOD.replace("value: 31", "value: !!int 31").replace("low: 0,", "low: &a 0,"))
    assert len(error.value.findings) == 2


def test_a_trace_is_read_as_measure_reads_it(tmp_path):
    """Any rig's columns, units, separators and encoding, wrapped angles, both directions; two encoders give F_kpp."""
    line = "  - {quantity: trace, M_g: 4, file: trace.csv, tolerance: 0.5}\n"
    angle, error = np.arange(0, 720, 9.0), 5 * np.cos(np.arange(80) / 7)

    def found(data: str, encoding: str = "utf-8"):
        (tmp_path / "trace.csv").write_bytes(data.encode(encoding))
        return [np.array(part) for part in read(GOOD + line, str(tmp_path / "rig.yaml")).targets[-1].trace]

    u = Kinematics.of(load_preset(SMALL)).u
    plain = written([angle, error], "phi_h_deg,error_arcsec")
    for got in (
        found(plain),
        found(written([angle, error / 60], "# Winkel [°]; Fehler [arcmin]", ";", 9).replace(".", ","), "utf-16"),
        found(written([np.mod(angle, 360), error], "cam;err", ";"), "utf-8-sig"),
        found(written([angle, (angle / u - error / 3600)], "motor_deg,output_deg", digits=9)),
        found(written([angle, -angle / u + error / 3600], "motor_deg,output_deg", digits=9)),
    ):
        assert got[0] == pytest.approx(angle, abs=1e-4)
        assert got[1] - got[1].mean() == pytest.approx(error - error.mean(), abs=1e-2)
    there = found(written([np.r_[angle, angle[::-1]], np.r_[error, error[::-1]]], "cam,err"))
    assert there[0] == pytest.approx(np.repeat(angle, 2))
    assert there[1] == pytest.approx(np.repeat(error, 2), abs=1e-4)


@pytest.mark.parametrize("fixed", ["rigid", "flexspline"])
def test_a_trace_over_the_angle_of_the_output_is_its_own_drive(tmp_path, fixed):
    """The cam turns against the output where the rigid wheel is fixed, and the output stands at phi_g0 at first."""
    drive = load_preset(SMALL, [f"mounting.fixed={fixed}", "tolerances.F_i2=60"])
    u, start = Kinematics.of(drive).u, 20.0
    error = solved_trace(drive, 4.0, start_deg=start, revolutions=3, run=UNCHECKED).error
    output = start + np.degrees(error.states.phi_h) / u
    (tmp_path / "trace.csv").write_text(written([output, error.error_arcsec], "output_deg,error_arcsec", digits=9))
    line = "  - {quantity: trace, M_g: 4, file: trace.csv, phi_g0: 20, tolerance: 0.5}\n"
    target = read_targets((GOOD + line).encode(), str(tmp_path / "rig.yaml"), drive).targets[-1]
    off = TargetQuantities(drive, REPORTING).predict(target)
    assert np.abs(off).max() < 1e-3
