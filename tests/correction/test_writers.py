"""Files for controllers: what each controller makes of them leaves what the file says, and a wrong sign doubles it."""

import hashlib
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from hdassist.features.correction.forms import CorrectionTable, ExpectedResidual
from hdassist.features.correction.writers import CONTROLLER_FORMATS, ControllerAxis, controller_file, stored_table
from hdassist.run.errors import UsageError
from tests.correction import controllers
from tests.helpers.process import TINY, run

AXES = [(1, 0.0), (-1, 0.0), (1, 37.123), (-1, 201.7)]
POSITIONS = np.linspace(0, 360, 40_001)
STEPS = 25_000.0  # motor steps a degree of a mount's axis


def error_at(cam_turns, u, way=1):
    """Error of an output [arcsec] as a strain wave drive has it, more of it with the cam than of beats."""
    cam, out = 2 * np.pi * np.asarray(cam_turns), 2 * np.pi * np.asarray(cam_turns) / u
    beats = 2.1 * np.cos(cam + out + 0.4) + 1.2 * np.cos(2 * cam - out - 1) + 0.7 * np.cos(out)
    return way * (9 * np.cos(cam + 0.3) + 14 * np.cos(2 * cam + 1.1) + 1.5 * np.cos(4 * cam) + beats)


def table_of(turn, points, u, *, by_direction=False):
    """A table of this error: over the output turn at its points, over the cam's the mean of all its turns."""
    angles = np.arange(points) / points
    if turn == "output":
        turns = angles[None] * u
    else:
        period = 0.5 if turn == "half-cam" else 1.0
        turns = angles * period + np.arange(round(abs(u) / period))[:, None] * period
    values = [error_at(turns, u, way).mean(axis=0) for way in (1, -0.6)]
    both = {"other_direction_arcsec": values[1], "other_M_g": -80.0} if by_direction else {}
    return CorrectionTable(turn, values[0], u, 80.0, preset="drive", **both)


def of_axis(axis, u, way=1):
    """The error in the counting of an axis, at its readings [deg]."""
    return lambda reading: axis.sense * error_at(axis.sense * (np.asarray(reading) - axis.zero_deg) / 360 * u, u, way)


def promised(table, kind, axis, way=1):
    """Range [arcsec] that the stored table leaves of this error over a turn of the output."""
    turns = np.linspace(0, abs(table.u), 60_001)
    stored = stored_table(table, CONTROLLER_FORMATS[kind], axis)
    return np.ptp(error_at(turns, table.u, way) - stored.error_at(turns, other_direction=way != 1))


def text_of(table, kind, axis):
    return controller_file(table, CONTROLLER_FORMATS[kind], axis, "preset drive, sha256 5ha")[0]


LOOKUPS = {
    "linuxcnc-1": partial(controllers.linuxcnc, kind=1),
    "twincat-cnc": controllers.twincat_cnc,
    "twincat-nc": controllers.twincat_nc,
    "siemens-840d": controllers.siemens,
}
POINTS = {"linuxcnc-1": 254, "twincat-cnc": 1497, "twincat-nc": 1500, "siemens-840d": 1500}


@pytest.mark.thorough
@pytest.mark.parametrize("u", [10, -9])
@pytest.mark.parametrize(("sense", "zero_deg"), AXES)
@pytest.mark.parametrize("kind", LOOKUPS)
def test_a_file_of_positions_leaves_what_its_table_says(kind, sense, zero_deg, u):
    axis, table = ControllerAxis("A", sense, zero_deg), table_of("output", POINTS[kind], u)
    left = np.ptp(LOOKUPS[kind](text_of(table, kind, axis), error=of_axis(axis, u), positions=POSITIONS))
    assert left == pytest.approx(promised(table, kind, axis), rel=0.01)
    assert left < 0.12 * np.ptp(table.error_arcsec)
    flipped = text_of(replace(table, error_arcsec=-table.error_arcsec), kind, axis)
    worse = np.ptp(LOOKUPS[kind](flipped, error=of_axis(axis, u), positions=POSITIONS))
    assert worse == pytest.approx(2 * np.ptp(error_at(POSITIONS / 360 * u, u)), rel=0.06)


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("kind", ["linuxcnc-1", "twincat-cnc", "twincat-nc"])
def test_each_direction_has_the_column_of_its_own(kind, sense):
    axis = ControllerAxis("A", sense, 12.5)
    table = table_of("output", 254, 10, by_direction=True)
    for direction in (1, -1):
        way = 1 if direction == 1 else -0.6
        error = of_axis(axis, 10, way)
        left = LOOKUPS[kind](text_of(table, kind, axis), error=error, positions=POSITIONS, direction=direction)
        said = promised(table, kind, axis, way)
        assert np.ptp(left) == pytest.approx(said, rel=0.02)  # rows stand at the points of neither direction


def test_linuxcnc_rows_cover_the_range_of_joint_motion():
    axis, table = ControllerAxis("0", 1, 10.0, from_deg=-180.0), table_of("output", 254, 10)
    text = text_of(table, "linuxcnc-1", axis)
    left = controllers.linuxcnc(text, 1, of_axis(axis, 10), POSITIONS - 180)
    assert np.ptp(left) == pytest.approx(promised(table, "linuxcnc-1", axis), rel=0.01)
    outside = controllers.linuxcnc(text, 1, of_axis(axis, 10), POSITIONS + 180)
    assert np.ptp(outside) > 20  # no modulo: the end value holds


def test_linuxcnc_ramp_damps_a_correction_at_high_speed():
    axis, table = ControllerAxis("0"), table_of("output", 254, 20)
    text = text_of(table, "linuxcnc-1", axis)
    moved = partial(controllers.linuxcnc_ramped, text, 1, of_axis(axis, 20), velocity_limit=20, acceleration_limit=50)
    assert np.ptp(moved(4, seconds=25)) == pytest.approx(promised(table, "linuxcnc-1", axis), rel=0.15)
    assert np.ptp(moved(120, seconds=2.9)) > 10


@pytest.mark.thorough
@pytest.mark.parametrize("u", [100, -101])
@pytest.mark.parametrize(("sense", "zero_deg"), AXES)
@pytest.mark.parametrize("turn", ["cam", "half-cam"])
def test_moteus_holds_the_output_where_the_cams_encoder_is_compensated(turn, sense, zero_deg, u):
    axis, table = ControllerAxis("1", sense, zero_deg), table_of(turn, 256, u)
    turns = np.linspace(0, abs(u), 100_001)

    def output_error(reading):
        return sense * error_at(sense * (reading - zero_deg / 360), u)

    left = np.ptp(controllers.moteus(text_of(table, "moteus", axis), "1", output_error, u, turns))
    assert left == pytest.approx(promised(table, "moteus", axis), rel=0.01)
    flipped = text_of(replace(table, error_arcsec=-table.error_arcsec), "moteus", axis)
    worse = np.ptp(controllers.moteus(flipped, "1", output_error, u, turns))
    repeated = table.error_at(turns)
    assert worse == pytest.approx(np.ptp(error_at(turns, u) + repeated), rel=0.02)


def tracked(kind, table, axis, error_of):
    """Range [arcsec] that a mount leaves while it tracks over three turns of the worm, and what the table promises."""
    text, worm_deg = text_of(table, kind, axis), table.period_deg / abs(table.u)

    def error(reading):
        return axis.sense * error_of(axis.sense * (np.asarray(reading) - axis.zero_deg) / 360 * table.u)

    if kind == "eqmod":
        left = controllers.eqmod(text, error, STEPS)
    else:
        left = controllers.onstepx(text, error, STEPS, round(worm_deg * STEPS))
    read = np.linspace(0 if kind == "eqmod" else worm_deg, 3 * worm_deg, 40_001)
    turns = axis.sense * (read - axis.zero_deg) / 360 * table.u
    stored = stored_table(table, CONTROLLER_FORMATS[kind], axis)
    return np.ptp(left), np.ptp(error_of(turns) - stored.error_at(turns))


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["eqmod", "onstepx"])
@pytest.mark.parametrize(("u", "sense", "zero_deg"), [(-101, 1, 0.0), (101, 1, 1.3), (-101, -1, 2.2)])
def test_mount_table_leaves_its_predicted_residual_while_tracking(kind, u, sense, zero_deg):
    axis = ControllerAxis("RA", sense, zero_deg, steps_per_degree=STEPS)
    table = table_of("cam" if kind == "eqmod" else "half-cam", 256, u)
    left, said = tracked(kind, table, axis, partial(error_at, u=u))
    assert left == pytest.approx(said, abs=0.01 * np.ptp(table.error_arcsec))
    repeating, _ = tracked(kind, table, axis, table.error_at)
    assert repeating < 0.02 * np.ptp(table.error_arcsec)
    worse, _ = tracked(kind, replace(table, error_arcsec=-table.error_arcsec), axis, table.error_at)
    assert worse == pytest.approx(2 * np.ptp(table.error_arcsec), rel=0.02)


def test_row_omitted_by_eqmod_costs_little():
    axis, table = ControllerAxis("RA", steps_per_degree=STEPS), table_of("cam", 256, 100)
    left, said = tracked("eqmod", table, axis, table.error_at)
    assert said < left < 0.01 * np.ptp(table.error_arcsec)


@pytest.mark.parametrize(
    ("kind", "change", "words"),
    [
        ("linuxcnc-1", {"points": 255}, "number of points 255 for LinuxCNC, type 1: expected at most 254"),
        ("twincat-cnc", {"points": 1500}, "expected at most 1497"),
        ("siemens-840d", {"by_direction": True}, "cannot store a separate table for each direction"),
        ("moteus", {}, "--form output for moteus: expected --form cam or half-cam"),
        ("linuxcnc-1", {"turn": "cam"}, "expected --form output"),
        ("onstepx", {"turn": "cam"}, "864 sidereal seconds, but OnStepX stores tables of 61 to 720 s"),
    ],
)  # fmt: skip
def test_a_table_that_a_controller_cannot_keep_is_refused(kind, change, words):
    table = table_of(**{"turn": "output", "points": 100, "u": 100} | change)
    with pytest.raises(UsageError) as refused:
        stored_table(table, CONTROLLER_FORMATS[kind], ControllerAxis("A", steps_per_degree=STEPS))
    assert words in str(refused.value)


def test_mount_without_steps_or_with_too_few_is_refused():
    table = table_of("half-cam", 64, 100)
    with pytest.raises(UsageError, match="invalid number of steps per degree 0"):
        text_of(table, "onstepx", ControllerAxis("RA"))
    with pytest.raises(UsageError, match="but OnStepX allows 1"):
        text_of(
            replace(table, error_arcsec=40 * table.error_arcsec), "onstepx", ControllerAxis("RA", steps_per_degree=300)
        )


@pytest.mark.parametrize("kind", CONTROLLER_FORMATS)
def test_a_file_says_what_it_is_for(kind):
    turn = "output" if "output" in CONTROLLER_FORMATS[kind].turns else "half-cam"
    expected = (ExpectedResidual(80, 29.2, 1.1, 2.2, 3.3), ExpectedResidual(-80, 28, 5, 6, 7, "turn lost"))
    table = replace(table_of(turn, 100, 100), promised=expected)
    axis = ControllerAxis("A1", -1, 12.5, steps_per_degree=STEPS)
    text, about = controller_file(table, CONTROLLER_FORMATS[kind], axis, "preset d\nr\u0436, sha256 5ha")
    assert (text + about).isascii()
    for words in (
        "axis A1", "preset d\\nr\\u0436, sha256 5ha", "for 80 N*m",
        f"table of the form {turn}, 100 points",
        "the axis reads 12.5 deg when input and output are at zero",
        f"the axis reading increases as the {'wave generator' if kind == 'moteus' else 'output'} rotates clockwise",
        "subtract the error (actual minus ideal output angle)",
        "at 80 N*m: expected residual range 2.20 arcsec (1.10 to 3.30)",
        "at -80 N*m, turn lost: expected residual range 6.00 arcsec (5.00 to 7.00), without correction 28.00",
    ):  # fmt: skip
        assert words in about
    comment = CONTROLLER_FORMATS[kind].comment
    assert all(f"{comment} {line}" in text for line in about.splitlines() if comment)


def test_a_controllers_file_is_written_with_what_it_leaves(tmp_path):
    name = tmp_path / "joint.comp"
    options = ("--form", "output", "--points", "90", "--no-plot", "--axis", "3", "--zero", "12.5", "--clockwise")
    answer = run("compensate", TINY, *options, "--write", f"linuxcnc-1={name}")
    assert answer.returncode == 0
    assert f"wrote {name}" in answer.stderr
    text = name.read_text()
    sha256 = hashlib.sha256(Path(TINY).read_bytes()).hexdigest()
    assert f"# preset tiny, sha256 {sha256[:8]}" in text and "axis 3" in text and "reads 12.5 deg" in text
    assert (
        "# at 1 N*m: expected residual range 15.51 arcsec"
    ) in text and "expected residual range 15.51" in answer.stderr
    assert len([line for line in text.splitlines() if line[0] != "#"]) == 92


@pytest.mark.parametrize(
    ("write", "options", "words"),
    [
        ("galil=FILE", (), "expected CONTROLLER=FILE"),
        ("moteus", ("--form", "cam"), "expected CONTROLLER=FILE"),
        ("moteus=-", ("--form", "cam"), "expected CONTROLLER=FILE"),
        ("moteus=FILE", (), "invalid --form phasors for moteus"),
        ("linuxcnc-1=FILE", ("--form", "output", "--points", "255"), "expected at most 254"),
        ("moteus=FILE", ("--form", "cam", "--zero", "nan"), "expected a number up to"),
        ("siemens-840d=FILE", ("--form", "output", "--axis", "A]=0"), "expected letters and digits"),
    ],
)
def test_a_controllers_file_that_cannot_be_is_refused_at_once(tmp_path, write, options, words):
    name = tmp_path / "table"
    answer = run("compensate", TINY, *options, "--write", write.replace("FILE", str(name)))
    assert (answer.returncode, answer.stdout) == (2, "")
    assert words in answer.stderr
    assert not name.exists()
