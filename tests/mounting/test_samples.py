"""Samples before any measured value: what is drawn of a drive, and how it turns with its wheel."""

import re

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief.evidence import stiffness_figures
from hdassist.belief.proposals import TableEffort
from hdassist.drive.error.error_map import ErrorMap
from hdassist.drive.preset.fields import Drive
from hdassist.features.mounting.advice import advise_after
from hdassist.features.mounting.positions import rotated, usable_positions
from hdassist.features.mounting.posterior import HoleSamples, Trial, hole_samples, open_prior, posterior_of
from hdassist.interface.pages.mount import mount_warnings
from hdassist.run.errors import UntrustedError, UsageError
from tests.helpers.process import ASSUMED, SMALL
from tests.helpers.support import changed
from tests.mounting.drives import COARSE, COARSE_MESH, FEW, M_G, POSITIONS, SETUP, direction_of, learnt, shown, told


def require_turned(prior: HoleSamples, drive: Drive, sample: int, direction: int, rotation: float) -> None:
    """F'_ior of a sample of one system with the wheel turned is about that of its drive so turned, by search."""
    place = np.array([sample * prior.weight.shape[1] + direction])
    values = {path: float(of[sample, direction]) for path, of in prior.values.items()}
    assert direction_of(prior)[place][0] == pytest.approx(values["phases.phi_hb"])
    turned = rotated(drive.with_values(values), rotation)
    exact = ErrorMap(turned, M_G).extremes(turned).first
    assert shown(prior, [rotation], place)[0, 0] == pytest.approx(exact, rel=max(5 * prior.read_error, 0.05))


@pytest.mark.thorough
def test_turning_the_wheel_is_turning_all_that_stands_back() -> None:
    """F'_ior of samples in other positions, taken from other directions of theirs, against the wheel turned."""
    drive = load_preset(SMALL, ["tolerances.e_hh=0"])
    prior = hole_samples(drive, (), SETUP, draws=FEW)
    for sample, direction, rotation in ((3, 0, 30.0), (40, 7, 120.0), (77, 11, 330.0)):
        require_turned(prior, drive, sample, direction, rotation)
    some = np.arange(0, prior.weight.size, 97)
    assert shown(prior, [15.0], some) == pytest.approx(shown(prior, [0.0, 30.0], some).mean(axis=1, keepdims=True))


@pytest.mark.thorough
def test_mount_samples_stiffnesses_and_clearances_by_the_data_of_check() -> None:
    """A clearance that is assumed moves F'_ior; a catalogue's stiffness that no drive has leaves none."""
    drive = load_preset(SMALL, ["operation.M_g=4", "tolerances.e_hh=0", ASSUMED])
    effort = {"draws": 6, "table": TableEffort(8, COARSE_MESH)}
    prior = hole_samples(drive, (), SETUP, **effort)
    assert prior.weight.sum(axis=1) == pytest.approx(np.tile([*[1 / 48] * 8, 1 / 6], 3))  # as stated in the ninth
    figures, _ = stiffness_figures(drive)
    agreeing = changed(drive, catalogue__K_2=figures["K_2"])
    assert np.ptp(hole_samples(agreeing, (), SETUP, **effort).weight.sum(axis=1)) > 0
    with pytest.raises(UntrustedError, match=r"from 192 samples, 3 required: .*catalogue\.K_2 = .* contradicts"):
        hole_samples(changed(drive, catalogue__K_2=1e3 * figures["K_2"]), (), SETUP, **effort)


@pytest.mark.thorough
def test_mount_names_a_hole_and_warns_if_few_draws_agree(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten of 16 draws agree, 16 are wanted: a hole all the same, and a warning; at eight wanted none is due."""
    drive = load_preset(SMALL, ["operation.M_g=4", "tolerances.e_hh=0", ASSUMED])
    agreeing = changed(drive, catalogue__K_2=1.37 * stiffness_figures(drive)[0]["K_2"])
    monkeypatch.setattr("hdassist.features.mounting.posterior._DRAWS_A_TABLE", 1)
    few = hole_samples(agreeing, (), SETUP, draws=32, table=TableEffort(8, COARSE_MESH))
    assert re.fullmatch(r"effective sample size [\d.]+ from 16 samples, 16 required", few.few)
    advice = advise_after(agreeing, [Trial(0.0, 73.0), Trial(120.0, 18.0)], SETUP, samples=few)
    assert any("the probability of the choice is approximate" in warning for warning in mount_warnings(advice))
    assert hole_samples(drive, (), SETUP, draws=16, table=TableEffort(8, COARSE_MESH)).few == ""


@pytest.mark.thorough
def test_predicted_values_keep_the_stated_direction_and_others_reopen_it() -> None:
    """Half of what is believed before any value is the offset as stated: F'_ior there is that of the preset itself."""
    drive = load_preset(SMALL, ["tolerances.e_hh=0", "phases.phi_hb=70"])
    found = hole_samples(drive, (), SETUP, draws=FEW)
    stated = np.flatnonzero((found.weight > 0).sum(axis=1) == 1) * found.weight.shape[1]
    assert found.weight.ravel()[stated].sum() == pytest.approx(0.5)
    assert direction_of(found)[stated] == pytest.approx(70)
    truth = {turn: ErrorMap(drive, M_G).extremes(rotated(drive, turn)).first for turn in (0.0, 120.0)}
    assert shown(found, [*truth], stated).mean(axis=0) == pytest.approx([*truth.values()], rel=0.1)

    def kept(turned: float) -> float:
        """Probability of the stated direction after values in two holes of a drive whose offset is turned."""
        search = ErrorMap(drive, M_G)
        tried = [Trial(turn, search.extremes(rotated(drive, turn + turned)).first) for turn in truth]
        return float(np.isin(posterior_of(found, tried, [0.0]).places, stated).mean())

    assert kept(0.0) > 0.7
    assert kept(180.0) < 0.1


@pytest.mark.thorough
def test_what_the_preset_knows_of_the_offset_counts() -> None:
    """A direction that is known needs no trial to tell it; nor does a size."""
    facing = told("phases.phi_hb=20", "tolerances.e_hb=50", **{"phases.phi_hb": 10.0, "tolerances.e_hb": 4.0})
    known = hole_samples(facing, (), SETUP, **{**COARSE, "table": TableEffort(16, COARSE_MESH)})
    assert not known.weight[:, 1:].any()
    draws = posterior_of(known, [], [0.0])
    off = (direction_of(known)[draws.places] - 20 + 180) % 360 - 180
    assert abs(off.mean()) < 1
    assert off.std() == pytest.approx(5, rel=0.15)
    assert draws.offset[0].std() == pytest.approx(2, rel=0.15)


@pytest.mark.thorough
def test_known_fixed_ovality_does_not_turn_with_the_samples() -> None:
    oval = hole_samples(told("harmonics.a_s2=3", "harmonics.xi_s2=20"), (), SETUP, **COARSE)
    assert not oval.weight[:, 1:].any()
    assert np.ptp(direction_of(oval).reshape(oval.weight.shape)[:, 0]) > 300
    with_flexspline = told("harmonics.a_s2=3", "mounting.fixed=flexspline", "tolerances.e_hg=30", "tolerances.e_hb=0")
    turning = hole_samples(with_flexspline, (), SETUP, **COARSE).weight[:, 1:].all(axis=1)
    assert turning.mean() == 0.5  # of the others the direction is as stated


@pytest.mark.thorough
def test_with_the_flexspline_fixed_its_own_offset_is_found() -> None:
    drive = told("mounting.fixed=flexspline", "tolerances.e_hb=0", "tolerances.e_hg=30")
    truth = drive.with_values({"tolerances.e_hg": 45.0, "phases.phi_hg": 130.0})
    search = ErrorMap(truth, M_G)
    tried = [Trial(r, search.extremes(rotated(truth, r)).first) for r in POSITIONS[::2]]
    found = hole_samples(drive, (), SETUP, draws=FEW)
    off = (direction_of(found)[posterior_of(found, tried, [0.0]).places] - 130 + 180) % 360 - 180
    assert abs(off.mean()) < 2 * off.std() < 60


@pytest.mark.thorough
def test_a_free_angle_and_many_holes() -> None:
    for holes, directions, count in ((0, 36, 72), (3, 9, 3), (100, 36, 100)):
        drive = told(f"mounting.holes={holes}")
        found = hole_samples(drive, (), SETUP, **{**COARSE, "table": TableEffort(32, COARSE_MESH)})
        positions = usable_positions(holes, "all")
        assert found.weight.shape[1] == directions
        _, losses = learnt(found, [Trial(positions[-1], 20.0)], positions)
        assert len(losses.probability_good) == count


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["bearing.ball_motion=rolling", "bearing.d_ball=2"], "bearing.ball_motion: locked"),
        (["tolerances.e_hb=0"], "measured values require tolerances.e_hb, the size of the wave generator eccentricity"),
    ],
)
def test_drives_that_trials_cannot_take(overrides: list[str], words: str) -> None:
    with pytest.raises(UsageError, match=words):
        hole_samples(load_preset(SMALL, overrides), (), SETUP, draws=FEW)


def test_unknown_preset_inputs_are_uncertain_in_trials_too() -> None:
    paths = ["tolerances.e_hb", "tolerances.e_hh", "phases.phi_hb", "harmonics.a_s2"]
    drive = load_preset(SMALL, [f"{path}=unknown" for path in paths])
    found = {each.path: (each.low, each.high) for each in open_prior(drive).fields}
    assert {*paths, "harmonics.xi_s2"} == set(found)
    for path, high in (("tolerances.e_hb", 0.5 * 30), ("harmonics.xi_s2", 180)):
        assert found[path] == (0, pytest.approx(high))
    known = {each.path: (each.low, each.high) for each in open_prior(load_preset(SMALL)).fields}
    assert known["tolerances.e_hb"] == (0, 60)
