"""Guide logs: a simulated axis that is guided, whose unguided error is known, in the forms that programs write."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import pytest

from hdassist.drive.model.geometry import Array
from hdassist.readers.trace import MeasuredTrace, TraceForm, read_trace
from hdassist.run.errors import PresetError
from tests.helpers.process import run

SCALE, DECLINATION, RATE = 1.5, 40.0, 7.5  # arcsec/px, deg, and arcsec/s of the axis
NAMES = "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,RADuration,RADirection"
HEAD = (
    "PHD2 version 2.6.13, Log version 2.5. Log enabled at 2026-01-01 20:00:00\n\n"
    "Guiding Begins at 2026-01-01 20:05:00\nPixel scale = 1.50 arc-sec/px, Binning = 1\n"
    "Mount = Driver, guiding enabled, xAngle = 90.3, xRate = {calibrated:.4f}, yAngle = 5.1\n"
    "RA Guide Speed = {guide_speed} a-s/s, Dec Guide Speed = 7.5 a-s/s, Cal Dec = 12.0\n"
    "RA = 5.00 hr, {declination}, Hour angle = 1.00 hr\n"
)
AXIS_SCALE = SCALE / np.cos(np.radians(DECLINATION))  # arcsec of the axis in a pixel


@dataclass(frozen=True)
class GuidedNight:
    """A simulated night: times [s], true error of the axis [arcsec], distances [px] and pulses [s], shape (frames,)."""

    time_s: Array
    error_arcsec: Array
    distance_px: Array
    pulse_s: Array

    def rows(self, first: int = 0, last: int | None = None) -> str:
        """Rows of frames in the log."""
        texts = []
        for number in range(len(self.time_s))[first:last]:
            pulse = self.pulse_s[number]
            direction = "W" if pulse > 0 else "E" if pulse < 0 else ""
            distance, duration = self.distance_px[number], round(abs(pulse) * 1000)
            texts.append(
                f'{number + 1},{self.time_s[number]:.3f},"Mount",0,0,{distance:.4f},0,0,0,{duration},{direction}\n'
            )
        return "".join(texts)


def guided_night(gain: float = 0.7, frames: int = 400, dither_px: float = 0.0) -> GuidedNight:
    """Frames of 5 s of an axis with 20 arcsec twice in 430 s; at frame 200 the lock position moves by dither_px."""
    time_s = 5.0 * np.arange(frames)
    error = 20 * np.sin(2 * np.pi * time_s / 430) + 4 * np.sin(2 * np.pi * time_s / 860 + 1)
    distance, pulses, corrected = np.empty(frames), np.empty(frames), 0.0
    for number in range(frames):
        moved = dither_px if number >= 200 else 0.0
        distance[number] = (error[number] - corrected) / AXIS_SCALE + moved
        pulses[number] = np.round(gain * distance[number] * AXIS_SCALE / RATE, 3)
        corrected += RATE * pulses[number]
    return GuidedNight(time_s, error, distance, pulses)


def head(
    declination: str = f"Dec = {DECLINATION} deg", calibrated: float = RATE / AXIS_SCALE, guide_speed: str = "7.5"
) -> str:
    return HEAD.format(declination=declination, calibrated=calibrated, guide_speed=guide_speed) + NAMES + "\n"


def read(text: str, **form: float) -> MeasuredTrace:
    return read_trace(text.encode(), TraceForm(**form), 100)


def departure(trace: MeasuredTrace, error_arcsec: Array) -> float:
    """Largest difference of an error from a true one [arcsec], both less their means."""
    return float(np.abs(trace.error_arcsec - trace.error_arcsec.mean() - (error_arcsec - error_arcsec.mean())).max())


def test_pulses_that_are_added_back_give_the_unguided_error():
    night = guided_night()
    assert np.ptp(night.distance_px) * AXIS_SCALE < 0.3 * np.ptp(night.error_arcsec)  # guiding hides the error
    trace = read(head() + night.rows())
    assert departure(trace, night.error_arcsec) < 0.05
    assert trace.scale_uncertainty == pytest.approx(0.05)
    assert not trace.is_lower_bound


@pytest.mark.parametrize(("guide_speed", "expected"), [("9.0", 0.1), ("Unknown", 0.1), ("7.6", 0.05)])
def test_rates_that_disagree_widen_the_interval(guide_speed: str, expected: float):
    trace = read(head(guide_speed=guide_speed) + guided_night().rows())
    assert trace.scale_uncertainty == pytest.approx(expected, abs=1e-3)


def test_interval_of_a_guided_log_contains_truth_despite_wrong_rate(tmp_path):
    """The calibration is 12 % off, and the mount states the true rate: the interval reaches it."""
    night = guided_night()
    (tmp_path / "log.txt").write_text(head(calibrated=1.12 * RATE / AXIS_SCALE) + night.rows())
    answer = json.loads(run("measure", "log.txt", "--ratio", "100", "--json", cwd=tmp_path).stdout)
    low, high = answer["directions"][0]["interval_arcsec"]
    assert low < np.ptp(night.error_arcsec) < high
    assert next(source for source in answer["directions"][0]["budget"] if source["source"] == "guide rate")


def test_a_stated_rate_counts_before_that_of_the_log():
    night = guided_night()
    stated = read(head(calibrated=1.2 * RATE / AXIS_SCALE) + night.rows(), guide_rate=RATE)
    assert departure(stated, night.error_arcsec) < 0.05
    assert stated.scale_uncertainty == 0


@pytest.mark.parametrize(
    ("stated", "is_another"),
    [({"guide_rate": RATE}, False), ({"guide_rate": 8 * RATE}, True), ({"declination": DECLINATION - 20}, True)],
)
def test_a_stated_value_that_the_log_contradicts_is_named(stated: dict[str, float], is_another: bool) -> None:
    night = guided_night()
    notes = read(head() + night.rows(), **stated).notes
    assert any("although the log states" in note for note in notes) == is_another


def test_a_log_of_kstars_has_no_calibrated_rate():
    night, text = guided_night(), head(calibrated=1.0, guide_speed="Unknown")
    with pytest.raises(PresetError, match="does not state the guide rate"):
        read(text.replace("PHD2 version 2.6.13", "KStars version: 3.6.8. PHD2 log version") + night.rows())
    assert departure(read(text + night.rows(), guide_rate=RATE), night.error_arcsec) < 0.05


def test_dither_ends_a_section_unlike_a_settling_line():
    night = guided_night(dither_px=3.0)
    parts = night.rows(0, 200), night.rows(200)
    dithered = read(head() + parts[0] + "INFO: DITHER by 3.0, 0.0, new lock pos = 10, 20\n" + parts[1])
    assert len(dithered.line) == 200
    assert departure(dithered, night.error_arcsec[:200]) < 0.05
    whole = guided_night()
    settled = read(head() + whole.rows(0, 200) + "INFO: SETTLING STATE CHANGE, Settling complete\n" + whole.rows(200))
    assert departure(settled, whole.error_arcsec) < 0.05
    assert any("400 of 400 frames" in note for note in settled.notes)


def test_unguided_section_is_preferred_if_long_enough():
    night, quiet = guided_night(), guided_night(gain=0.0, frames=300)
    assert departure(read(head() + night.rows() + head() + quiet.rows()), quiet.error_arcsec) < 0.05
    short = guided_night(gain=0.0, frames=60)
    assert departure(read(head() + night.rows() + head() + short.rows()), night.error_arcsec) < 0.05


def test_a_calibration_is_no_section():
    steps = "Calibration Begins at 2026-01-01 20:02:00\nPixel scale = 9.00 arc-sec/px\nDirection,Step,dx,dy,x,y,Dist\n"
    steps += "".join(f"West,{step},{step},0,1,2,{step}\n" for step in range(12))
    night = guided_night()
    assert departure(read(head() + night.rows() + steps), night.error_arcsec) < 0.05


def test_unknown_declination_gives_a_lower_bound_unless_stated(tmp_path):
    quiet = guided_night(gain=0.0)
    text = head(declination="RA/Dec = Unknown") + quiet.rows()
    bound = read(text)
    assert bound.is_lower_bound
    assert np.ptp(bound.error_arcsec) == pytest.approx(np.ptp(quiet.error_arcsec) * SCALE / AXIS_SCALE, rel=1e-3)
    stated = read(text, declination=DECLINATION)
    assert departure(stated, quiet.error_arcsec) < 0.05
    assert not stated.is_lower_bound
    (tmp_path / "log.txt").write_text(text)
    answer = json.loads(run("measure", "log.txt", "--ratio", "100", "--json", cwd=tmp_path).stdout)
    assert answer["directions"][0]["F_ior_is_lower_bound"] is True
    assert answer["directions"][0]["full_cycle"] is None  # both of its ends would be without the declination
    refused = run("compensate", "log.txt", "--ratio", "100", "--torque", "1", cwd=tmp_path)
    assert refused.returncode == 4
    guided = head(declination="RA/Dec = Unknown") + guided_night().rows()
    with pytest.raises(PresetError, match="does not state the declination"):
        read(guided)


def test_a_declination_of_the_section_before_does_not_count():
    known = guided_night(gain=0.0, frames=30)
    unknown = guided_night(gain=0.0)
    text = head() + known.rows() + head(declination="RA/Dec = Unknown") + unknown.rows()
    assert read(text).is_lower_bound


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [(",W\n", ",\n", "without a direction"), (",W\n", ",X\n", "without a direction"), ("", "", "increase the error")],
)
def test_pulses_that_cannot_be_added_back_are_refused(old: str, new: str, fault: str):
    rows = guided_night().rows()
    if old:
        rows = rows.replace(old, new)
    else:
        rows = rows.replace(",W\n", ",?\n").replace(",E\n", ",W\n").replace(",?\n", ",E\n")
    with pytest.raises(PresetError, match=fault):
        read(head() + rows)


def test_options_of_a_guide_log_are_refused_with_another_file(tmp_path):
    (tmp_path / "trace.csv").write_text("cam_deg,error_arcsec\n" + "".join(f"{10 * k},{k % 7}\n" for k in range(200)))
    refused = run("measure", "trace.csv", "--ratio", "100", "--declination", "20", cwd=tmp_path)
    assert refused.returncode == 2


def test_compare_refuses_an_error_that_depends_on_the_guide_rate(tmp_path):
    (tmp_path / "log.txt").write_text(head() + guided_night().rows())
    refused = run("compare", "vzp160", "log.txt", "--torque", "80", cwd=tmp_path)
    assert refused.returncode == 5
    assert "--guide-rate" in refused.stderr
