"""`--torque 0` is no load: computed at 2 % of the rated torque, and called so."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.helpers.process import TINY, run

RATED = ("--set", "operation.rated=50")  # 2 % of it are 1 N*m


@pytest.mark.parametrize("command", [("check", "--draws", "0"), ("trace", "-n", "2")])
@pytest.mark.parametrize("torque", ["0", "0 N·m", "-0.0"])
def test_no_load_is_computed_at_two_percent_of_rated_torque(command: tuple[str, ...], torque: str) -> None:
    name, *options = command
    without = run(name, TINY, *RATED, "--torque", torque, *options, "--json")
    light = run(name, TINY, *RATED, "--torque", "1", *options, "--json")
    assert (without.returncode, light.returncode) == (0, 0), without.stderr
    answer, expected = json.loads(without.stdout), json.loads(light.stdout)
    assert any("no load" in text for text in answer.pop("warnings"))
    assert not any("no load" in text for text in expected.pop("warnings"))
    for each in (answer, expected):
        each.pop("preset")
        each.pop("certificate", None)
    assert answer == expected


def test_no_load_and_a_torque_go_together() -> None:
    answer = json.loads(run("check", TINY, *RATED, "--torque", "0", "--torque", "4", "--draws", "0", "--json").stdout)
    assert [point["M_g_Nm"] for point in answer["operating_points"]] == [1, 4]


def test_no_load_without_rated_torque_derives_from_the_largest_torque() -> None:
    answer = json.loads(run("check", TINY, "--torque", "0", "--draws", "0", "--json").stdout)
    assert [point["M_g_Nm"] for point in answer["operating_points"]] == [0.08]


def test_no_load_is_refused_where_it_cannot_be_resolved() -> None:
    piped = run("check", "-", "--torque", "0", stdin=Path(TINY).read_text())
    sweep = run("sweep", TINY, "--torque", "0", "--vary", "gears.j_n=16:20:2")
    assert (piped.returncode, sweep.returncode) == (2, 2)
