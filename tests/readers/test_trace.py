"""Files of encoder rigs: what their columns mean, wraps, directions, and every fault with its line."""

from __future__ import annotations

import gzip
import hashlib
import io
from typing import Any

import numpy as np
import pytest

from hdassist.readers.trace import MeasuredTrace, TraceForm, read_trace, sweeps
from hdassist.readers.words import role_in, unit_in
from hdassist.run.errors import DataError, PresetError, UsageError
from tests.helpers.rigs import text

TURNS = np.arange(400) / 100
CAM = 360 * TURNS
ERROR = 5 * np.cos(4 * np.pi * TURNS) + 0.1 * np.sin(1e3 * TURNS)
PLAIN = text([CAM, ERROR], "cam_deg,error_arcsec")


def read(data: str | bytes, ratio: float | None = None, **form: Any) -> MeasuredTrace:
    with pytest.MonkeyPatch.context() as patch:
        stream = io.BytesIO(data.encode() if isinstance(data, str) else data)
        patch.setattr("sys.stdin", io.TextIOWrapper(stream))
        return read_trace("-", TraceForm(**form), ratio)


def fault(data: str | bytes, ratio: float | None = None, **form: Any) -> str:
    with pytest.raises(DataError) as caught:
        read(data, ratio, **form)
    return str(caught.value).removeprefix("<stdin>:")


@pytest.mark.parametrize(
    "data",
    [
        PLAIN,
        "# rig 7, 20 °C\n" + PLAIN,
        PLAIN.replace("\n", "\r\n"),
        "\ufeff" + PLAIN,
        text([CAM, ERROR], "cam_deg;error_arcsec", ";").replace(".", ","),
        text([CAM, ERROR], "cam_deg\terror_arcsec", "\t"),
        text([CAM, ERROR], "#cam_deg error_arcsec", " "),
        text([CAM / 57.29577951308232, ERROR / 3.6], "cam [rad],error [mdeg]", digits=9),
        text([CAM * 60, ERROR / 60], "Winkel/arcmin,Fehler/arcmin", digits=8),
        text([np.arange(400.0), CAM, CAM / 100, ERROR], "time_s,motor (deg),output_deg,TE_arcsec"),
        PLAIN.encode("utf-16"),
        PLAIN.replace("\n100", "\n# a remark\n\n100"),
        PLAIN + "# end\n",
        text([np.mod(CAM, 360), ERROR], "cam_deg,error_arcsec"),
        text([np.mod(CAM + 180, 360) - 180, ERROR], "cam_deg,error_arcsec"),
        text([CAM, ERROR], "cam_deg;error_arcsec;", ";").replace("\n", ";\n").replace(";;", ";"),
    ],
)
def test_dialects_and_units(data):
    trace = read(data)
    assert trace.cam_deg == pytest.approx(CAM, abs=1e-4)
    assert trace.error_arcsec == pytest.approx(ERROR, abs=1e-4)
    assert [(s.start, s.stop, s.direction) for s in trace.sweeps] == [(0, 400, 1)]
    raw = data if isinstance(data, bytes) else data.encode()
    assert trace.sha256 == hashlib.sha256(raw).hexdigest()


def test_columns_by_option():
    data = text([CAM, ERROR, ERROR + 1], "a,b,c")
    assert read(data, angle="a", error="C", angle_unit="deg").error_arcsec == pytest.approx(ERROR + 1, abs=1e-4)
    assert read(data, angle="1", error="2", error_unit="arcmin").error_arcsec == pytest.approx(60 * ERROR, abs=1e-3)
    assert "no unit stated, deg assumed" in " ".join(read(data, angle="1", error="2").notes)
    assert "no column x" in fault(data, angle="x", error="2")
    assert "no column of input or output angles by its name" in fault(data)
    assert "2 columns of errors" in fault(text([CAM, ERROR, ERROR], "cam,err_1,err_2"))
    assert "2 columns of input or output angles" in fault(text([CAM, CAM, ERROR], "enc1,enc2,err"))
    with pytest.raises(UsageError, match="column a is selected both as the angle and as the error"):
        read(data, angle="a", error="a")
    with pytest.raises(UsageError, match="--error cannot be combined with --second"):
        read(data, angle="a", error="b", second="c")
    with pytest.raises(UsageError, match="invalid --error-unit mm: expected a unit of angle"):
        read(data, angle="a", error="b", error_unit="mm")


def test_no_names():
    trace = read(PLAIN.split("\n", 1)[1])
    assert "without names, the columns are read as input angle and error" in trace.notes
    assert trace.line[0] == 1


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("wrapped", [False, True])
def test_two_encoders(sense, wrapped):
    output = sense * CAM / 100 + ERROR / 3600 + 10
    columns = [np.mod(CAM, 360) if wrapped else CAM, np.mod(output - 12, 360) if wrapped else output]
    trace = read(text(columns, "enc_in_deg,enc_out_deg", digits=9), ratio=100, angle="1", second="2")
    assert trace.error_arcsec - trace.error_arcsec.mean() == pytest.approx(ERROR - ERROR.mean(), abs=1e-4)
    assert any(f"ratio {100 * sense:+g}" in note for note in trace.notes)
    assert "input rotates 100 times as far as the output, but the ratio is 80" in fault(
        text(columns, "cam_deg,out_deg", digits=9), ratio=80
    )
    assert "the ratio is needed" in fault(text(columns, "cam_deg,out_deg"))


def counted(angle: np.ndarray, per_turn: int, holds: int | None = None) -> np.ndarray:
    """Readings of an encoder in counts, of a counter that begins again after so many."""
    return np.mod(np.round(angle / 360 * per_turn), holds or per_turn)


@pytest.mark.parametrize("unit", ["16384,4194304", "16384,-4194304", "14bit,22bits", "-16384,22bit"])
@pytest.mark.parametrize("holds", [None, 65536])
def test_encoders_in_counts_begin_again_at_their_own_modulus(unit, holds):
    error = 20 * np.cos(4 * np.pi * TURNS)
    output = CAM / 100 + error / 3600 + 359
    signs = [-1.0 if part.startswith("-") else 1.0 for part in unit.split(",")]
    data = text(
        [counted(signs[0] * CAM + 40, 16384, holds), counted(signs[1] * output, 4194304)], "enc1,enc2_cts", digits=0
    )
    trace = read(data, ratio=100, angle="enc1", second="enc2_cts", angle_unit=unit)
    assert trace.cam_deg - trace.cam_deg[0] == pytest.approx(CAM, abs=0.03)
    assert trace.sense == 1
    assert np.abs(trace.error_arcsec - error + error[0]).max() < 1.5  # a count of the cam is 0.8 arcsec
    assert len(trace.sweeps) == 1
    assert any("a turn" in note for note in trace.notes)


@pytest.mark.parametrize(("jitter_deg", "in_time"), [(0.0, True), (0.5, False)])
def test_what_counts_round_off_is_a_step_of_the_reading(jitter_deg, in_time):
    cam = CAM + jitter_deg * np.random.default_rng(1).uniform(-1, 1, len(CAM))
    data = text([counted(cam, 16384), counted(cam / 100 + 359, 4194304)], "enc1,enc2_cts", digits=0)
    trace = read(data, ratio=100, angle="enc1", second="enc2_cts", angle_unit="14bit,22bit")
    assert trace.step_arcsec == pytest.approx(np.hypot(1296000 / 16384 / 100, 1296000 / 4194304))
    assert trace.in_time is in_time


@pytest.mark.parametrize("other", ["Load torque [Nm]", "output_temp_C", "cam_speed_rpm", "motor current"])
def test_columns_of_other_quantities_are_no_angles(other):
    plain = text([CAM, ERROR], "cam_deg,error_arcsec")
    trace = read(text([CAM, ERROR, CAM * 0 + 7], f"cam_deg,error_arcsec,{other}"))
    assert trace.error_arcsec.tolist() == read(plain).error_arcsec.tolist()
    both = text(
        [CAM, CAM / 100 + ERROR / 3600, CAM * 0 + 7], f"Motor position [deg],Load position [deg],{other}", digits=9
    )
    assert read(both, ratio=100).sense == 1


def test_counts_of_an_unknown_encoder_are_asked_for():
    data = text([counted(CAM, 16384), counted(CAM / 100, 4194304)], "cam_counts,output_counts", digits=0)
    assert '"cam_counts": the counts per revolution are unknown' in fault(data, ratio=100)
    assert '"output_counts": the counts per revolution are unknown' in fault(data, ratio=100, angle_unit="16384")
    bare = text([counted(CAM, 16384), CAM / 100], "cam,output", digits=5)
    assert '"output": the counts per revolution are unknown' in fault(bare, ratio=100, angle_unit="16384")
    assert read(bare, ratio=100, angle_unit="16384,deg").sense == 1
    assert read(text([CAM, -CAM / 100], "cam,output"), ratio=100, angle_unit="-deg").sense == 1
    columns, coarse = text([CAM, -CAM / 100, CAM / 100], "cam,output,turned", digits=2), []
    for second, unit in (("output", "-deg"), ("turned", "deg")):
        found = read(columns, ratio=100, angle="cam", second=second, angle_unit=f"deg,{unit}")
        coarse.append(found.step_arcsec)
        assert not any("a turn" in note for note in found.notes)
    assert coarse[0] == coarse[1]
    for wrong in ("0", "3bit,7", "-", "99bit", "1,2,3", "nan", "16384,", "mm"):
        with pytest.raises(UsageError, match="invalid --angle-unit"):
            read(data, ratio=100, angle_unit=wrong)


def test_output_angle_resolves_the_input_motion_in_a_gap():
    """Rows lost over half a turn of the cam and more: the output has turned by that over the ratio."""
    cam = np.arange(1600) * 3.6
    error = 5 * np.cos(np.radians(2 * cam))
    kept = np.random.default_rng(1).random(len(cam)) > 0.25
    kept[100:190] = False  # nine tenths of a turn
    sparse = np.arange(len(cam)) % 60 == 0  # steps of 0.6 of a turn
    for rows in (kept, sparse):
        for sense in (1, -1):
            columns = [np.mod(cam, 360)[rows], np.mod(sense * cam / 100 + error / 3600 + 359, 360)[rows]]
            trace = read(text(columns, "cam_deg,out_deg", digits=7), ratio=100)
            assert trace.cam_deg - trace.cam_deg[0] == pytest.approx(cam[rows] - cam[rows][0], abs=1e-4)
            assert trace.sense == sense


def test_angle_of_the_output():
    trace = read(text([CAM / 100, ERROR], "output_deg,error_arcsec", digits=9), ratio=100)
    assert trace.cam_deg == pytest.approx(CAM, abs=1e-5)
    wide = text([CAM / 100 * 3600, ERROR], "angle_arcsec,error_arcsec")
    assert read(wide, ratio=100, angle_of="output").cam_deg == pytest.approx(CAM, abs=1e-5)


def test_directions_repeats_and_jitter():
    there = np.concatenate([CAM, CAM[::-1], CAM])
    assert [s.direction for s in sweeps(there)] == [1, -1, 1]
    assert [(s.start, s.stop) for s in sweeps(np.concatenate([CAM, CAM]))] == [(0, 400), (401, 800)]
    rng = np.random.default_rng(0)
    shaky = np.linspace(0, 720, 20000) + rng.uniform(-0.1, 0.1, 20000)
    assert [s.direction for s in sweeps(shaky)] == [1]
    approach = np.concatenate([[3.0, 1.0], CAM])
    assert [s.direction for s in sweeps(approach)] == [1]


BACK = CAM.copy()
BACK[200] = 100.0
LEAP = np.mod(np.arange(40) * 170.0, 360)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "1:1: the file is empty"),
        (gzip.compress(PLAIN.encode())[:-20], "1:1: the gzip file is damaged or incomplete"),
        ("cam,err\n1,2\n", "2:1: cam: the recording has too few rows: 1"),
        ("cam,err\n", "no rows of numbers"),
        (text([CAM], "cam_deg"), "1 column, but 2 are needed: angle, error"),
        (text([CAM, 0 * CAM + 3], "cam,err"), "2:1: err: the column is constant"),
        (text([0 * CAM + 3, ERROR], "cam,err"), "2:1: cam: the column is constant"),
        (text([BACK, ERROR], "cam,err"), "202:1: cam: the angle jumps back: 100 deg follows 716.4 deg"),
        (text([CAM[np.random.default_rng(0).permutation(400)], ERROR], "cam,err"), "the angle jumps back"),
        (PLAIN.replace("\n36.0", "\nnan,1\n36.0", 1), "12:1: cam_deg: must be a finite number"),
        (
            text([LEAP, LEAP], "cam,err"),
            "3:1: cam: the direction of a step of 170 is ambiguous, because the angle restarts after 360",
        ),
        (text([CAM, CAM], "cam_deg,err_deg"), "the error spans 1.44e+03 deg"),
    ],
)
def test_faults_have_their_line(data, words):
    assert words in fault(data)


def test_unsorted_rows_are_refused_even_with_robust_reading():
    angle = 9.0 * np.arange(400)
    angle[[200, 201]] = angle[[201, 200]]
    words = fault(text([angle, ERROR], "cam,err"), robust=True)
    assert words.startswith("203:1: cam: the angle jumps back")
    assert "sort the rows by time (--robust does not sort)" in words


def test_faulty_rows_are_left_out_and_named_when_asked():
    rows = PLAIN.splitlines()
    rows[10], rows[20], rows[30:33] = "nan,1", "72.0,", ["gap", "1,2,3", "108;0"]
    rows[60] = rows[60].replace(",", "1e4,")  # a glitch of the cam's encoder
    data = "\n".join(rows)
    assert "11:1: cam_deg: must be a finite number" in fault(data)
    trace = read(data, robust=True)
    assert "left out, because they contain no valid readings: lines 11, 21, 31, 32, 33" in trace.notes
    assert 'left out, "cam_deg" jumps and returns: lines 61' in trace.notes
    kept = np.setdiff1d(np.arange(400), [9, 19, 29, 30, 31, 59])
    assert trace.line.tolist() == (kept + 2).tolist()
    assert trace.error_arcsec == pytest.approx(ERROR[kept], abs=1e-4)
    there = text([np.r_[CAM, CAM[::-1], CAM], np.r_[ERROR, ERROR, ERROR]], "cam_deg,error_arcsec")
    assert len(read(there, robust=True).line) == 1200  # a shaft that turns back does not leap


@pytest.mark.parametrize("second", [False, True])
def test_distant_error_reading_is_omitted_only_by_robust_reading(second):
    error = np.round(np.concatenate([ERROR, ERROR]), 1)
    error[100] = 9999.0
    cam = np.concatenate([CAM, CAM[-1] + CAM[1] - CAM[0] + CAM])
    head, columns = ("cam_deg,output_deg", [cam, cam / 10 + error / 3600]) if second else ("cam_deg,err", [cam, error])
    data, ratio = text(columns, head), {"ratio": 10.0} if second else {}
    assert "the error spans 2.78 deg" in (words := fault(data, **ratio))
    assert "--robust leaves out single outliers" in words
    trace = read(data, robust=True, **ratio)
    assert trace.line.tolist() == np.delete(np.arange(2, 802), 100).tolist()
    assert any("jumps and returns: lines 102" in note for note in trace.notes)
    rows = data.splitlines()
    without = read("\n".join([*rows[:101], *rows[102:]]), **ratio)
    assert trace.step_arcsec == pytest.approx(without.step_arcsec)  # the spike has no part in the resolution
    assert trace.error_arcsec == pytest.approx(without.error_arcsec, abs=1e-6)


def test_many_readings_far_off_are_no_single_ones():
    error = ERROR.copy()
    error[:40] = 9999.0
    assert "42:1: err: the error spans 2.78 deg, because it shifts by -2.78" in fault(
        text([CAM, error], "cam_deg,err"), robust=True
    )


OTHERS = {
    "a record of an oscilloscope": "Model,X\nRecord Length,400\nVertical Units,V,V\nLabel,,\nTIME,CH1,CH2\n"
    + "0,1.5,2\n" * 400,
    "a record of a laser at targets": "HEADER::\nMachine: a\nTARGET DATA::\nTargets :\n" + "1 2 0.5\n" * 50,
    "a record of a controller's signals": "0 1.5 0.25 TRUE\n" * 9000,
    "a log of events": "2024-01-01 12:00:01,123 INFO motor 5 moved\n" * 9000,
    "check whether this is a file of another program": "a: b\nc: d\ne: f\ng: h\ni: j\n" + "1 2 0.5\n" * 50,
}


@pytest.mark.thorough
@pytest.mark.parametrize("program", OTHERS)
@pytest.mark.parametrize("robust", [False, True])
def test_a_file_of_another_program_is_named_in_one_line(program: str, robust: bool):
    words = fault(OTHERS[program], robust=robust)
    assert words.count("\n") == 0
    assert "not a table of numbers" in words
    assert program in words


SECTION = "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,RADuration\n"
OFF, ON = (f"INFO: Guiding parameter change, MountGuidingEnabled = {word}\n" for word in ("false", "true"))


def guide_log(first: int = 20, last: int = 350, between: str = OFF) -> str:
    """A log of PHD2: a piece with pulses, some turns without and with a star that was lost, another with pulses."""
    star = [f"{e / 1.5 * np.cos(np.pi / 6):.6f}" for e in ERROR]
    pulse = ["0" if first <= k < last else f"{40 + k % 7}" for k in range(len(ERROR))]
    rows = [f'{k + 1},{2 * k},"Mount",0,0,{star[k]},0,0,0,{pulse[k]}\n' for k in range(len(ERROR))]
    rows[200] = '201,400,"DROP",,,,,,,,,,,,,11,1.20,2,"Star lost - low SNR"\n'
    head = "PHD2 version 2.6.13, Log version 2.5.\n\nGuiding Begins at 2026-01-01 20:05:00\n"
    head += "Pixel scale = 1.50 arc-sec/px, Binning = 1\nRA = 5.00 hr, Dec = 30.0 deg, Hour angle = 1.00 hr\n"
    return "".join([head, SECTION, *rows[:20], between, *rows[20:350], ON, *rows[350:], "Guiding Ends at 21:00:00\n"])


def test_unguided_guide_log_section_gives_an_error_over_the_axis():
    trace = read(guide_log(), ratio=100)
    kept = [*range(20, 200), *range(201, 350)]
    assert trace.cam_deg == pytest.approx(2 * np.array(kept) * 15.041067 / 3600 * 100)
    assert trace.error_arcsec == pytest.approx(ERROR[kept], abs=1e-4)
    assert (trace.line[0], trace.line[-1]) == (28, 357)
    assert any("lines 28 to 357" in note for note in trace.notes)
    # what the log says of guiding does not count, only whether there are pulses
    assert read(guide_log(between=""), ratio=100).line.tolist() == (trace.line - 1).tolist()
    assert "does not state the guide rate" in fault(guide_log(0, 0), ratio=100)
    # nor are rows before and after a line that may have moved the star one section
    moved = read(guide_log(0, 400, "INFO: DITHER by 1.0, 2.0, new lock pos = 300, 200\n"), ratio=100)
    assert (moved.line[0], moved.line[-1]) == (28, 357)
    bare = guide_log().replace("Dec = 30.0 deg", "Cal Dec = 60.0")
    assert read(bare, ratio=100).is_lower_bound
    for wrong, right in (("1.50 arc", "1.5.0 arc"), ("RARawDistance", "Raw"), ("RADuration", "Pulse")):
        assert "contains no frames" in fault(guide_log().replace(wrong, right), ratio=100)


@pytest.mark.parametrize(("stated", "turn_s"), [("!StepsPerWorm=90000\n", 90000 / 187.5), ("", 479.0)])
def test_eqmod_file_gives_an_error_over_worm_revolutions(stated: str, turn_s: float):
    head = f"# EQMOD V2.00\n!WormPeriod=479\n{stated}# time - motor - PE\n"
    rows = [f"{k} {8388608 + 187.5 * k:.1f} {e:.4f}\n" for k, e in enumerate(ERROR)]
    trace = read(head + "".join(rows))
    assert trace.cam_deg - trace.cam_deg[0] == pytest.approx(360 * np.arange(400) / turn_s, abs=1e-4)
    assert trace.error_arcsec == pytest.approx(ERROR, abs=1e-4)
    assert any("a PE file of EQMOD" in note for note in trace.notes)
    assert "contains no line !WormPeriod" in fault(head.replace("479", "0") + "".join(rows))


def test_words():
    names = ("wg_angle_deg", "output_angle", "F_kpp", "phi_h_deg", "TransmissionError", "time_s", "Winkel", "outError")
    assert [role_in(name) for name in names] == ["cam", "output", "error", "cam", "error", "time", "angle", "error"]
    units = ("angle [°]", "error/µrad", "err_mdeg", "error (arcsec)", "angle", "d", "phi rad")
    assert [unit_in(name) for name in units] == ["deg", "urad", "mdeg", "arcsec", "", "", "rad"]


def test_lines_of_bench_software_above_the_names_are_omitted():
    plain = read_trace(PLAIN.encode())
    by_excel = read_trace(b"sep=,\n" + PLAIN.encode())
    assert np.array_equal(by_excel.error_arcsec, plain.error_arcsec)
    head = "Rig 4;Operator: A\nDate;2026-11-20\nChannel 1;ok;fine\n"
    of_bench = read_trace((head + PLAIN.replace(",", ";")).encode())
    assert np.array_equal(of_bench.cam_deg, plain.cam_deg)
    assert "left out, above the line of names: lines 1, 2, 3" in of_bench.notes
    assert of_bench.line[0] == 5
    units = PLAIN.replace("\n", "\n(deg),(arcsec)\n", 1)
    assert "2:1: a line of text among the rows" in fault(units)  # which of the lines has the names is not sure


def test_rows_out_of_order_are_no_counter_that_begins_again():
    angle = 9.0 * np.arange(4000)[np.random.default_rng(0).permutation(4000)]
    assert "the angle jumps back" in fault(text([angle, np.tile(ERROR, 10)], "cam_deg,err"))


def test_a_record_that_is_not_filled_in_says_so():
    rows = "".join(f"{9 * k},1,\n" for k in range(40))
    words = (
        "1:1: no value is written in actual_deg (got target_deg,side,actual_deg; fill it in, or leave out the column)"
    )
    assert words in fault(f"target_deg,side,actual_deg\n{rows}")


def test_rows_without_a_reading_name_the_option_that_omits_them():
    rows = PLAIN.splitlines()
    rows[10] = "nan,1"
    with pytest.raises(PresetError) as caught:
        read_trace("\n".join(rows).encode())
    assert caught.value.hint == "use --robust to leave out rows without valid readings"
    with pytest.raises(PresetError) as caught:  # where no cell has a fault nothing is to be left out
        read_trace(("target_deg,side,actual_deg\n" + "9,1,\n" * 40).encode())
    assert caught.value.hint == ""
