"""Extremes of draws, found by slopes, against every state of the cycle; slopes against differences of rotations."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from benchmarks.draws import FINEST_GRID, HOLES, drawn_drives
from benchmarks.rows import DRAWS_RMS, DRAWS_WORST
from hdassist import load_preset
from hdassist.drive.error import extremes
from hdassist.drive.error.error_map import Batch, ErrorMap, error_maps, every_state
from hdassist.drive.error.extremes import DRAWN_GRIDS, between_states, many_extremes
from hdassist.drive.loading import load_text, similar_preset
from hdassist.drive.model.contacts import StateGaps, contact_system
from hdassist.drive.preset.fields import DEVIATIONS
from hdassist.drive.preset.knowledge import read_requirements
from hdassist.drive.solve.answers import N_MM
from hdassist.drive.solve.formulation import formulate
from hdassist.drive.solve.walk import Torus
from hdassist.features.mounting.positions import rotated
from tests.helpers.process import SMALL
from tests.helpers.searched_drives import searched_drive
from tests.helpers.support import HAS_COMPILER, load_case

TURNS = (0.0, 90.0, 210.0)


@pytest.mark.parametrize("M_g", [1.0, 8.0])
@pytest.mark.parametrize("compiled", [False, True][: 1 + HAS_COMPILER])
def test_slopes_are_those_of_small_changes(compiled, M_g):
    system, rng = contact_system(load_preset(SMALL)), np.random.default_rng(4)
    engine = load_case(formulate(system), M_g * N_MM, many=True, compiled=compiled)
    scalars, step = rng.normal(0, 0.01, (70, 6)), 1e-7
    slope = engine.sums(StateGaps(scalars), slope=True).slope
    for column in range(6):
        more, less = (scalars + way * step * (np.arange(6) == column) for way in (1, -1))
        change = engine.sums(StateGaps(more)).rotation - engine.sums(StateGaps(less)).rotation
        off = np.abs(change / (2 * step) - slope[:, column]) / np.abs(slope).max()
        assert np.quantile(off, 0.9) < 1e-5, "beside the states whose contacts change just there"


@pytest.mark.thorough
@pytest.mark.parametrize(("kind", "seed"), [("heavy", 1), ("heavy", 3), ("light", 2)])
def test_few_states_find_what_every_state_shows(kind, seed):
    drive, M_g = searched_drive(kind, seed)
    error_map = ErrorMap(drive, M_g)
    found = many_extremes(error_map, Batch.turned(drive, TURNS), DRAWN_GRIDS)
    exact = np.array([error_map.extremes(rotated(drive, turn)).first for turn in TURNS])
    assert (found.F_ior_arcsec <= exact + 1e-6).all(), "states of the cycle: never too great"
    assert np.abs(found.F_ior_arcsec - exact).max() < 0.05
    assert np.ptp(exact) > 0.5
    assert found.certificate.states < len(TURNS) * 150
    assert 0 < found.certificate.max_residual < 1e-8


def _rough(drive, seed, f_p, e_hb):
    """Twelve drives whose teeth are off one by one by up to f_p [um], with a standing offset [um]."""
    pitch = [each for each in DEVIATIONS if each.kind == "pitch"]
    rng, drives = np.random.default_rng(seed), 12
    columns = {each.size: np.full(drives, f_p) for each in pitch}
    columns |= {"tolerances.e_hb": np.full(drives, e_hb), "phases.xi_b": rng.uniform(0, 360, drives)}
    return Batch(drive, columns | {each.direction: rng.uniform(0, 60, drives) for each in pitch})


def _of_every_state(some, M_g):
    one_by_one = [{path: float(of[k]) for path, of in some.columns.items()} for k in range(len(some))]
    return [every_state(some.drive.with_values(values), M_g).first for values in one_by_one]


@pytest.mark.thorough
def test_rough_teeth_are_found_between_the_positions_of_a_grid():
    """Nine positions of a wheel do not show orders 6 to 16: without their slopes up to 16 % of F'_ior were missed."""
    drive = load_preset("size-25-100", ["operation.M_g=6.7"])
    some = _rough(drive, 3, 10.0, 20.0).take(np.array([6, 10, 11]))
    found = many_extremes(ErrorMap(drive, 6.7), some, DRAWN_GRIDS).F_ior_arcsec
    assert found == pytest.approx(_of_every_state(some, 6.7), rel=0.005)


def test_search_resolves_rough_teeth_of_order_16():
    """With their slopes read a whole tooth off 3 to 4 % were missed, and of one drive no hill was left to climb."""
    like = load_preset("vzp160")
    asked = read_requirements(like, ratio=50, pitch_diameter="63.5 mm", torque="67")
    drive = load_text(similar_preset("own", like, asked), "own.yaml")
    some, error_map = _rough(drive, 4, 20.0, 20.0).take(np.array([1, 5, 6])), ErrorMap(drive, 6.7)
    found = many_extremes(error_map, some, DRAWN_GRIDS).F_ior_arcsec
    assert found == pytest.approx(_of_every_state(some, 6.7), rel=0.005)


def test_search_keeps_a_hill_if_splines_stay_below_the_grid(monkeypatch):
    """Of many thousand draws some ended with no hill of one sign, and the search with a ValueError."""
    drive, M_g = searched_drive("heavy", 1)
    error_map, batch, proposed = ErrorMap(drive, M_g), Batch.of(drive), extremes._Search._proposed

    def too_low(search, n):
        hills, known = proposed(search, n)
        return replace(hills, height=np.where(hills.sign < 0, hills.height - 1e3, hills.height)), known

    usual = many_extremes(error_map, batch, DRAWN_GRIDS).first
    monkeypatch.setattr(extremes._Search, "_proposed", too_low)
    assert many_extremes(error_map, batch, DRAWN_GRIDS).first == pytest.approx(usual, rel=1e-3)


def test_its_states_are_the_extremes():
    drive, M_g = searched_drive("heavy", 1)
    error_map = ErrorMap(drive, M_g)
    found = many_extremes(error_map, Batch.of(drive), DRAWN_GRIDS)
    states = error_map.states.take(np.array([found.at_max[0], found.at_min[0]]))
    gaps = StateGaps(Batch.of(drive).scalars(np.zeros(2, dtype=int), states.alpha_g, states.alpha_b))
    rotation = error_map.load_case().solve(gaps, str).rotation_arcsec
    assert error_map.sign * (rotation[0] - rotation[1]) == pytest.approx(found.first, abs=1e-9)


@pytest.mark.skipif(not HAS_COMPILER, reason="no C compiler: the numpy engine runs")
def test_climbs_without_a_compiler_come_to_the_same_states(monkeypatch):
    small = load_preset(SMALL)
    monkeypatch.setattr(extremes, "SHORT_CYCLE", 0)
    batch = Batch(small, {"tolerances.e_hb": np.array([20.0, 60.0]), "phases.phi_hb": np.array([10.0, 200.0])})
    error_map = ErrorMap(small, 4.0)
    compiled = many_extremes(error_map, batch, DRAWN_GRIDS)
    plain = partial(load_case, error_map.fresh.formulation, 4.0 * N_MM, error_map.fresh, many=True, compiled=False)
    monkeypatch.setattr(error_map, "load_case", plain)
    found = many_extremes(error_map, batch, DRAWN_GRIDS)
    assert found.F_ior_arcsec == pytest.approx(compiled.F_ior_arcsec, abs=1e-6)
    drives = [small.with_values({path: float(of[i]) for path, of in batch.columns.items()}) for i in (0, 1)]
    exact = [error_map.extremes(drive).first for drive in drives]
    assert found.F_ior_arcsec == pytest.approx(exact, abs=0.05)


def test_scalars_are_sums_over_the_wheels():
    drive, _ = searched_drive("any", 5, ["harmonics.a_g2=2", "harmonics.xi_g2=30"])
    error_map, batch = ErrorMap(drive, 100.0), Batch.turned(drive, TURNS)
    z_b, z_g = error_map.board.shape
    states = error_map.states
    torus = Torus(*batch.by_wheel(states.alpha_b[:z_b], states.alpha_g[:z_g]), error_map.finest)
    row, j = np.array([0, 1, 2]), np.array([7, 1234, 9000])
    point = np.stack([j % z_b, j % z_g], axis=1)
    some = states.take(j)
    assert torus.scalars(row, point) == pytest.approx(batch.scalars(row, some.alpha_g, some.alpha_b), abs=1e-12)


def test_what_may_lie_between_states_holds_a_smooth_map():
    n, x = 9, 2 * np.pi * np.arange(9) / 9
    value = np.add.outer(np.sin(x), np.cos(x))[None]
    by_b, by_g = np.add.outer(np.cos(x), 0 * x)[None], np.add.outer(0 * x, -np.sin(x))[None]
    up, down = between_states(value, by_b * x[1], by_g * x[1])
    fine = 2 * np.pi * np.arange(n * extremes.SPLINE_POINTS) / (n * extremes.SPLINE_POINTS)
    there = np.add.outer(np.sin(fine), np.cos(fine))
    assert (up[0] >= there - 0.01).all()
    assert (down[0] <= there + 0.01).all()
    assert np.abs(up - down).max() < 0.3


@pytest.mark.thorough
@pytest.mark.skipif(not HAS_COMPILER, reason="half a minute in numpy")
def test_search_of_samples_agrees_with_a_grid_of_sixty():
    drives, holes = drawn_drives("vzp160", 1), [360 / HOLES * k for k in range(HOLES)]  # docs/performance.md has 64
    maps = [(each, Batch.turned(drive, holes)) for drive in drives for each in error_maps(drive, drive.operation.M_g)]
    few, fine = (
        np.array([many_extremes(*found, grids).F_ior_arcsec for found in maps]) for grids in (DRAWN_GRIDS, FINEST_GRID)
    )
    missed = few - fine
    assert np.abs(missed).max() <= DRAWS_WORST
    assert np.sqrt((missed**2).mean()) <= DRAWS_RMS
