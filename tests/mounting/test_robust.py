"""Samples of what a preset does not know: by table against searches of each, and what is made of them."""

from dataclasses import replace
from inspect import signature

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.comparing.sheet import POSITION_SAMPLES
from hdassist.error.error_map import ErrorMap
from hdassist.explorer.questions import Effort
from hdassist.model.unknown import listed
from hdassist.mounting.advice import advise
from hdassist.mounting.cloud import MESH, any_direction, cloud_of, directions_of
from hdassist.mounting.command import command
from hdassist.mounting.curve import mounting_curve
from hdassist.mounting.losses import Criterion, Losses
from hdassist.mounting.losses_page import kept_line
from hdassist.mounting.positions import MountingCurve, rotated, seat_positions
from hdassist.mounting.robust import interpolates, robust
from hdassist.preset.fields import Drive
from tests.process import SMALL

LOOSE = {"phases.xi_b": 30.0, "tolerances.e_hb": 8.0}


def uncertain(*overrides: str, **more: float) -> Drive:
    drive = load_preset(SMALL, ["mounting.holes=6", "operation.M_g=4", *overrides])
    return drive.model_copy(update={"uncertainty": more or LOOSE})


def curve_of(drive: Drive) -> MountingCurve:
    return mounting_curve(drive, (4.0,), seat_positions(drive), cross_check=None)


@pytest.fixture(scope="module")
def by_table() -> tuple[Drive, MountingCurve, Losses]:
    drive = uncertain()
    curve = curve_of(drive)
    return drive, curve, robust(drive, curve, samples=64)


def require_searched(drive: Drive, found: Losses, open_: dict[str, tuple[float, float]], some: slice) -> None:
    """F'_ior of samples is what searches find of their drives, within the standard error that is told."""
    cloud, search = cloud_of(drive, (4.0,), open_, 64), ErrorMap(drive, 4.0)
    samples = listed(drive, {path: of[:, 0] for path, of in cloud.values.items()}, 64)[some]
    exact = np.array([
        [search.extremes(rotated(sample, r)).first for r in found.rotations_deg] for sample in samples
    ])  # fmt: skip
    missed = found.F_ior_arcsec[0, some] - exact
    told = found.standard_error_arcsec[0]
    assert told < 0.03 * exact.mean()
    assert np.sqrt(np.mean(missed**2)) < 2 * told  # which is known from eight searches


def test_samples_by_table_agree_with_searches_of_their_drives(by_table: tuple[Drive, MountingCurve, Losses]) -> None:
    drive, curve, found = by_table
    require_searched(drive, found, dict.fromkeys(LOOSE, (0.0, 0.0)), slice(0, 64, 6))
    assert found.now_arcsec[0] == pytest.approx(found.F_ior_arcsec[0, :, 0])
    assert found.certificate.max_residual <= 1e-8
    # turned by a phase error, the wheel sees its own curve shifted: the middle sample is the curve itself
    assert np.median(found.F_ior_arcsec, axis=1) == pytest.approx(curve.F_ior_arcsec, rel=0.15)


def test_an_ovality_in_any_direction_is_sampled_too() -> None:
    drive = uncertain("harmonics.a_b2=1", "harmonics.xi_b2=unknown", **{"phases.phi_hb": 20.0})
    found = robust(drive, curve_of(drive), samples=64)
    open_ = {"harmonics.xi_b2": (0.0, 180.0), "phases.phi_hb": (0.0, 0.0)}
    require_searched(drive, found, open_, slice(0, 64, 8))


def test_few_samples_and_fields_other_than_deviations_are_searched(
    by_table: tuple[Drive, MountingCurve, Losses],
) -> None:
    drive, curve, many = by_table
    assert interpolates(drive, 64, 7)
    assert not interpolates(drive, 1, 7)
    few = robust(drive, curve, samples=1)
    assert (few.F_ior_arcsec.shape, few.standard_error_arcsec) == ((1, 1, 6), ())
    assert few.certificate.max_residual <= 1e-8
    assert few.rotations_deg[few.best] == many.rotations_deg[many.best]
    assert not interpolates(uncertain(**{"phases.xi_b": 30.0, "gears.j_n": 1.0}), 1000, 13)


def test_both_torques_are_asked_for(by_table: tuple[Drive, MountingCurve, Losses]) -> None:
    drive, curve, found = by_table
    both = replace(curve, torques=(1.0, 4.0))
    assert robust(drive, both, samples=64).F_ior_arcsec[1] == pytest.approx(found.F_ior_arcsec[0])


def test_a_direction_counts_in_every_sector_where_nothing_is_known_of_it() -> None:
    turn, open_ = "phases.phi_hb", {"phases.phi_hb": (0.0, 360.0)}
    drive = load_preset(SMALL, ["harmonics.a_s2=0"])
    assert any_direction(drive, open_)
    assert not any_direction(drive, {"tolerances.e_hb": (0.0, 60.0)})
    assert not any_direction(drive.model_copy(update={"uncertainty": {turn: 10.0}}), open_)
    for oval, turns in (("3", False), ("0", True)):
        assert any_direction(load_preset(SMALL, [f"harmonics.a_s2={oval}", "harmonics.xi_s2=20"]), open_) == turns
    assert any_direction(load_preset(SMALL, ["harmonics.a_s2=3", "harmonics.xi_s2=unknown"]), open_)
    assert [directions_of(drive.with_values({"mounting.holes": n})) for n in (0, 3, 12, 36, 100)] == [36, 9, 12, 36, 36]
    cloud = cloud_of(drive, (4.0,), open_, 16, mesh=replace(MESH, shape=(9, 5, 5, 5), compared=0))
    sectors = np.floor(cloud.values[turn] / 30).astype(int)
    assert np.array_equal(sectors, np.broadcast_to(np.arange(12), sectors.shape))
    assert len(cloud.possible) == cloud.weight.size


def test_every_way_to_a_mounting_takes_as_many_samples() -> None:
    taken = {signature(way).parameters["samples"].default for way in (command, advise, robust)}
    assert taken == {POSITION_SAMPLES} == {Effort().samples}


def test_how_sure_a_limit_is_kept_takes_in_what_the_table_misses() -> None:
    drive = load_preset(SMALL, ["operation.M_g=4", "acceptance.F_ior=20"])
    drawn = np.array([17.0, 19.0, 21.0, 23.0])
    losses = Losses((0.0, 30.0), np.stack([drawn, drawn + 9], axis=-1)[None], drawn[None], Criterion.of("expected"))
    assert kept_line(losses, drive, [4.0]).startswith("50% sure that hole 0 (0 deg) at 4 N·m stays below 20 arcsec")
    rng = np.random.default_rng(0)
    share = np.mean(rng.choice(drawn - 2, 200_000) + 0.7 * rng.standard_normal(200_000) < 20)
    less = replace(losses, F_ior_arcsec=losses.F_ior_arcsec - 2)
    assert abs(float(kept_line(less, drive, [4.0], [0.7]).split("%")[0]) / 100 - share) < 0.008
    assert kept_line(losses, drive, [4.0], [2.0]) == ""  # too coarse to tell
    assert kept_line(losses, load_preset(SMALL, ["operation.M_g=4"]), [4.0]) == ""
