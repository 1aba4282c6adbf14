"""Units that headings and options state: used, or refused with the name of the column."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

from hdassist.features.measuring.bench import LoopRecord, PositionRecord, bench_record
from hdassist.readers.trace import MeasuredTrace, TraceForm, read_record, read_trace
from hdassist.readers.words import TIMES, TORQUES, foreign_unit_in, length_in, role_in, unit_in
from hdassist.run.errors import DataError, PresetError, UsageError
from tests.helpers.process import run
from tests.helpers.rigs import text

TURNS = np.arange(400) / 100
ERROR = 14.4 * np.cos(4 * np.pi * TURNS) + 0.1 * np.sin(1e3 * TURNS)


def trace(head: str, size: float = 1.0, **form: str) -> MeasuredTrace:
    """A trace whose errors are written in a unit of such a size [arcsec], under a line of names."""
    data = text([360 * TURNS, ERROR / size], head, ";", digits=9)
    return read_trace(data.encode(), TraceForm(**form))


def refusal(head: str, **form: str) -> str:
    with pytest.raises(PresetError) as caught:
        trace(head, **form)
    return str(caught.value)


UNDERSTOOD = {
    "error [']": 60.0,
    "error [′]": 60.0,
    'error [""]': 1.0,
    "error ['']": 1.0,
    "error [arc min]": 60.0,
    "error [arc-sec]": 1.0,
    "error min of arc": 60.0,
    "Fehler [Winkelminuten]": 60.0,
    "Fehler [Bogensekunden]": 1.0,
    "Fehler [Grad]": 3600.0,
    "ошибка [угл. мин]": 60.0,
    "ошибка, угл. сек": 1.0,
    "ошибка [мрад]": 206.26480624709636,
    "error_gon": 3240.0,
    "error [mgon]": 3.24,
    "error [gradians]": 3240.0,
    "error_mil": 202.5,
    "error_mrad": 206.26480624709636,
    "error (milliradians)": 206.26480624709636,
    "error/mas": 0.001,
    "error [rev]": 1_296_000.0,
}


@pytest.mark.parametrize(("head", "size"), UNDERSTOOD.items())
def test_a_unit_that_is_understood_is_used(head: str, size: float) -> None:
    found = trace(f'cam_deg;"{head}"', size)
    assert found.error_arcsec == pytest.approx(ERROR, abs=2e-3)
    assert "no unit stated" not in " ".join(found.notes)


FOREIGN = (
    "error_mm", "error_um", "error [µm]", "error_V", "error [mV]", "error min", "error [min]", "error_ms", "error_px",
    "error [%]", "error [furlong]", "error (LSB)", "error/grd", "error [grad]", "Fehler [Inkr.]",
)  # fmt: skip


@pytest.mark.parametrize("head", FOREIGN)
def test_foreign_unit_is_refused_unless_an_option_states_it(head: str) -> None:
    assert head in refusal(f"cam_deg;{head}")
    assert trace(f"cam_deg;{head}", 60.0, error_unit="arcmin").error_arcsec == pytest.approx(ERROR, abs=2e-3)


SCALED = (
    "error [0.1 arcsec]", "error [10 arcsec]", "error (10 arc sec)", "error [arcsec/10]", "error_arcsec/10",
    "error x10 arcsec", "error_arcsec_x10", "error/10 arcsec", "error*1000 [deg]", "error [10^-3 deg]",
    "error [×10⁻³ °]", "error (deg/1000)", "error 1e-3 deg", "error [rad]*1e6", "error [1e-6 rad]", "error urad e-6",
    "error [arcsec/s]", "error_arcsec/s", "error_arcsec_per_turn", "error [arcsec²]", "error [mV/deg]",
    "error [arcsec/rev]", "error [deg/N·m]",
)  # fmt: skip


@pytest.mark.parametrize("head", SCALED)
def test_scaled_or_rate_unit_is_not_read_as_plain_unit(head: str) -> None:
    assert head in refusal(f"cam_deg;{head}")
    assert trace(f"cam_deg;{head}", 60.0, error_unit="arcmin").error_arcsec == pytest.approx(ERROR, abs=2e-3)


@pytest.mark.parametrize("head", ["cam [0.1 deg]", "cam_deg/10", "cam [deg/s]"])
def test_an_angle_of_such_a_unit_is_refused_too(head: str) -> None:
    assert head in refusal(f"{head};error_arcsec")


@pytest.mark.parametrize("head", ["error_cnt", "err_lsb", "error_inc", "error_pulses", "error_digits"])
def test_counts_by_any_name_need_their_number_in_a_turn(head: str) -> None:
    assert "counts" in refusal(f"cam_deg;{head}")


def test_numbers_of_channels_and_sweeps_are_no_factors() -> None:
    names = (
        "error_2 [arcsec]", "error2_arcsec", "error_arcsec_2", "err ch 2 arcsec", "error [arcsec pk-pk]",
        "error [1 arcsec]", "error [arcsec] at 20 °C", "error (x) [arcsec]", "error a/b [arcsec]", "error, arcsec",
    )  # fmt: skip
    assert [unit_in(name) for name in names] == ["arcsec"] * len(names)
    assert [foreign_unit_in(name) for name in names] == [""] * len(names)
    assert unit_in("cam_deg / error_arcsec") == "deg"
    for name in ("torque [N*m]", "torque [N·m]", "torque, N m"):
        assert unit_in(name, TORQUES) == "N·m"


@pytest.mark.parametrize("head", ["cam_mm", "cam [V]", "cam [blurbs]"])
def test_angles_too(head: str) -> None:
    assert head in refusal(f"{head};error_arcsec")
    assert trace(f"{head};error_arcsec", angle_unit="deg").cam_deg == pytest.approx(360 * TURNS, abs=1e-6)


def test_words_that_are_no_units() -> None:
    names = (
        "error (raw)", "error [filtered]", "error (cam - output)", "error[0]", "error_2", "error at 20 °C",
        "output_error", "error_left", "TE", "error at 60 rpm", "a/b", "error (ccw)", "error", "in_error",
        "error (1st run)", "error (meas.)", "time (UTC)",
    )  # fmt: skip
    assert [foreign_unit_in(name) for name in names] == [""] * len(names)


def test_a_remark_that_states_a_unit_is_not_passed_over() -> None:
    data = text([360 * TURNS, ERROR / 60], "cam_deg;error", ";", digits=9)
    with pytest.raises(PresetError, match="arcmin"):
        read_trace(f"# unit: arcmin\n{data}".encode())
    found = read_trace(f"# unit: arcmin\n{data}".encode(), TraceForm(error_unit="arcmin"))
    assert found.error_arcsec == pytest.approx(ERROR, abs=2e-3)


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("torque_Nm", 1.0), ("torque [N m]", 1.0), ("torque [lbf·in]", 0.1129848290276167), ("torque_in-lb", 0.1129848),
        ("torque [ft-lb]", 1.3558179), ("torque_ozin", 0.00706155), ("момент [Н·м]", 1.0),
        ("момент, кгс·см", 0.0980665), ("Drehmoment [mNm]", 1e-3), ("torque kgf-cm", 0.0980665),
    ],
)  # fmt: skip
def test_units_of_torque(name: str, size: float) -> None:
    assert TORQUES[unit_in(name, TORQUES)] == pytest.approx(size)
    assert role_in(name) == "torque"


def test_additional_column_has_a_unit_of_its_kind_or_fails() -> None:
    for head in ("torque_%", "torque [A]", "time [samples]", "torque_deg"):
        data = text([360 * TURNS, ERROR, TURNS], f"cam_deg;error_arcsec;{head}", ";")
        with pytest.raises(PresetError) as caught:
            read_trace(data.encode())
        assert head in str(caught.value)
    assert TIMES[unit_in("time [h]", TIMES)] == 3600


@pytest.mark.parametrize("head", ["T_C", "T [°C]", "temperature", "Temp [K]", "T/°F", "T_degC", "T"])
def test_a_temperature_is_no_time_and_no_torque(head: str) -> None:
    data = text([360 * TURNS, ERROR, 20 + TURNS], f"cam_deg;error_arcsec;{head}", ";")
    found = read_trace(data.encode())
    assert found.time_s is None
    assert found.load is None
    assert f'not used: "{head}"' in " ".join(found.notes)
    assert role_in("t [s]") == role_in("T [s]") == role_in("t") == "time"


POSITIONS = "target,deviation,side\n" + "".join(f"{30 * k},{np.sin(k):.4f},1\n" for k in range(12)) * 2
LOOP = "torque,position\n" + "".join(
    f"{load},{0.01 * load + way * 0.02:.4f}\n"
    for way, loads in ((-1, range(-10, 11)), (1, range(10, -11, -1)), (-1, range(-10, 11)))
    for load in loads
)


def bench(data: str, **form: str) -> PositionRecord | LoopRecord:
    found = bench_record(read_record(io.StringIO(data), TraceForm(**form)), TraceForm(**form))
    assert found
    return found


def test_options_state_the_units_of_positions_and_loops() -> None:
    plain, stated = bench(POSITIONS), bench(POSITIONS, error_unit="arcmin", angle_unit="arcmin")
    assert isinstance(plain, PositionRecord)
    assert isinstance(stated, PositionRecord)
    assert stated.deviation_arcsec == pytest.approx(60 * plain.deviation_arcsec)
    assert stated.target_arcsec == pytest.approx(plain.target_arcsec / 60)
    loop = bench(LOOP)
    assert isinstance(loop, LoopRecord)
    for unit in ("error_unit", "angle_unit"):
        wide = bench(LOOP, **{unit: "deg"})
        assert isinstance(wide, LoopRecord)
        assert wide.twist_arcsec == pytest.approx(3600 * loop.twist_arcsec)
    rows = "".join(f"{30 * k},{1800 * k + 0.001 * k:.4f}\n" for k in range(12))
    actual = bench(f"target,actual\n{rows}", angle_unit="deg,arcmin")
    assert isinstance(actual, PositionRecord)
    assert np.ptp(actual.deviation_arcsec) == pytest.approx(0.66)
    assert not any("no unit stated" in note for note in actual.table.notes)


@pytest.mark.parametrize(
    ("data", "form"),
    [
        (POSITIONS.replace("deviation", "actual"), {"error_unit": "arcmin"}),
        (POSITIONS, {"angle_unit": "deg,deg"}),
        (LOOP, {"error_unit": "deg", "angle_unit": "deg"}),
        (LOOP, {"angle_unit": "deg,deg"}),
    ],
)
def test_unit_of_a_missing_column_is_refused(data: str, form: dict[str, str]) -> None:
    with pytest.raises(UsageError, match="unit"):
        bench(data, **form)


def test_positions_in_minutes_fail_where_the_option_says_so(tmp_path) -> None:
    (tmp_path / "pos.csv").write_text(POSITIONS)
    (tmp_path / "loop.csv").write_text(LOOP)
    measured = ["--limit", "positioning=60", "--measured", "6.7=pos.csv", "--measured-only"]
    budget = ["--budget", "encoder=0,coupling=0,reseating=0,temperature=0"]
    done = run("accept", "size-25-100", *measured, *budget, "--error-unit", "arcmin", "--json", cwd=tmp_path)
    assert done.returncode == 3
    (check,) = json.loads(done.stdout)["checks"]
    assert check["value"] > 100
    loops = json.loads(run("measure", "loop.csv", "--error-unit", "deg", "--json", cwd=tmp_path).stdout)
    assert loops["quantities"][0]["value_arcsec"] == pytest.approx(144)


SECONDS = np.arange(0, 3600, 3.0)
WORM = 20 * np.sin(2 * np.pi * SECONDS / 430.82) + 0.5 * np.random.default_rng(2).standard_normal(len(SECONDS))


@pytest.mark.parametrize("names", ["time_s,error_arcsec", "time_min,error_arcsec", ""])
def test_time_is_read_by_the_speed_of_the_output(names: str, tmp_path) -> None:
    size = 60 if "min" in names else 1
    data = text([SECONDS / size, WORM], names or "x,y", digits=6)
    (tmp_path / "pe.csv").write_text(data if names else data.partition("\n")[2])
    done = run("measure", "pe.csv", "--ratio", "100", "--speed", "15.041", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    second = next(order for order in found["directions"][0]["orders"] if abs(order["per_cam_rev"] - 2) < 0.01)
    assert second["amplitude_arcsec"] == pytest.approx(20, abs=0.2)
    assert found["F_ior_arcsec"] == pytest.approx(40, abs=1)
    assert found["rate_arcsec_per_s"] == pytest.approx(0.292, abs=0.01)


def test_time_without_a_speed_is_no_angle(tmp_path) -> None:
    (tmp_path / "pe.csv").write_text(text([SECONDS, WORM], "time_s,error_arcsec"))
    for options in ([], ["--angle", "time_s"], ["--angle", "1", "--angle-unit", "s"]):
        done = run("measure", "pe.csv", "--ratio", "100", *options, cwd=tmp_path)
        assert done.returncode == 4
        assert "--speed" in done.stderr
        assert "--period" in done.stderr


@pytest.mark.parametrize("names", ["time_s,error_arcsec", "time_min,error_arcsec", ""])
def test_time_is_read_by_the_period_of_the_input(names: str, tmp_path) -> None:
    size = 60 if "min" in names else 1
    data = text([SECONDS / size, WORM], names or "x,y", digits=6)
    (tmp_path / "pe.csv").write_text(data if names else data.partition("\n")[2])
    done = run("measure", "pe.csv", "--ratio", "100", "--period", "861.64", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    second = next(order for order in found["directions"][0]["orders"] if abs(order["per_cam_rev"] - 2) < 0.01)
    assert second["amplitude_arcsec"] == pytest.approx(20, abs=0.2)
    assert found["rate_arcsec_per_s"] == pytest.approx(0.292, abs=0.01)


def test_a_period_that_cannot_be_used_is_refused(tmp_path) -> None:
    (tmp_path / "pe.csv").write_text(text([SECONDS, WORM], "time_s,error_arcsec"))
    (tmp_path / "angles.csv").write_text(text([SECONDS, WORM], "cam_deg,error_arcsec"))
    both = run("measure", "pe.csv", "--speed", "15.041", "--period", "861.64", cwd=tmp_path)
    angles = run("measure", "angles.csv", "--period", "861.64", cwd=tmp_path)
    output = run("measure", "pe.csv", "--period", "861.64", "--angle-of", "output", "--ratio", "100", cwd=tmp_path)
    assert (both.returncode, angles.returncode, output.returncode) == (2, 2, 2)


def test_pitch_files_have_the_same_words() -> None:
    assert length_in("dev_V") == "V"
    assert length_in("Fp (furlong)") == "furlong"


def test_grad_alone_is_open() -> None:
    for option in ("error_unit", "angle_unit"):
        with pytest.raises(UsageError, match="grad") as caught:
            trace("cam_deg;error", **{option: "grad"})
        assert "gon" in caught.value.hint
    with pytest.raises(DataError, match="gon"):
        trace("cam_deg;error [grad]")


def test_hint_for_a_scaled_unit_proposes_conversion_only() -> None:
    words = refusal("cam_deg;error [0.1 arcsec]")
    assert "--error-unit" not in words
    assert "convert" in words
