"""The error as a table over the deviations, against searches of drives it has not seen."""

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.error.error_map import DEVIATION_SCALARS, ErrorMap, ErrorTable, Mesh, Reach, error_table
from hdassist.drive.model.contacts import contact_system
from hdassist.drive.preset.fields import DEVIATION_FIELDS, DEVIATIONS, Drive
from hdassist.drive.solve import walk
from hdassist.drive.solve.answers import EMPTY
from hdassist.drive.solve.walk import read_table
from hdassist.run.errors import UntrustedError
from tests.helpers.process import SMALL
from tests.helpers.support import HAS_COMPILER, rotation


@pytest.fixture(scope="module")
def small() -> Drive:
    return load_preset(SMALL)


def drawn(drive: Drive, count: int, seed: int) -> list[Drive]:
    rng = np.random.default_rng(seed)
    return [
        drive.with_values(
            {
                "tolerances.e_hb": float(rng.uniform(0, 60)),
                "tolerances.e_hh": float(rng.uniform(0, 10)),
                "tolerances.F_i2": float(rng.uniform(20, 40)),
                "phases.phi_hb": float(rng.uniform(0, 360)),
                "phases.phi_hh": float(rng.uniform(0, 360)),
            }
        )
        for _ in range(count)
    ]


OUTERMOST = {"tolerances.e_hb": 60.0, "tolerances.e_hh": 10.0}  # so that no drive drawn leaves the table
OVAL = {"harmonics.a_b2": 1.0, "harmonics.a_g2": 1.0, "tolerances.e_b": 2.0}
FINE = Mesh((25, 9, 25, 25), 40)


def table_of(drive: Drive, M_g: float = 4.0, mesh: Mesh = FINE) -> ErrorTable:
    return error_table(ErrorMap(drive, M_g), Reach.of(drive), mesh)


@pytest.fixture(scope="module")
def table(small: Drive) -> ErrorTable:
    return table_of(small.with_values(OUTERMOST))


def columns_of(drives: list[Drive]) -> dict[str, np.ndarray]:
    """Sizes and directions of drives by path."""
    return {path: np.array([drive.number(path) for drive in drives]) for path in DEVIATION_FIELDS}


def missed_of(table: ErrorTable, drives: list[Drive]) -> np.ndarray:
    """What a table misses of the exact F'_ior of drives, as a share."""
    search = ErrorMap(drives[0], 4.0)
    return np.array([search.extremes(drive).first for drive in drives]) / table.F_ior(columns_of(drives)) - 1


@pytest.mark.thorough
def test_table_agrees_with_a_search_within_a_constant_share(small: Drive, table: ErrorTable) -> None:
    missed = missed_of(table, drawn(small, 40, 2))
    assert 0 < missed.mean() < 0.03
    assert missed.std() < 0.03


def test_its_points_are_states_solved(small: Drive, table: ErrorTable) -> None:
    system = contact_system(small)
    middle = np.array(table.error.shape) // 2
    for place in (middle + np.array(step) for step in ((0, 0, 0, 0), (3, -1, 2, -4), (-5, 2, 6, 1))):
        scalars = (place - middle) / middle * table.reach.sizes
        assert table.error[tuple(place)] == pytest.approx(rotation(system, 4e3, scalars), abs=1e-7)


def test_harmonics_and_a_run_out_are_slopes(small: Drive, table: ErrorTable) -> None:
    rng, phases = np.random.default_rng(4), ("harmonics.xi_b2", "harmonics.xi_g2", "phases.phi_eb")
    drives = [
        d.with_values(
            {path: float(rng.uniform(0, most)) for path, most in OVAL.items()}
            | {path: float(rng.uniform(0, 360)) for path in phases}
        )
        for d in drawn(small, 15, 2)
    ]
    wide = table_of(small.with_values(OUTERMOST | OVAL))
    assert wide.reach.other_columns == (4, 5, 6, 7)
    missed = missed_of(wide, drives)
    plain = columns_of([d.with_values(dict.fromkeys(OVAL, 0.0)) for d in drives])
    without = wide.F_ior(plain) / wide.F_ior(columns_of(drives)) - 1
    assert missed.std() < 0.03 < 0.25 * without.std()
    with pytest.raises(UntrustedError, match="exceed the range of the table"):
        table.F_ior(columns_of(drives))


def test_rough_teeth_lie_on_top_of_a_coarse_table(
    small: Drive, table: ErrorTable, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(6)
    pitch = [each for each in DEVIATIONS if each.kind == "pitch"]
    drives = [
        d.with_values({each.size: 10.0 for each in pitch} | {each.direction: rng.uniform(0, 60) for each in pitch})
        for d in drawn(small, 15, 2)
    ]
    coarse = table_of(small.with_values(OUTERMOST | {each.size: 10.0 for each in pitch}), mesh=Mesh((9, 5, 9, 9), 12))
    missed = missed_of(coarse, drives)
    assert 0 < missed.mean() < 0.1
    assert missed.std() < 0.06
    monkeypatch.setattr("hdassist.drive.error.error_map.SMOOTH_SCALARS", DEVIATION_SCALARS)
    at_its_positions = missed_of(coarse, drives)
    assert missed.mean() < 0.6 * at_its_positions.mean()
    monkeypatch.undo()
    with pytest.raises(UntrustedError, match="exceed the range of the table"):
        table.F_ior(columns_of(drives))


def test_all_deviations_reversed_are_half_a_turn(table: ErrorTable) -> None:
    error = table.error.ravel()
    assert np.array_equal(error, error[::-1], equal_nan=True)  # half of them are copies


def test_untrusted_state_is_named_by_its_deviations(small: Drive) -> None:
    far = small.with_values({"tolerances.F_i2": 100.0, "tolerances.e_hb": 50.0})
    with pytest.raises(
        UntrustedError, match=r"at tooth vector \(-?\d+, -?\d+\) um, cam vector .* um, M_g = 1e\+06 N\*m"
    ):
        table_of(far, 1e6, Mesh((3, 3, 3, 3)))


def test_table_interpolates_linearly_and_uses_slopes_for_other_deviations() -> None:
    sizes, weights = np.array([0.04, 0.04, 0.06, 0.06]), np.array([100.0, -200.0, 300.0, 400.0])
    grid = np.stack(np.meshgrid(*(np.linspace(-size, size, 3) for size in sizes), indexing="ij"), axis=-1)
    reach = Reach((0, 1, 2, 3), sizes, (4, 5))
    slopes = np.stack([np.full((3, 3, 3, 3), slope) for slope in (*weights, 50.0, -70.0)])
    made = ErrorTable(load_preset(SMALL), grid @ weights, slopes, reach, 5, EMPTY)
    at = np.array([[0.01, -0.03, 0.02, 0.05], [0.0, 0.04, 0.0, -0.06]])
    off = np.array([[0.0, 0.002], [0.003, 0.001]])
    assert made.rotation(at) == pytest.approx(at @ weights)
    assert made.rotation(np.hstack([at, off])) == pytest.approx(at @ weights + off @ [50.0, -70.0])


def test_between_its_points_a_parabola_is_exact() -> None:
    sizes, bend = np.array([0.04, 0.04, 0.06, 0.06]), np.array([3e4, -2e4, 1e4, 5e3])
    grid = np.stack(np.meshgrid(*(np.linspace(-size, size, 3) for size in sizes), indexing="ij"), axis=-1)
    slopes = np.moveaxis(2 * bend * grid, -1, 0)
    made = ErrorTable(load_preset(SMALL), grid**2 @ bend, slopes, Reach((0, 1, 2, 3), sizes, ()), 5, EMPTY)
    at = np.array([[0.01, -0.03, 0.02, 0.05], [0.0, 0.04, 0.0, -0.06], [0.033, 0.0, 0.0, 0.011]])
    assert made.rotation(at) == pytest.approx(at**2 @ bend)


@pytest.mark.skipif(not HAS_COMPILER, reason="no C compiler: numpy reads")
def test_tables_are_read_alike_with_and_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    rng, shape = np.random.default_rng(1), (5, 3, 4, 2)
    table, factors = rng.normal(size=(*shape, 3)), rng.normal(size=(40, 2))
    places = rng.uniform(0, 1, (40, 4)) * (np.array(shape) - 1)
    places[0], places[1], places[2, 3] = 0, np.array(shape) - 1, 1.01
    compiled = read_table(table, places, factors)
    monkeypatch.setattr(walk, "walk_library", lambda: (None, ""))
    assert read_table(table, places, factors) == pytest.approx(compiled, nan_ok=True)
    assert np.flatnonzero(np.isnan(compiled)).tolist() == [2]


def test_outside_its_reach_it_knows_nothing(small: Drive, table: ErrorTable) -> None:
    with pytest.raises(UntrustedError, match="exceed the range of the table"):
        table.F_ior({"tolerances.e_hb": np.array([120.0])})
