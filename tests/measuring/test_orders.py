"""Orders as they are declared, and those that a record tells apart."""

from __future__ import annotations

import numpy as np
import pytest

from hdassist.errors import UsageError
from hdassist.measuring.orders import order_grid, parse_orders


def test_declared_orders():
    assert parse_orders("1-3, 6") == (1, 2, 3, 6)
    assert parse_orders("2.02") == (2.02,)
    assert parse_orders(None) is None
    for wrong in ("", "0", "3-1", "x", "1;2", "1-", "-1", "1e9", "1.5-3"):
        with pytest.raises(UsageError):
            parse_orders(wrong)


def test_the_grid_follows_what_the_record_resolves():
    assert order_grid((1.0, 2.0), 3.0, 100).tolist() == [1, 2]
    assert len(order_grid((1.0, 2.0), 100.0, 100)) == 6 + 2 * 13
    part = order_grid((1.0, 2.0), 20.0, 100)
    assert np.diff(part).min() == pytest.approx(1 / 20)
    assert order_grid((2.0, 2.02), 10.0, 100).tolist() == pytest.approx([0.1, 1.9, 2.0, 2.1])
    assert order_grid((2.01, 2.02), 10.0, 100, beats=False).tolist() == [2.01]
