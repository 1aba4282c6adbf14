"""Several joints in one log: each with its own columns and ratio, in one table."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.helpers.process import run

RATIOS = {"J1": 50.0, "J2": 80.0}


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """A log of two joints, and the range of the error of each over its travel of 90 deg."""
    rng, columns, names, true = np.random.default_rng(1), [], [], {}
    for k, (name, ratio) in enumerate(RATIOS.items()):
        turns = np.linspace(3, 3 + ratio / 4, 1500)

        def error(turns, size=8 + 4 * k, ratio=ratio):
            return size * np.cos(4 * np.pi * turns + 1) + 5 * np.cos(2 * np.pi * turns / ratio + 2)

        output = turns / ratio * 360 + (error(turns) + 0.3 * rng.standard_normal(1500)) / 3600
        columns += [360 * turns, output]
        names += [f"cam{k + 1}_deg", f"out{k + 1}_deg"]
        true[name] = float(np.ptp(error(np.linspace(3, 3 + ratio / 4, 20000))))
    path = tmp_path_factory.mktemp("log") / "log.csv"
    np.savetxt(path, np.column_stack(columns), fmt="%.9f", delimiter=",", header=",".join(names), comments="")
    return str(path), true


def joint_options(**ratios):
    return [f"--joint={name}=cam{name[1]}_deg,out{name[1]}_deg,{ratio:g}" for name, ratio in ratios.items()]


@pytest.mark.thorough
def test_measure_reports_a_range_for_all_joints_in_one_table(log):
    path, true = log
    answer = run("measure", path, *joint_options(**RATIOS), "--travel", "90", "--json")
    assert answer.returncode == 0, answer.stderr
    for found in json.loads(answer.stdout)["results"]:
        low, high = found["directions"][0]["interval_arcsec"]
        assert low <= true[found["joint"]] <= high
        assert not found["directions"][0]["F_ior_is_lower_bound"]
    page = run("measure", path, *joint_options(**RATIOS), "--travel", "90").stdout
    table = page[page.index("joint  F'_ior") :].splitlines()
    assert [line.split()[0] for line in table[:3]] == ["joint", "J1", "J2"]


def test_a_joint_that_cannot_be_is_refused(log):
    path, _ = log
    for wrong in ("J1", "J1=cam1,100", "=a,b,100", "J1=a,b,x", "J1=a,b,3"):
        assert run("measure", path, "--joint", wrong).returncode == 2
    assert run("measure", path, "--joint", "J1=cam1_deg,out1_deg,50", "--ratio", "50").returncode == 2
    missing = run("measure", path, "--joint", "J1=cam9,out1_deg,50")
    assert missing.returncode == 4
    assert "cam9" in missing.stderr
