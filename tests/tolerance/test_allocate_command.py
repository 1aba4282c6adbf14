"""hdassist allocate: what it says, in each form, and refuses."""

import json

import pytest

from tests.process import SMALL, run

FEW = ("--torque", "4", "--limit", "25", "-n", "20", "--as-built", "--jobs", "1", "--distribution", "fixed")
KNOWN = ("--known", "phases.xi_g", "--known", "phases.xi_b", "--set", "tolerances.e_hh=0", "--set", "tolerances.e_hb=0")


def test_the_page_and_json_tell_costs_and_what_was_tried() -> None:
    done = run("allocate", SMALL, *FEW, *KNOWN, "--json", "--set", "cost.tolerances.F_i1.share=3")
    told = json.loads(done.stdout)
    assert done.returncode == told["exit_code"] == 0, done.stderr
    assert told["schema"] == "hdassist.allocate/1"
    assert {law["field"]: (law["share"], law["assumed"]) for law in told["laws"]} == {
        "tolerances.F_i1": (3.0, False), "tolerances.F_i2": (1.0, True),
    }  # fmt: skip
    (way,) = told["allocations"]
    laws = {law["field"]: law for law in told["laws"]}
    cost = sum(laws[path]["share"] * laws[path]["now"] / value for path, value in way["tolerances"].items())
    assert way["cost"] == pytest.approx(cost)
    assert way["fits"] is (told["verdict"] == "PASS")
    assert way["yield"]["low"] <= way["yield"]["share"] <= way["yield"]["high"]
    assert "tolerances.F_i2" in told["warnings"][0]


def test_what_nothing_reaches_fails_and_says_why() -> None:
    done = run(
        "allocate", SMALL, *FEW, *KNOWN, "--limit", "4:12.4", "--set", "cost.tolerances.F_i1.least=40", "--ascii"
    )
    assert done.returncode == 3, done.stderr
    assert "no such tolerances" in done.stdout
    assert "nothing fits: at 4 N*m the self error takes 12.3 of 12.4 arcsec" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ((), "no limit of F'_ior"),
        (("--limit", "4:5", "--torque", "4"), "the self error alone is"),
        (("--limit", "30", "--yield", "1"), "--yield"),
        (("--limit", "30", "-n", "3"), "-n"),
        (("--limit", "30", "--set", "cost.cam.W_0.share=2"), "cost.cam.W_0"),
    ],
)
def test_what_cannot_be_meant_is_refused(arguments: tuple[str, ...], told: str) -> None:
    done = run("allocate", SMALL, *arguments)
    assert done.returncode in (2, 4), done.stderr
    assert told in done.stderr
    assert not done.stdout
