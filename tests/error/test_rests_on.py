"""What an answer rests on: against the drive computed at the ends itself."""

from pathlib import Path

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.error.cycle import kinematic_error
from hdassist.error.error_map import ErrorMap
from hdassist.error.rests_on import rests_on, weighed
from hdassist.loading.load import load_text
from hdassist.model.assumed import assumptions
from tests.process import SMALL

W_0 = "source.cam.W_0={kind: assumed, range: [0.55, 0.6], ref: judged}"


LEFT_OUT = "h_a: 0.6", "h_f: 1.35", "k_t: 1.4", "g_b: 0"


def loose(*overrides: str):
    """The small drive with what has a default left to it."""
    text = Path(SMALL).read_text(encoding="utf-8")
    for given in LEFT_OUT:
        assert text.count(f", {given}") == 1
        text = text.replace(f", {given}", "")
    return load_text(text, "loose.yaml", overrides)


@pytest.fixture(scope="module")
def drive():
    return loose(W_0, "operation.M_g=4")


def test_what_the_preset_calls_assumed_or_leaves_to_a_default_is(drive):
    found = {a.path: a for a in assumptions(drive)}
    assert set(found) == {"cam.W_0", "gears.h_a", "gears.h_f", "flexspline.k_t", "bearing.g_b"}
    assert (found["cam.W_0"].low, found["cam.W_0"].high, found["cam.W_0"].reason) == (0.55, 0.6, "judged")
    assert found["bearing.g_b"].high == pytest.approx(20 * 30 / 160)  # clearances as the pitch diameter
    for settled in ("source.gears.h_a={kind: given}", "gears.h_a=0.6", "gears.h_a=0.65"):
        assert "gears.h_a" not in {a.path for a in assumptions(loose(W_0, settled))}


def test_the_effects_are_those_of_the_drive_at_the_ends(drive):
    told: list[int] = []
    first, *others = rests_on(drive, (4.0,), most=4, progress=told.append)
    assert first.assumption.path == "cam.W_0"
    assert first.ends == (0.55, 0.6)
    for end, value in zip(first.ends, first.F_ior_arcsec[0], strict=True):
        there = kinematic_error(drive.with_values({"cam.W_0": end}), 4.0, cross_check=None)
        assert value == pytest.approx(there.F_ior_arcsec, abs=0.01)
    assert first.at[0] == pytest.approx(kinematic_error(drive, 4.0, cross_check=None).F_ior_arcsec, abs=0.01)
    assert all(a.share >= b.share for a, b in zip([first, *others], others, strict=False))
    assert len(others) == 3
    _, *searched = told
    assert sum(searched) == sum(effect.certificate.states for effect in (first, *others))


def test_an_end_that_cannot_be_computed_is_approached(drive):
    far = loose("source.cam.W_0={kind: assumed, range: [0.02, 0.6]}", "operation.M_g=4")
    found = next(effect for effect in rests_on(far, (4.0,), most=5) if effect.assumption.path == "cam.W_0")
    assert found.assumption.low == 0.02
    assert 0.02 < found.ends[0] <= 0.58
    assert np.isfinite(found.F_ior_arcsec).all()


def test_the_spread_is_that_of_drives_drawn_from_the_ranges():
    ranges = {"cam.W_0": (0.55, 0.6), "supports.C_3": (5e2, 6e3), "supports.C_2": (2e3, 1.2e4)}
    sources = [f"source.{path}={{kind: assumed, range: [{low}, {high}]}}" for path, (low, high) in ranges.items()]
    drive = load_preset(SMALL, [*sources, "operation.M_g=4"])
    rng = np.random.default_rng(0)
    drawn = []
    for _ in range(40):
        there = drive.with_values({path: float(rng.uniform(*ends)) for path, ends in ranges.items()})
        drawn.append(np.log(ErrorMap(there, 4.0).extremes(there).first))
    found = weighed(drive, (4.0,))
    assert found is not None
    assert found.spread == pytest.approx(np.std(drawn), rel=0.3)
    assert weighed(load_preset(SMALL), (4.0,)) is None
