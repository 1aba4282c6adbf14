"""The error as a table over the deviations, against searches of drives it has not seen."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.error.error_map import ErrorMap
from hdassist.error.table import KNOWN, ErrorTable, Mesh, Reach, error_tables, turns
from hdassist.errors import UntrustedError
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import deviation_scalars
from hdassist.preset.fields import Drive
from hdassist.solve.answers import EMPTY
from tests.process import SMALL
from tests.support import rotation


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


@pytest.fixture(scope="module")
def table(small: Drive) -> ErrorTable:
    # the outermost drive, so that none of the others leaves the table
    outermost = small.with_values({"tolerances.e_hb": 60.0, "tolerances.e_hh": 10.0})
    return error_tables([(small, [*drawn(small, KNOWN - 1, 1), outermost])], (4.0,))[0][0]


def test_finds_what_a_search_finds_on_drives_it_has_not_seen(small: Drive, table: ErrorTable) -> None:
    drives = drawn(small, 40, 2)
    found = table.F_ior(np.array([deviation_scalars(d, *turns()) for d in drives]))
    search = ErrorMap(small, 4.0)
    missed = found - [search.extremes(d).first for d in drives]
    assert table.standard_error < 0.03 * np.mean(found)
    assert np.sqrt(np.mean(missed**2)) < 1.5 * table.standard_error
    assert np.abs(missed).max() < 5 * table.standard_error


def test_its_points_are_states_solved(small: Drive, table: ErrorTable) -> None:
    system = contact_system(small)
    middle = np.array(table.error.shape) // 2
    for place in (middle + np.array(step) for step in ((0, 0, 0, 0), (3, -1, 2, -4), (-5, 2, 6, 1))):
        scalars = (place - middle) / middle * table.reach.sizes
        assert table.error[tuple(place)] == pytest.approx(rotation(system, 4e3, scalars), abs=1e-7)


def test_harmonics_and_a_run_out_are_slopes_whose_error_is_measured(small: Drive, table: ErrorTable) -> None:
    def oval(drives: list[Drive], seed: int) -> list[Drive]:
        rng = np.random.default_rng(seed)
        names = ("harmonics.a_b2", "harmonics.a_g2", "tolerances.e_b")
        phases = ("harmonics.xi_b2", "harmonics.xi_g2", "phases.phi_eb")
        most = (1.0, 1.0, 2.0)
        return [
            d.with_values(
                {n: float(rng.uniform(0, m)) for n, m in zip(names, most, strict=True)}
                | {n: float(rng.uniform(0, 360)) for n in phases}
            )
            for d in drives
        ]

    span = oval(drawn(small, KNOWN, 1), 3)
    outermost = {"tolerances.e_hb": 60.0, "tolerances.e_hh": 10.0, "harmonics.a_b2": 1.0, "harmonics.a_g2": 1.0}
    span[-1] = span[-1].with_values(outermost | {"tolerances.e_b": 2.0})
    wide = error_tables([(small, span)], (4.0,))[0][0]
    assert wide.reach.others == (4, 5, 6, 7)
    drives = oval(drawn(small, 15, 2), 4)
    search = ErrorMap(small, 4.0)
    exact = np.array([search.extremes(d).first for d in drives])
    missed = [wide.F_ior(deviation_scalars(d, *turns())) for d in drives] - exact
    plain = [d.with_values({"harmonics.a_b2": 0.0, "harmonics.a_g2": 0.0, "tolerances.e_b": 0.0}) for d in drives]
    without = [table.F_ior(deviation_scalars(d, *turns())) for d in plain] - exact
    assert np.abs(missed).max() < 5 * wide.standard_error
    assert np.sqrt(np.mean(missed**2)) < 1.5 * wide.standard_error < 0.25 * np.std(without)
    with pytest.raises(UntrustedError, match="beyond"):
        table.F_ior(deviation_scalars(drives[0], *turns()))


def test_all_deviations_reversed_are_half_a_turn(table: ErrorTable) -> None:
    error = table.error.ravel()
    assert np.array_equal(error, error[::-1], equal_nan=True)


def test_the_same_digits_from_any_number_of_workers(small: Drive, table: ErrorTable) -> None:
    outermost = small.with_values({"tolerances.e_hb": 60.0, "tolerances.e_hh": 10.0})
    told: list[int] = []
    with ThreadPoolExecutor(2) as executor:
        span = [*drawn(small, KNOWN - 1, 1), outermost]
        again = error_tables([(small, span)], (4.0,), executor=executor, progress=told.append)[0][0]
    assert np.array_equal(again.error, table.error, equal_nan=True)
    assert again.standard_error == table.standard_error
    assert sum(told) == again.certificate.states


def test_a_state_that_cannot_be_trusted_is_named_by_its_deviations(small: Drive) -> None:
    far = small.with_values({"tolerances.F_i2": 100.0, "tolerances.e_hb": 50.0})
    coarse = Mesh((3, 3, 3, 3), compared=0)
    with pytest.raises(
        UntrustedError, match=r"at tooth vector \(-?\d+, -?\d+\) um, cam vector .* um, M_g = 1e\+06 N\*m"
    ):
        error_tables([(small, [far])], (1e6,), mesh=coarse)


def test_between_its_points_it_is_straight_and_others_count_by_their_slopes() -> None:
    sizes, weights = np.array([0.04, 0.04, 0.06, 0.06]), np.array([100.0, -200.0, 300.0, 400.0])
    grid = np.stack(np.meshgrid(*(np.linspace(-size, size, 3) for size in sizes), indexing="ij"), axis=-1)
    reach = Reach((0, 1, 2, 3), sizes, (4, 5), np.array([0.01, 0.01]))
    slopes = np.stack([np.full((3, 3, 3, 3), slope) for slope in (50.0, -70.0)])
    made = ErrorTable(4.0, grid @ weights, slopes, reach, EMPTY)
    at = np.array([[0.01, -0.03, 0.02, 0.05], [0.0, 0.04, 0.0, -0.06]])
    off = np.array([[0.0, 0.002], [0.003, 0.001]])
    assert made.rotation(at) == pytest.approx(at @ weights)
    assert made.rotation(np.hstack([at, off])) == pytest.approx(at @ weights + off @ [50.0, -70.0])


def test_outside_its_reach_it_knows_nothing(small: Drive, table: ErrorTable) -> None:
    far = small.with_values({"tolerances.e_hb": 120.0})
    with pytest.raises(UntrustedError, match="beyond"):
        table.F_ior(deviation_scalars(far, *turns()))
