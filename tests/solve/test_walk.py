"""The compiled walk against the numpy engine, its oracle: the same states, the same sums, the same proof."""

from __future__ import annotations

import ctypes
import platform
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hdassist import kinematic_error, load_preset
from hdassist.drive.model.contacts import ROTATION, WITHOUT_DEVIATIONS, StateGaps, contact_system
from hdassist.drive.model.deviations import ToothDeviations, state_gaps
from hdassist.drive.model.geometry import Kinematics, neighbours_together, pitch_locked_states
from hdassist.drive.solve import walk
from hdassist.drive.solve.answers import ARCSEC, N_MM
from hdassist.drive.solve.build import X86, compile_walk, development_folder, library_name, source_hash
from hdassist.drive.solve.formulation import formulate
from hdassist.run.files import preset_names
from tests.helpers.process import SMALL
from tests.helpers.support import HAS_COMPILER, HAS_WALK, load_case

pytestmark = pytest.mark.skipif(not HAS_WALK, reason="no compiled walk: the numpy engine runs")
needs_compiler = pytest.mark.skipif(not HAS_COMPILER, reason="no C compiler")

SAME = 1e-9  # arcsec
PROVEN = 5e-11  # residual of either engine, as a share of its scale


def test_the_walk_is_compiled_and_of_this_source():
    found, words = walk.walk_library()
    assert found, words


@pytest.mark.skipif(sys.platform != "linux" or platform.machine() != "x86_64", reason="x86-64 on Linux")
def test_it_has_the_instructions_of_this_machine():
    flags = re.search("^flags.*", Path("/proc/cpuinfo").read_text(), re.MULTILINE)[0].split()
    expected = 4 if "avx512vl" in flags else 3 if "avx2" in flags else 1
    assert walk.walk_library()[0].walk_level() == expected


def states_of(drive, count, teeth=None):
    """Gaps of states spread over the cycle, in runs of neighbours as a walk meets them."""
    kinematics = Kinematics.of(drive)
    states = pitch_locked_states(kinematics)
    order = neighbours_together(kinematics, states)
    first = np.linspace(0, len(order) - 40, count // 40).astype(int)
    rows = order[np.minimum(first[:, None] + np.arange(40), len(order) - 1).ravel()]
    system = contact_system(drive)
    return system, state_gaps(drive, system, states.take(rows), teeth)


def assert_same(drive, M_g, count=200, teeth=None):
    system, gaps = states_of(drive, count, teeth)
    formulation = formulate(system)
    compiled = load_case(formulation, M_g * N_MM, many=True)
    plain = load_case(formulation, M_g * N_MM, compiled, many=True, compiled=False)
    found, expected = (engine.sums(gaps, slope=True) for engine in (compiled, plain))
    assert np.abs(found.rotation - expected.rotation).max() * ARCSEC < SAME
    assert found.residuals.worst.max() < PROVEN
    assert expected.residuals.worst.max() < PROVEN
    scale = abs(M_g) * N_MM
    assert found.moment == pytest.approx(expected.moment, abs=1e-10 * scale)
    assert found.tooth_force == pytest.approx(expected.tooth_force, abs=1e-9 * (1 + expected.tooth_force.max()))
    same = [np.abs(one.slope).max() for one in (found, expected)]
    assert np.abs(found.slope - expected.slope).max() < 1e-8 * max(same)
    assert found.given_up == expected.given_up == 0


@pytest.mark.thorough
@pytest.mark.parametrize("name", preset_names())
def test_both_engines_agree_on_every_preset(name):
    drive = load_preset(name)
    for M_g in drive.operation.M_g:
        assert_same(drive, M_g)


@pytest.mark.parametrize("stations", [3, 5])
@pytest.mark.parametrize("sets", [[], ["mounting.fixed=flexspline"], ["bearing.N=23"]])
def test_both_engines_agree_on_coned_flanks(stations, sets):
    assert_same(load_preset(SMALL, [f"numerics.stations={stations}", *sets]), 4.0, 120)


@settings(max_examples=15, deadline=None)
@given(
    M_g=st.sampled_from([-8.0, -0.3, 0.3, 3.0, 9.0]),
    soft=st.tuples(*[st.floats(-0.7, 0.7)] * 3),
    j_n=st.floats(0, 15),
    F_i2=st.floats(0, 80),
    e_hb=st.floats(0, 80),
    a_s2=st.floats(0, 6),
    fixed=st.sampled_from(["rigid", "flexspline"]),
)
def test_both_engines_agree_on_random_drives(M_g, soft, j_n, F_i2, e_hb, a_s2, fixed):
    small = load_preset(SMALL)
    names = ("C_1", "C_2", "C_3")
    supports = {
        f"supports.{name}": small.number(f"supports.{name}") * 10**x for name, x in zip(names, soft, strict=True)
    }
    values = supports | {"gears.j_n": j_n, "tolerances.F_i2": F_i2, "tolerances.e_hb": e_hb, "harmonics.a_s2": a_s2}
    assert_same(load_preset(SMALL, [f"mounting.fixed={fixed}"]).with_values(values), M_g, 80)


def test_both_engines_agree_on_measured_teeth():
    small = load_preset(SMALL)
    rng = np.random.default_rng(1)
    teeth = ToothDeviations(rng.normal(0, 4, small.gears.z_g), rng.normal(0, 4, small.gears.z_b))
    assert_same(small, 4.0, 120, teeth)


def test_every_instruction_set_of_this_machine_gives_the_same_answers(monkeypatch):
    best = walk.walk_library()[0]
    folder = development_folder() if (development_folder() / library_name(1)).exists() else Path(walk.__file__).parent
    levels = [level for level in X86 if (folder / library_name(level)).exists() and level <= best.walk_level()]
    small = load_preset(SMALL)
    for level in levels:
        monkeypatch.setattr(walk, "walk_library", lambda level=level: (walk._load(folder / library_name(level)), ""))
        assert_same(small, 4.0, 80)


def test_another_torque_needs_no_other_walk():
    system, gaps = states_of(load_preset(SMALL), 80)
    formulation = formulate(system)
    engine = load_case(formulation, 4e3, many=True)
    engine.sums(gaps)
    for torque in (1e3, -2e3):
        engine.load(torque / 1e3)
        alone = load_case(formulation, torque, many=True, compiled=False).sums(gaps)
        assert np.abs(engine.sums(gaps).rotation - alone.rotation).max() * ARCSEC < SAME


def test_state_that_is_not_a_number_affects_no_other():
    system, gaps = states_of(load_preset(SMALL), 120)
    formulation = formulate(system)
    expected = load_case(formulation, 4e3, many=True).sums(gaps)
    scalars = gaps.scalars.copy()
    scalars[7, 1], scalars[100, 0] = np.nan, np.inf
    found = walk_of(load_case(formulation, 4e3, many=True)).solve(StateGaps(scalars), 4e3, slope=True)
    bad = np.isin(np.arange(len(scalars)), [7, 100])
    assert found.given_up == 2
    assert np.isnan(found.rotation[bad]).all()
    assert np.isinf(found.residuals.worst[bad]).all()
    assert np.isnan(found.slope[bad]).all()
    assert found.rotation[~bad] == pytest.approx(expected.rotation[~bad], abs=SAME / ARCSEC)


def test_states_that_no_contact_set_solves_are_given_up_soon():
    system, gaps = states_of(load_preset(SMALL), 120)
    G = system.G.copy()
    G[:, ROTATION] = -np.abs(G[:, ROTATION])  # flanks that only push one way, and a torque that pushes so, too
    formulation = formulate(replace(system, G=G))
    engine = load_case(formulation, 4e3, many=True)
    found = walk_of(engine)
    sums = found.solve(gaps, -4e3)
    assert sums.given_up == len(gaps)
    assert np.isnan(sums.rotation).all()


def walk_of(engine):
    """The compiled walk of an engine, made by its first state."""
    engine.sums(WITHOUT_DEVIATIONS)
    return engine._walk


@needs_compiler
def test_older_library_without_all_functions_is_not_used(monkeypatch, tmp_path):
    older = tmp_path / "older.c"
    older.write_text('const char *walk_source(void) { return "older"; }\nint walk_level(void) { return 1; }\n')
    library = tmp_path / library_name(1)
    subprocess.run(["cc", "-shared", "-fPIC", str(older), "-o", str(library)], check=True)
    monkeypatch.setattr(walk, "__file__", str(tmp_path / "walk.py"))
    walk.walk_library.cache_clear()
    try:
        found, words = walk.walk_library()
    finally:
        walk.walk_library.cache_clear()
    assert found is None
    assert "older than walk.c" in words


def test_a_library_of_another_source_is_not_used(monkeypatch):
    walk.walk_library.cache_clear()
    monkeypatch.setattr(walk, "source_hash", lambda: "0" * 64)
    try:
        found, words = walk.walk_library()
        assert found is None
        assert "older than walk.c" in words
    finally:
        walk.walk_library.cache_clear()


@pytest.mark.thorough
@needs_compiler
def test_the_source_compiles_without_a_warning_and_names_itself(tmp_path):
    made = compile_walk(tmp_path, ["-Wall", "-Wextra", "-Werror"])
    assert made
    loaded = ctypes.CDLL(str(made[0]))
    loaded.walk_source.restype = ctypes.c_char_p
    assert loaded.walk_source().decode() == source_hash()


@pytest.mark.parametrize("variable", [{"CC": "/bin/false"}, {"CC": "no-such-compiler"}, {"HDASSIST_PURE": "1"}])
def test_without_a_compiler_nothing_is_made(tmp_path, monkeypatch, variable):
    for name, value in variable.items():
        monkeypatch.setenv(name, value)
    assert compile_walk(tmp_path) == []


def test_a_contact_whose_force_is_negative_but_for_rounding_opens():
    """Far off its centre on a stiff support: one of 20 200 states had a residual of 3.8e-8, solved at a wrong set."""
    fields = {
        "numerics.stations": 1, "gears.j_n": 5.937, "flexspline.k_t": 1.186, "bearing.ring_h": 3.907,
        "supports.C_1": 1.83e6, "supports.C_2": 2.3e4, "supports.C_3": 1e5, "contact.c_t": 3.944e-5,
        "contact.c_ball": 1.861e-5, "bearing.beta": 0, "tolerances.e_hb": 100,
    }  # fmt: skip
    found = kinematic_error(load_preset("vzp160", [f"{path}={value}" for path, value in fields.items()]), 80.0)
    assert found.certificate.max_residual < PROVEN
    assert found.certificate.fallbacks == 0
