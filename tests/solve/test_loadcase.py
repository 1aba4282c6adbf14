"""A contact system under a torque: what it takes over from the one before, and what it is told."""

import pytest

from hdassist import load_preset
from hdassist.solve import engine
from hdassist.solve.loadcase import LoadCase
from tests.process import SMALL


def test_a_neighbour_is_not_compiled_again(monkeypatch):
    drive = load_preset(SMALL)
    near = LoadCase.of(drive, 4.0)
    softer = drive.with_values({"contact.c_t": 6.6e-5})
    alone = LoadCase.of(softer, 1.0)
    expected = alone.solve(alone.system.delta_p[None], str)

    def refuse(*_):
        raise AssertionError("compiled again")

    monkeypatch.setattr(engine, "compile_programme", refuse)
    case = LoadCase.of(softer, 1.0, like=near)
    found = case.solve(case.system.delta_p[None], str)
    assert found.rotation_arcsec == pytest.approx(expected.rotation_arcsec, abs=1e-7)
