"""hdassist allocate: what it says, in each form, and refuses."""

import json
import re

import pytest

from hdassist.interface.commands import design
from tests.helpers.process import TINY, in_a_line, run

FEW = ("--torque", "4", "--limit", "1950", "--yield", "0.9", "-n", "40", "--as-built", "--jobs", "1")
KNOWN = ("--known", "phases.xi_g", "--known", "phases.xi_b", "--set", "tolerances.e_hh=0", "--set", "tolerances.e_hb=0")
FIXED = ("--distribution", "fixed")
SOFT = ("--set", "source.supports.C_3={kind: assumed, range: [50, 80000], ref: judged}")


@pytest.mark.thorough
def test_the_page_and_json_have_costs_and_what_was_tried() -> None:
    done = run("allocate", TINY, *FEW, *KNOWN, *FIXED, "--json", "--set", "cost.tolerances.F_i1.share=3")
    answer = json.loads(done.stdout)
    assert done.returncode == answer["exit_code"] == 0, done.stderr
    page = run("allocate", TINY, *FEW, *KNOWN, *FIXED, "--set", "cost.tolerances.F_i1.share=3").stdout.split()
    assert all(f"{path}={value:.3g}" in page for path, value in answer["allocations"][0]["tolerances"].items())
    assert answer["schema"] == "hdassist.allocate/1"
    assert {law["field"]: (law["share"], law["assumed"]) for law in answer["laws"]} == {
        "tolerances.F_i1": (3.0, False), "tolerances.F_i2": (1.0, True),
    }  # fmt: skip
    (way,) = answer["allocations"]
    laws = {law["field"]: law for law in answer["laws"]}
    cost = sum(laws[path]["share"] * laws[path]["now"] / value for path, value in way["tolerances"].items())
    assert way["cost"] == pytest.approx(cost)
    assert way["fits"] is (answer["verdict"] == "PASS")
    assert way["yield"]["low"] <= way["yield"]["high"]
    assert way["probability"]["low"] >= answer["sure"]
    assert "tolerances.F_i2" in answer["warnings"][0]


@pytest.mark.thorough
@pytest.mark.parametrize(("short_s", "lines"), [(0.0, 1), (3600.0, 0)])
def test_the_time_of_a_long_search_is_estimated_on_stderr(monkeypatch, short_s: float, lines: int) -> None:
    monkeypatch.setattr(design, "_SHORT_TIME", short_s)
    done = run("allocate", TINY, *FEW, *KNOWN, *FIXED, "-n", "20", "--json")
    estimates = re.findall(r"^time: up to \d+ (?:s|min) for at most 120 random drives", done.stderr, flags=re.MULTILINE)
    assert len(estimates) == lines


def test_what_no_tolerances_reach_fails_and_says_why() -> None:
    limit = ("--limit", "F_ior@4=1913.2", "--set", "cost.tolerances.F_i1.least=40", "--ascii")
    done = run("allocate", TINY, *FEW, *KNOWN, *FIXED, *limit)
    assert done.returncode == 3, done.stderr
    words = in_a_line(done.stdout)
    assert "no tolerances achieve the required yield" in words
    assert words.startswith("tiny, tolerances for 90 % of drives within 1913.2 arcsec at 4 N*m: FAIL ")
    assert "self error 1913.1 of 1913.2 arcsec at 4 N*m; no tolerance reduces it" in words
    assert max(map(len, done.stdout.splitlines())) <= 80


@pytest.mark.thorough
def test_where_the_design_is_not_known_no_tolerance_is_recommended() -> None:
    done = run("allocate", TINY, *FEW, "-n", "20", "--limit", "F_ior@4=2050", *SOFT, "--set", "tolerances.e_hb=60")
    words = in_a_line(done.stdout)
    assert done.returncode == 6, done.stdout + done.stderr
    assert "As assembled: no tolerances are recommended" in words
    assert "measure more drives (-n) may decide the verdict" in words
    assert re.search(f"next hdassist allocate {TINY} .*--yield 0.9 --sure 0.95 -n 80$", words)


def test_a_size_that_is_assumed_is_a_tolerance_to_choose() -> None:
    assumed = ("--set", "source.tolerances.F_i2={kind: assumed, range: [0, 47], ref: class 8}")
    done = run("allocate", TINY, *FEW, "--limit", "F_ior@4=2400", *assumed, "--json")
    assert "tolerances.F_i2" in [law["field"] for law in json.loads(done.stdout)["laws"]]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "no limit of F'_ior"),
        (("--limit", "F_ior@4=5", "--torque", "4"), "which alone exceeds the limit"),
        (("--limit", "30", "--yield", "1"), "--yield"),
        (("--limit", "30", "--sure", "0.2"), "--sure"),
        (("--limit", "30", "-n", "3"), "-n"),
        (("--limit", "30", "--set", "cost.cam.W_0.share=2"), "cost.cam.W_0"),
    ],
)
def test_invalid_arguments_are_refused(arguments: tuple[str, ...], words: str) -> None:
    done = run("allocate", TINY, *arguments)
    assert done.returncode in (2, 4), done.stderr
    assert words in done.stderr
    assert not done.stdout
