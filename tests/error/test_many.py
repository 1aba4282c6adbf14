"""F'_ior of many drives at once, against the table asked for each of them alone."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.error.many import CHUNK, F_ior_of_many
from hdassist.error.table import turns
from hdassist.model.deviations import deviation_scalars
from tests.process import SMALL

COUNT = CHUNK + 20  # more than a task takes
POSITIONS = 5  # of each wheel


class Sloping:
    """In place of a table: an error that grows along the scalars, each by its own slope."""

    turns = POSITIONS

    def F_ior(self, scalars):
        weights = np.array([1.0, -2.0, 3.0, 0.5, 0.7, -1.1])[: scalars.shape[-1]]
        return np.ptp(scalars @ weights, axis=-1)


@pytest.fixture(scope="module", params=["rigid", "flexspline"])
def drive(request):
    return load_preset(SMALL, [f"mounting.fixed={request.param}", "tolerances.e_hg=20", "phases.xi_g=40"])


@pytest.fixture(scope="module")
def values():
    rng = np.random.default_rng(4)
    return {"tolerances.e_hb": 40 * rng.random(COUNT), "phases.xi_b": 360 * rng.random(COUNT)}


def test_each_is_what_it_is_alone(drive, values):
    found = F_ior_of_many(drive, Sloping(), values)
    alone = [drive.with_values({path: float(of[k]) for path, of in values.items()}) for k in range(COUNT)]
    expected = [Sloping().F_ior(deviation_scalars(each, *turns(POSITIONS))) for each in alone]
    assert found == pytest.approx(np.array(expected))
    with ThreadPoolExecutor(2) as executor:
        again = F_ior_of_many(drive, Sloping(), values, executor=executor)
    assert np.array_equal(again, found)


def test_the_fixed_wheel_off_its_centre_is_a_run_out_of_it(drive, values):
    # of the flexspline, the other way round: the rigid wheel stands off against it, and turns with it in the cam frame
    found = F_ior_of_many(drive, Sloping(), values, off_um=12 * np.exp(1j))
    alpha_g, alpha_b = turns(POSITIONS)
    moved = 12e-3 * np.exp(1j * (1 + (alpha_b if drive.mounting.fixed == "rigid" else alpha_g)))
    for k in (0, CHUNK, COUNT - 1):
        alone = drive.with_values({path: float(of[k]) for path, of in values.items()})
        scalars = deviation_scalars(alone, alpha_g, alpha_b)
        shifted = np.concatenate([scalars[..., :4], np.stack([moved.real, moved.imag], axis=-1)], axis=-1)
        assert found[k] == pytest.approx(Sloping().F_ior(shifted))
