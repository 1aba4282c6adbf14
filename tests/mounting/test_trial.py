"""Trials as they are written."""

import pytest

from hdassist import load_preset
from hdassist.features.measuring.measure import Reading
from hdassist.features.mounting.positions import usable_positions
from hdassist.features.mounting.posterior import Trial, TrialSetup, read_trial, read_trial_or_record
from hdassist.run.errors import UsageError
from tests.helpers.process import SMALL


@pytest.mark.parametrize("holes", [12, 14, 25, 49])
def test_holes_of_trials_are_the_positions_of_the_seat(holes: int) -> None:
    for hole, rotation in enumerate(usable_positions(holes, "all")):
        assert read_trial(f"h{hole}=17", holes).rotation_deg == rotation
        assert read_trial(f"{rotation!r}=17", holes).rotation_deg == rotation


def test_value_in_a_hole_that_is_not_allowed_is_refused() -> None:
    assert read_trial("h4=17", 12, [3, 4]) == Trial(120.0, 17.0)
    with pytest.raises(UsageError, match=r"--verify .*: hole 5 is not in mounting\.allowed"):
        read_trial("h5=17", 12, [3, 4])


def test_reading_trials() -> None:
    assert read_trial("120=17.3", 12) == Trial(120.0, 17.3)
    assert read_trial("h4=17.3", 12) == read_trial("H4=17.3", 12) == Trial(120.0, 17.3)
    assert read_trial("4=17.3", 0) == Trial(4.0, 17.3)
    assert read_trial("-30=17.3", 12) == Trial(330.0, 17.3)
    assert read_trial("h4@80=17.3", 12) == Trial(120.0, 17.3, M_g=80.0)
    assert read_trial("120@-2.5=17.3", 12) == Trial(120.0, 17.3, M_g=-2.5)


NO_TRIALS = [
    "",
    "120",
    "120=",
    "=17",
    "h=17",
    "h12=17",
    "h-1=17",
    "h1.5=17",
    "x=17",
    "30=0",
    "30=-3",
    "30=nan",
    "inf=3",
    "4=17",
    "99999=3",
    "h4=run.csv",
    "h4@=17",
    "h4@0=17",
    "h4@nan=17",
    "h4@x=17",
    "@4=17",
    "h4@1e9=17",
]


@pytest.mark.parametrize("text", NO_TRIALS)
def test_what_is_no_trial(text: str) -> None:
    with pytest.raises(UsageError, match=r"trial|holes|no hole"):
        read_trial(text, 12)


@pytest.mark.parametrize("value", ["34um", "1O.5", "rum", ""])
def test_value_that_is_neither_number_nor_file_is_refused(value: str) -> None:
    wanted = r"invalid trial .*: expected F._ior in arcsec, as in h4=17\.3, or the file of a recording"
    with pytest.raises(UsageError, match=wanted):
        read_trial_or_record(f"h4={value}", load_preset(SMALL), Reading(), 10.0)


def test_holes_of_a_seat_without_holes() -> None:
    with pytest.raises(UsageError, match="the seat has no holes"):
        read_trial("h1=17", 0)


@pytest.mark.parametrize("rig", [(0.0,), (4.0, 0.0), (4.0, -1.0), (float("nan"),)])
def test_rigs_that_are_none(rig: tuple[float, ...]) -> None:
    with pytest.raises(UsageError):
        TrialSetup(*rig)
