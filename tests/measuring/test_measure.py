"""F'_ior of measured traces with a known answer, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import records
from hdassist.features.acceptance.decision import AcceptedValue, decide
from hdassist.features.acceptance.limits import Limit
from hdassist.features.measuring.measure import measure
from hdassist.features.measuring.orders import combined, parse_stated
from hdassist.readers.trace import read_trace
from hdassist.run.errors import DataError, UntrustedError, UsageError
from tests.helpers.rigs import EVEN, PER_TURN, RATIO, even_wave, recorded, simulated, text, turn_range, whole_range
from tests.helpers.support import rounding


@pytest.mark.thorough
def test_known_ranges_lie_within_the_stated_uncertainty():
    hits, within, passed, raw_too_large, widths = 0, 0, 0, 0, []
    for seed in range(20):
        turns, error, curve = simulated(seed)
        (found,) = measure(recorded(turns, error), ratio=RATIO).directions
        low, high = found.interval_arcsec
        true, u = whole_range(curve, RATIO), found.uncertainty_arcsec
        hits += low <= true <= high
        in_turn = abs(found.revolution.value - turn_range(curve, RATIO))
        within += in_turn <= 2 * found.revolution.uncertainty
        # a drive that stands just at its limit
        passed += (
            decide(
                Limit("F_IOR", true), AcceptedValue(found.range.value, 2 * u, "measured", "whole"), "guard", 0
            ).verdict
            == "PASS"
        )
        raw_too_large += found.raw_range_arcsec > high
        widths.append(u / found.range.value)
    assert hits >= 19
    assert within >= 19
    assert passed <= 1  # 5 % at most
    assert raw_too_large > 10  # what the uncorrected range would have said
    assert np.median(widths) < 0.05  # the uncertainty is not idle


@pytest.mark.parametrize(
    ("turns", "error", "words"),
    [
        (EVEN, np.random.default_rng(0).standard_normal(600), "does not exceed its noise"),
        (EVEN[:190], even_wave(EVEN[:190]), "less than one input revolution"),
        (EVEN, even_wave(EVEN) + 60 * EVEN, "does not exceed its noise"),
    ],
)
def test_what_cannot_be_trusted_is_not_given(turns, error, words):
    with pytest.raises((UntrustedError, DataError), match=words):
        measure(recorded(turns, error), ratio=100)


def test_error_about_columns_read_by_sequence_names_them():
    noise = np.random.default_rng(0).standard_normal(600)
    with pytest.raises(UntrustedError) as caught:
        measure(read_trace(text([360 * EVEN, noise], "").lstrip().encode()), ratio=100)
    assert caught.value.hint.startswith("use --second 2 if the second column is an encoder")


def test_steps_too_long_for_an_order():
    turns = np.arange(60) / 20
    assert any("only orders up to 8" in text for text in measure(recorded(turns, even_wave(turns)), ratio=100).notes)
    with pytest.raises(UntrustedError, match="too long for order 12"):
        measure(recorded(turns, even_wave(turns)), ratio=100, orders=range(1, 13))


def test_budget():
    stated = parse_stated(["encoder=0.3", "temperature=0.4"])
    (found,) = measure(recorded(EVEN, even_wave(EVEN)), ratio=100, stated=stated).directions
    (bare,) = measure(recorded(EVEN, even_wave(EVEN)), ratio=100).directions
    assert found.uncertainty_arcsec == pytest.approx(np.hypot(bare.uncertainty_arcsec, 0.5))
    assert {s.name for s in bare.sources if s.arcsec is None} == {"encoder", "coupling", "reseating", "temperature"}
    same = rounding(len(bare.sources), bare.uncertainty_arcsec)
    assert combined(bare.sources) == pytest.approx(bare.uncertainty_arcsec, abs=same)
    for wrong in (["x=1"], ["encoder"], ["encoder=-1"], ["encoder=nan"], ["encoder=1", "encoder=2"]):
        with pytest.raises(UsageError):
            parse_stated(wrong)


def test_the_same_seed_gives_the_same_figures():
    first, again = (measure(recorded(EVEN, even_wave(EVEN)), ratio=100, seed=4).F_ior_arcsec for _ in range(2))
    assert first == again


def test_rounding_does_not_move_the_draws():
    turns, error, _ = simulated(0)
    turns = turns + 0.37 / PER_TURN  # no reading at the edge of a bin
    apart = turns + 1e-13 * np.random.default_rng(2).standard_normal(len(turns))
    (one,), (two,) = (measure(recorded(angles, error), ratio=RATIO).directions for angles in (turns, apart))
    assert np.abs(one.fit.factor - two.fit.factor).max() < 1e-6 * np.abs(one.fit.factor).max()


@pytest.mark.thorough
def test_simulated_benches_are_held():
    """The short form of `python -m benchmarks.records`."""
    held = records.Held({})
    for seed in range(3):
        records.look(seed, records.RATIO, held)
    records.look(0, 0.6 * records.RATIO, held)
    for quantity in ("F'_ior", "range of the orders of the input", "lag"):
        hits, count = held.count[quantity]
        assert hits == count
    hits, count = held.count["orders"]  # 95 of 100 in 500 benches
    assert hits >= 0.85 * count
