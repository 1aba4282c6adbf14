"""The drive of the paper: all pages say one number of a hole, which is that of the values fitted to the paper."""

import json

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.error.error_map import ErrorMap
from hdassist.features.mounting.positions import rotated
from tests.helpers.process import run

BEST = 8  # the hole that mount orders
NEAR = np.array(
    [0.06, 0.2]
)  # of the values as given, by torque: the figures leave hole 8 at 3.7 to 5.0 arcsec at 800 N*m


@pytest.fixture(scope="module")
def as_given() -> dict[int, list[float]]:
    """F'_ior [arcsec] at both torques as mounted and in the best hole, of the values as given."""
    drive = load_preset("vzp160")
    maps = [ErrorMap(drive, M_g) for M_g in drive.operation.M_g]
    return {hole: [each.extremes(rotated(drive, 30.0 * hole)).first for each in maps] for hole in (0, BEST)}


def answer(command: str, *options: str):
    """A page of the drive with two holes, so that it is cheap."""
    return json.loads(run(command, "vzp160", "--set", f"mounting.allowed=[0, {BEST}]", *options, "--json").stdout)


@pytest.mark.thorough
@pytest.mark.usefixtures("kept")
def test_all_pages_agree_on_F_ior_of_the_paper_drive(as_given):
    report = answer("report", "--draws", "16")  # with the answers of check and mount, which test_one_belief holds
    mounted = report["mount"]
    assert (mounted["order"], mounted["recommended"]["hole"]) == ("turn", BEST)
    for place in (mounted["current"], mounted["recommended"]):
        assert (np.abs(np.divide(place["F_ior_arcsec"], as_given[place["hole"]]) - 1) < NEAR).all()
    now = mounted["current"]["F_ior_arcsec"]
    points = report["check"]["operating_points"]
    assert [point["F_ior_arcsec"] for point in points] == now
    accepted = answer("accept", "--limit", "40", "--draws", "16")["checks"]
    upper = np.add(now, [point["self_error_arcsec"] for point in points])
    assert [each["value"] for each in accepted] == pytest.approx(upper)
