"""Random drives: as built and in their best position, against searches of every position."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace

import numpy as np
import pytest

from hdassist import Drive, load_preset
from hdassist.drive.error.error_map import ErrorMap
from hdassist.features.mounting.positions import merit, rotated
from hdassist.features.tolerance.production import TIGHTER_STEP, Production, RandomDrive, production_law
from hdassist.run.errors import UntrustedError, UsageError
from hdassist.run.run import Run
from tests.helpers.process import ASSUMED, SMALL, TINY

TORQUES = (1.0, 4.0)
COUNT = 5
SOFT = "source.supports.C_3={kind: assumed, range: [500, 8000], ref: judged}"


@pytest.fixture(scope="module")
def small() -> Drive:
    return load_preset(SMALL)


def with_designs(production: Production, drives: int = COUNT) -> Production:
    return production.with_designs(drives)[0]


@pytest.fixture(scope="module")
def production(small: Drive) -> Production:
    return with_designs(Production(production_law(small), TORQUES, seed=1, steps=True))


@pytest.fixture(scope="module")
def records(production: Production) -> list[RandomDrive]:
    return production.records(0, COUNT)


def searched(small: Drive, record: RandomDrive, rotations: tuple[float, ...]) -> np.ndarray:
    drive = small.with_values(record.values)
    searches = [ErrorMap(drive, M_g) for M_g in TORQUES]
    return np.array([[s.extremes(rotated(drive, r)).first for r in rotations] for s in searches])


@pytest.mark.thorough
def test_assembled_and_best_errors_agree_with_searches_of_all_positions(
    small: Drive, production: Production, records: list[RandomDrive]
) -> None:
    for record in records[:3]:
        F_ior = searched(small, record, production.rotations)
        best = production.rotations.index(record.best_rotation_deg)
        assert record.F_ior_arcsec == pytest.approx(F_ior[:, 0], abs=0.01)
        assert record.best_F_ior_arcsec == pytest.approx(F_ior[:, best], abs=0.01)
        served = merit(F_ior, F_ior.mean(axis=1))
        assert served[best] <= served.min() + 1e-3
        assert record.max_residual < 1e-8
    assert len({record.best_rotation_deg for record in records}) > 2


@pytest.mark.thorough
def test_error_after_tolerance_step_is_at_most_the_searched_error(small: Drive, records: list[RandomDrive]) -> None:
    for record in records[:3]:
        for path, then in record.tighter.items():
            less = {**record.values, path: TIGHTER_STEP * record.values[path]}
            drive = rotated(small.with_values(less), record.best_rotation_deg)
            exact = np.array([ErrorMap(drive, M_g).extremes(drive).first for M_g in TORQUES])
            assert np.all(np.array(then) <= exact + 0.01)
            assert then == pytest.approx(exact, rel=0.15, abs=0.1)


def test_a_drive_is_the_same_in_any_chunk_and_process(production: Production, records: list[RandomDrive]) -> None:
    assert production.records(2, 4) == records[2:4]
    with ThreadPoolExecutor(1) as executor:
        law = production_law(production.drive)
        again, _ = Production(law, TORQUES, seed=1, steps=True).with_designs(COUNT, run=Run(executor))
    assert again.records(4, 5) == records[4:5]


def test_limits_decide_which_position_is_the_best(small: Drive, production: Production) -> None:
    limited = with_designs(Production(production.law, TORQUES, limits=(1000.0, 0.5), seed=1))
    F_ior = searched(small, record := limited.records(0, 1)[0], limited.rotations)
    assert record.best_rotation_deg == limited.rotations[int(F_ior[1].argmin())]


def test_without_turning_the_best_is_what_was_built(production: Production, records: list[RandomDrive]) -> None:
    fixed = with_designs(Production(production.law, TORQUES, mounting=False, seed=1)).records(0, 2)
    for one, other in zip(fixed, records, strict=False):
        assert one.best_F_ior_arcsec == one.F_ior_arcsec
        assert one.F_ior_arcsec == pytest.approx(other.F_ior_arcsec, abs=1e-6)
        assert one.tighter is None


def test_designs_differ_in_unknown_inputs_that_their_drives_share() -> None:
    drive = load_preset(TINY, [SOFT, "operation.M_g=4"])
    few = with_designs(Production(production_law(drive), (4.0,), mounting=False, per_design=3), 6)
    more = with_designs(replace(few, designs=()), 12)
    assert (len(few.designs), len(more.designs)) == (2, 4)
    assert more.designs[:2] == few.designs
    records = few.records(0, 6)
    assert [record.design for record in records] == [0, 0, 0, 1, 1, 1]
    assert [len({r.values["supports.C_3"] for r in records[k : k + 3]}) for k in (0, 3)] == [1, 1]
    for record in records:
        moved = drive.with_values(record.values)
        assert record.F_ior_arcsec[0] == pytest.approx(ErrorMap(moved, 4.0).extremes(moved).first, abs=0.01)
    assert records[4:] == few.records(4, 6)


def test_evidence_weighs_designs() -> None:
    def mean_C_3(catalogue: str) -> float:
        drive = load_preset(TINY, [SOFT, "operation.M_g=4", "operation.rated=4", catalogue])
        found = with_designs(Production(production_law(drive), (4.0,), mounting=False, per_design=1), 12)
        return float(np.average([v["supports.C_3"] for v, _ in found.designs], weights=[w for _, w in found.designs]))

    assert mean_C_3("catalogue.accuracy=5") != mean_C_3("catalogue.accuracy=1000")  # 12″ at 2 % of the rated torque


def test_too_few_designs_that_agree_with_the_catalogue_are_refused() -> None:
    drive = load_preset(TINY, [SOFT, "operation.M_g=4", "operation.rated=4", "catalogue.K_1=1e9"])
    with pytest.raises(UntrustedError, match=r"catalogue.K_1 = 1e\+09 contradicts"):
        Production(production_law(drive), (4.0,), per_design=1).with_designs(1)


def test_clearances_that_have_a_tolerance_scatter_from_drive_to_drive() -> None:
    drive = load_preset(SMALL, ["gears.j_n=6 ± 1", "operation.M_g=4"])
    production = with_designs(Production(production_law(drive, "fixed"), (4.0,), mounting=False, seed=1))
    records = production.records(0, 2)
    for record in records:
        moved = drive.with_values(record.values)
        assert record.F_ior_arcsec[0] == pytest.approx(ErrorMap(moved, 4.0).extremes(moved).first, abs=0.01)
    assert len({record.values["gears.j_n"] for record in records}) == 2


def test_a_drive_that_cannot_be_is_kept_with_the_reason(production: Production) -> None:
    (found,) = replace(production, designs=(({"cam.W_0": 9.0}, 1.0),)).records(0, 1)
    assert found.refused and found.refused.startswith("the sampled values do not give a valid drive: ")
    assert found.values["cam.W_0"] == 9.0
    assert not found.F_ior_arcsec


def test_rolling_balls_are_refused() -> None:
    rolling = load_preset(SMALL, ["bearing.ball_motion=rolling", "bearing.d_ball=4"])
    with pytest.raises(UsageError, match="random drives require"):
        Production(production_law(rolling), TORQUES)


def test_a_record_without_a_proof_is_refused(production: Production, records: list[RandomDrive]) -> None:
    adapter = production.kind.adapter
    assert adapter.validate_python(asdict(records[0])) == records[0]
    for wrong in (
        {"F_ior_arcsec": (0.0, 1.0)},
        {"max_residual": 0.9},
        {"states": 1.5},
        {"refused": 3},
        {"weight": 1e305},
    ):
        with pytest.raises(ValueError, match="Input should be"):
            adapter.validate_python({**asdict(records[0]), **wrong})


def test_a_field_that_is_assumed_makes_designs() -> None:
    law = production_law(load_preset(TINY, [ASSUMED]))
    assert Production(law, (4.0,), per_design=7).design_of(14) == 2
    assert Production(production_law(load_preset(TINY)), (4.0,)).design_of(14) == 0
