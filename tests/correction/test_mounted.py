"""The hole of the fixed wheel where a stored correction takes off the rest: held against solved cycles."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset
from hdassist.features.correction.correct import advice_corrected
from hdassist.features.correction.forms import CorrectionForm, form_of_text
from hdassist.features.mounting.advice import advise
from hdassist.features.mounting.decision import Decision
from hdassist.features.mounting.positions import rotated, seat_positions
from hdassist.run.errors import UsageError
from hdassist.run.run import UNCHECKED
from tests.helpers.process import TINY, in_a_line, run

SIX = ("mount", TINY, "--set", "mounting.holes=6")
TABLE = CorrectionForm("output", 20)


def advice_of(form: CorrectionForm, *overrides: str, draws: int = 0):
    drive = load_preset(TINY, ["mounting.holes=6", *overrides])
    advice = advise(drive, seat_positions(drive), draws=draws, run=UNCHECKED)
    return advice_corrected(advice, form, draws, UNCHECKED)


@pytest.fixture(scope="module")
def of_one_drive() -> Decision:
    found = advice_of(TABLE).compensated
    assert found
    return found[1]


@pytest.mark.parametrize("place", [0, 2, 5])
def test_residual_in_a_hole_is_that_of_a_fitted_table(of_one_drive, place: int):
    rotation = of_one_drive.rotations_deg[place]
    drive = rotated(load_preset(TINY, ["mounting.holes=6"]), rotation)
    for torque, M_g in enumerate(drive.operation.M_g):
        error = kinematic_error(drive, M_g, run=UNCHECKED)
        at = np.mod(error.states.phi_h / (2 * np.pi * 10), 1) * TABLE.points  # the output turns once in ten
        nodes = np.arange(TABLE.points)
        apart = np.abs(at[:, None] - nodes)
        triangles = np.maximum(0, 1 - np.minimum(apart, TABLE.points - apart))
        values = np.linalg.lstsq(triangles, error.error_arcsec, rcond=None)[0]
        left = np.ptp(error.error_arcsec - triangles @ values)
        assert of_one_drive.at(place)[torque, 0] == pytest.approx(left, rel=0.025)  # of states, not of all angles


@pytest.mark.thorough
def test_a_sample_is_turned_as_a_preset_is():
    drawn = advice_of(TABLE, "phases.xi_b=90±5", draws=8).compensated
    assert drawn and drawn[1].F_ior_arcsec.shape == (2, 8, 6)
    same = advice_of(TABLE, "phases.xi_b=150").compensated
    middle = [drawn[1].quantile(0.5, place)[0] for place in range(6)]
    assert same and same[1].now_arcsec[0, 0] == pytest.approx(middle[1], rel=0.15)


@pytest.mark.thorough
def test_compensated_mount_minimizes_the_table_residual_or_F_ior():
    answer = json.loads(run(*SIX, "--compensated", "output:36", "--json").stdout)
    found = answer["compensated"]
    left = np.array(found["left_arcsec"]["p50"])
    worst_served = np.max(left / left.mean(axis=0), axis=1)
    best = found["rotation_deg"][int(np.argmin(worst_served))]
    assert (found["form"], found["order"]) == ("output turn, 36 points", "turn")
    assert answer["recommended"]["rotation_deg"] == best
    assert run(*SIX, "--compensated", "output:36", "-q").stdout == f"{round(best / 60)}\n"
    page = in_a_line(run(*SIX, "--compensated", "phasors", "--no-plot").stdout)
    plain = json.loads(run(*SIX, "--json").stdout)
    assert plain["compensated"] is None
    words = "the residual F'_ior is the same in all holes. Recommendation without a correction: "
    assert words in page or "it is not valid in any other hole" in page
    assert plain["compensated"] is None


@pytest.mark.thorough
def test_the_card_says_which_hole_the_correction_belongs_to(tmp_path: Path):
    (tmp_path / "wheel.csv").write_text("tooth,error\n")
    asked = (*SIX, "--compensated", "output:36")
    words = in_a_line(run(*asked, "--card", "-", "--serial", "17-042").stdout)
    hole = run(*asked, "-q").stdout.strip()
    assert f"the correction in the controller was recorded on this drive in hole {hole}, zero mark: ______;" in words
    assert "17-042" in words
    assert "correction" not in run(*SIX, "--card", "-").stdout
    russian = run(*SIX, "--compensated", "output:36", "--card", "-", "--lang", "ru").stdout
    assert "поправка контроллера" in russian


@pytest.mark.parametrize("text", ["table", "output:1", "output:many", "cam:-5"])
def test_a_form_that_is_none_is_refused(text: str):
    with pytest.raises(UsageError, match="invalid --compensated"):
        form_of_text(text)
