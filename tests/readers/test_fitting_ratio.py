"""A recording that fits another ratio than the stated one is refused, and the ratio that fits is named."""

from __future__ import annotations

import re

import numpy as np
import pytest

from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.errors import PresetError

TWO_ENCODERS = TraceForm(angle="cam", second="out", angle_unit="deg")


def recording(ratio: float, *, turns: float = 10, stated: float | None = None, drift_arcsec: float = 0.0) -> bytes:
    """Return a recording with 20 arcsec at order 2: of two encoders, or the error by a stated ratio."""
    cam = np.arange(0, turns * 360, 6.0)
    error = 20 * np.sin(np.radians(2 * cam)) + drift_arcsec * cam / cam[-1]
    output = cam / ratio + error / 3600
    if stated is None:
        return ("cam,out\n" + "".join(f"{a:.4f},{b:.8f}\n" for a, b in zip(cam, output, strict=True))).encode()
    off = (output - cam / stated) * 3600
    return ("cam_deg,error_arcsec\n" + "".join(f"{a:.4f},{e:.5f}\n" for a, e in zip(cam, off, strict=True))).encode()


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("ratio", [99.0, 101.0, 100.5, 50.5])
def test_two_encoders_name_the_ratio_that_fits(ratio: float, sense: int) -> None:
    stated = round(ratio / 1.01)  # within the 2 % in which two encoders may disagree
    with pytest.raises(PresetError) as refused:
        read_trace(recording(sense * ratio), TWO_ENCODERS, stated)
    named = re.search(r"indicates a ratio of (\d+\.\d+), not", refused.value.findings[0].message)
    assert named is not None
    assert float(named[1]) == pytest.approx(ratio, abs=0.01)


def test_an_error_of_unknown_sign_names_both_ratios() -> None:
    with pytest.raises(PresetError) as refused:
        read_trace(recording(101.0, stated=100.0), None, 100.0)
    named = re.findall(r"\d+\.\d{3}", refused.value.findings[0].message)
    assert [float(ratio) for ratio in named] == pytest.approx([101.0, 99.02], abs=0.01)


@pytest.mark.parametrize(
    ("fitting", "stated", "part"), [(101.0, 100.0, "circular spline"), (100.0, 101.0, "flexspline")]
)
def test_the_hint_names_the_part_on_which_the_output_is(fitting: float, stated: float, part: str) -> None:
    with pytest.raises(PresetError) as refused:
        read_trace(recording(fitting), TWO_ENCODERS, stated)
    assert refused.value.findings[0].hint.endswith(f"the output is on the {part}")


def test_another_ratio_has_no_cause_in_its_hint() -> None:
    with pytest.raises(PresetError) as refused:
        read_trace(recording(100.5), TWO_ENCODERS, 100.0)
    assert "output is on" not in refused.value.findings[0].hint


@pytest.mark.parametrize("drift_arcsec", [0.0, 30.0, -100.0, 1000.0])
def test_a_drift_is_no_other_ratio(drift_arcsec: float) -> None:
    turns = 100 if abs(drift_arcsec) > 100 else 10  # 1000 arcsec in an output revolution are still no ratio
    trace = read_trace(recording(100.0, turns=turns, drift_arcsec=drift_arcsec), TWO_ENCODERS, 100.0)
    assert len(trace.error_arcsec) == 60 * turns


def test_the_ratio_that_fits_is_taken() -> None:
    trace = read_trace(recording(101.0), TWO_ENCODERS, 101.0)
    assert np.ptp(trace.error_arcsec) == pytest.approx(
        40 * np.sin(np.radians(84)), abs=1e-3
    )  # peaks are 45 deg, readings at 42


def test_without_a_stated_ratio_there_is_none_to_contradict() -> None:
    assert len(read_trace(recording(101.0, stated=100.0)).line) == 600
