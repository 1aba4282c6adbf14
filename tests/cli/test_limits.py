"""--limit and --torque: one form on every command that has them."""

import json

import pytest

from hdassist.interface.terminal.options import limits_of_options
from hdassist.run.errors import UsageError
from tests.helpers.process import TINY, run

HOLDS_F_IOR = ("check", "report", "tolerance", "sensitivity", "allocate")


@pytest.mark.parametrize(
    ("limits", "held", "verdict", "code"),
    [
        (("3000",), [3000, 3000], "PASS", 0),
        (("F_ior=50 arcmin",), [3000, 3000], "PASS", 0),
        (("F_ior@4=1",), [None, 1], "FAIL", 3),
        (("F_ior@4=3000", "1"), [1, 3000], "FAIL", 3),
        (("1", "F_ior@4=3000"), [1, 3000], "FAIL", 3),
    ],
)
def test_check_holds_the_limit_of_the_command_line(limits, held, verdict, code) -> None:
    done = run("check", TINY, "--json", *(word for limit in limits for word in ("--limit", limit)))
    answer = json.loads(done.stdout)
    assert [point["limit_arcsec"] for point in answer["operating_points"]] == held
    assert (answer["verdict"], done.returncode) == (verdict, code)


def test_it_takes_the_place_of_the_preset_s_limit() -> None:
    done = run("check", TINY, "--set", "acceptance.F_ior=1", "--limit", "F_ior@4=3000", "--json")
    assert [point["limit_arcsec"] for point in json.loads(done.stdout)["operating_points"]] == [1, 3000]


def test_check_and_accept_say_the_same_of_it() -> None:
    limit = ("--limit", "F_ior@4=1", "--json")
    (point,) = [
        each for each in json.loads(run("check", TINY, *limit).stdout)["operating_points"] if each["M_g_Nm"] == 4
    ]
    (check,) = json.loads(run("accept", TINY, *limit).stdout)["checks"]
    assert (check["limit"], check["verdict"]) == (point["limit_arcsec"], point["verdict"])
    assert check["value"] == pytest.approx(point["F_ior_upper_arcsec"])


def test_a_report_has_it() -> None:
    done = run("report", TINY, "--limit", "1", "--set", "mounting.holes=3")
    assert done.returncode == 3
    assert "limit" in done.stdout


@pytest.mark.parametrize("command", HOLDS_F_IOR)
@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ("4:30", "must be a number (got 4:30"),
        ("F_iro@4=30", "NAME is one of F_ior"),
        ("F_ior@4=", "expected [NAME[@TORQUE]=]VALUE"),
        ("lost_motion=30", "use hdassist accept for other limits"),
        ("F_ior@7=30", "--torque 7"),
        ("F_ior@4=30 mm", "--limit F_ior@4=30 mm: mm is a unit of a length"),
        ("-3", "--limit F_ior=-3: must be above 0"),
    ],
)
def test_what_is_none_is_refused_with_a_hint(command: str, limit: str, words: str) -> None:
    done = run(command, TINY, f"--limit={limit}")
    assert (done.returncode, done.stdout) == (2, "")
    assert words in done.stderr


def test_limits_of_all_torques_stand_first() -> None:
    assert [str(each) for each in limits_of_options(["F_ior@4=3", "order_2=5", "30"])] == [
        "order_2=5", "F_ior=30", "F_ior@4=3",
    ]  # fmt: skip
    with pytest.raises(UsageError, match="expected a limit of F_ior"):
        limits_of_options(["order_2=5"], only="F_ior")


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [("4 N·m", 0, ""), ("4e3 N mm", 0, ""), ("abc", 2, "error: invalid --torque 'abc': must be a number"),
     ("1_0", 2, "error: invalid --torque '1_0': "), ("nan", 2, "error: invalid --torque 'nan': "),
     ("2e7", 2, "expected a torque in N·m up to 1e7")],
)  # fmt: skip
def test_torque_option_accepts_a_unit_and_names_itself_in_errors(text, code, words) -> None:
    done = run("trace", TINY, "-q", "--torque", text)
    assert (done.returncode, done.stdout) == (code, run("trace", TINY, "-q", "--torque", "4").stdout * (code == 0))
    assert words in done.stderr


def test_limit_without_a_value_is_a_usage_error():
    for options in (("--limit",), ("--limit", "")):
        done = run("check", TINY, *options)
        assert done.returncode == 2
        assert (
            done.stderr.startswith("error: ") and "--limit" in done.stderr and "hdassist explain USAGE" in done.stderr
        )
