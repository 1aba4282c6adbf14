"""Random drives: as built and in their best position, against searches of every position."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace

import numpy as np
import pytest

from hdassist import Drive, load_preset
from hdassist.error.error_map import ErrorMap
from hdassist.errors import UsageError
from hdassist.mounting.positions import merit, rotated
from hdassist.tolerance.production import Production, RandomDrive
from hdassist.tolerance.scatter import Draws, scatters
from hdassist.tolerance.summary import Summary
from tests.process import SMALL

TORQUES = (1.0, 4.0)
COUNT = 6


@pytest.fixture(scope="module")
def small() -> Drive:
    return load_preset(SMALL)


@pytest.fixture(scope="module")
def production(small: Drive) -> Production:
    return Production.of(small, Draws(scatters(small), 1), TORQUES).tabled()


@pytest.fixture(scope="module")
def records(production: Production) -> list[RandomDrive]:
    return production.records(0, COUNT)


def searched(small: Drive, record: RandomDrive, rotations: tuple[float, ...]) -> np.ndarray:
    drive = small.with_values(record.values)
    searches = [ErrorMap(drive, M_g) for M_g in TORQUES]
    return np.array([[s.extremes(rotated(drive, r)).first for r in rotations] for s in searches])


def test_as_built_and_best_are_what_searches_of_all_positions_find(
    small: Drive, production: Production, records: list[RandomDrive]
) -> None:
    for record in records:
        F_ior = searched(small, record, production.rotations)
        best = production.rotations.index(record.best_rotation_deg)
        assert record.F_ior_arcsec == pytest.approx(F_ior[:, 0], abs=0.01)
        assert record.best_F_ior_arcsec == pytest.approx(F_ior[:, best], abs=0.01)
        now = merit(F_ior, F_ior[:, 0])
        assert now[best] <= now.min() + 1e-3
        assert record.max_residual < 1e-8
    assert len({record.best_rotation_deg for record in records}) > 2


def test_a_drive_is_the_same_in_any_chunk(production: Production, records: list[RandomDrive]) -> None:
    assert production.records(2, 5) == records[2:5]
    with ThreadPoolExecutor(1) as executor:
        again = Production.of(production.drive, production.draws, TORQUES).tabled(executor=executor)
    assert again.records(4, 5) == records[4:5]


def test_limits_decide_which_position_is_the_best(small: Drive, production: Production) -> None:
    limited = Production.of(small, production.draws, TORQUES, limits=(1000.0, 0.5)).tabled()
    F_ior = searched(small, record := limited.records(0, 1)[0], limited.rotations)
    assert record.best_rotation_deg == limited.rotations[int(F_ior[1].argmin())]


def test_without_turning_the_best_is_what_was_built(
    small: Drive, production: Production, records: list[RandomDrive]
) -> None:
    fixed = Production.of(small, production.draws, TORQUES, mounting=False).tabled().records(0, 2)
    for one, other in zip(fixed, records, strict=False):
        assert one.best_F_ior_arcsec == one.F_ior_arcsec
        assert one.F_ior_arcsec == pytest.approx(other.F_ior_arcsec, abs=1e-6)


def test_stiffnesses_scatter_by_their_own_uncertainty() -> None:
    drive = load_preset(SMALL, ["contact.c_t=6e-5 ± 1e-5", "operation.M_g=4"])
    production = Production.of(drive, Draws(scatters(drive, "fixed"), 1), (4.0,), mounting=False).tabled()
    for record in production.records(0, 3):
        moved = drive.with_values(record.values)
        assert record.F_ior_arcsec[0] == pytest.approx(ErrorMap(moved, 4.0).extremes(moved).first, abs=0.01)
    assert len({record.values["contact.c_t"] for record in production.records(0, 3)}) == 3


def test_a_drive_that_cannot_be_is_kept_with_the_reason() -> None:
    drive = load_preset(SMALL, ["cam.W_0=0.58 ± 0.57", "operation.M_g=4"])
    found = Production.of(drive, Draws(scatters(drive), 2), (4.0,), mounting=False).tabled().records(0, 6)
    refused = [record for record in found if record.refused is not None]
    assert refused
    assert all(record.refused and record.values for record in refused)
    summary = Summary.of((4.0,), [1000.0], [0.0], positions=1)
    summary.add(found)
    assert (summary.refused, summary.count) == (len(refused), 6 - len(refused))
    assert summary.yield_as_built.bounds[0] < summary.count / 6


def test_quantiles_of_one_tolerance_are_those_of_its_distribution() -> None:
    fixed = ["tolerances.F_i2=0", "tolerances.e_hh=0", "tolerances.F_i1=0", "operation.M_g=4"]
    drive = load_preset(SMALL, [*fixed, "numerics.n_max=20", "numerics.n_2=40"])
    draws = Draws(scatters(drive, "uniform", known=["phases.phi_hb"]), 0, "sobol")
    assert [s.path for s in draws.scatters] == ["tolerances.e_hb"]
    production = Production.of(drive, draws, (4.0,), mounting=False).tabled()
    summary = Summary.of((4.0,), [None], [0.0], positions=1)
    summary.add(production.records(0, 64))
    search = ErrorMap(drive, 4.0)
    sizes = np.linspace(0, 30, 31)
    F_ior = [search.extremes(drive.with_values({"tolerances.e_hb": float(s)})).first for s in sizes]
    assert np.all(np.diff(F_ior[1:]) > 0), "a quantile of the error is the error of a quantile"
    for share in (0.25, 0.5, 0.75):
        expected = np.interp(30 * share, sizes, F_ior)
        assert summary.points[0].as_built.quantile(share) == pytest.approx(expected, rel=0.02, abs=0.02)


def test_rolling_balls_are_refused(small: Drive) -> None:
    rolling = load_preset(SMALL, ["bearing.ball_motion=rolling", "bearing.d_ball=4"])
    with pytest.raises(UsageError, match="rolling balls"):
        Production.of(rolling, Draws(scatters(rolling), 0), TORQUES)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"values": {}}, "values: expected tolerances.F_i1"),
        ({"F_ior_arcsec": (3.0,)}, "F_ior_arcsec: expected 2 values, proven by states"),
        ({"best_F_ior_arcsec": ()}, "F_ior_arcsec: expected 2 values, proven by states"),
        ({"states": 0}, "F_ior_arcsec: expected 2 values, proven by states"),
        ({"refused": "no"}, "F_ior_arcsec: expected 0 values, proven by states"),
        ({"best_rotation_deg": 7.0}, "best_rotation_deg: expected a position of the seat"),
        ({"best_F_ior_arcsec": (1e3, 1e3)}, "best_F_ior_arcsec: expected no worse than F_ior_arcsec"),
        ({"F_ior_arcsec": (0.1, 0.1)}, "best_F_ior_arcsec: expected no worse than F_ior_arcsec"),
        ({"best_rotation_deg": 0.0}, "best_F_ior_arcsec: expected no worse than F_ior_arcsec"),
    ],
)
def test_a_record_that_cannot_be_is_refused(
    production: Production, records: list[RandomDrive], change: dict, why: str
) -> None:
    assert [production.kind.fault(k, record) for k, record in enumerate(records)] == [""] * len(records)
    turned = next(record for record in records if record.best_rotation_deg)
    assert production.kind.fault(0, replace(turned, **change)).startswith(why)
    beyond = replace(turned, values={**turned.values, "phases.xi_b": 361.0})
    assert production.kind.fault(0, beyond) == "values.phases.xi_b: expected 0 to 360, as it is drawn"
    adapter = production.kind.adapter
    for wrong in ({"F_ior_arcsec": (0.0, 1.0)}, {"max_residual": 0.9}, {"states": 1.5}, {"refused": 3}):
        with pytest.raises(ValueError, match="Input should be"):
            adapter.validate_python({**asdict(turned), **wrong})
