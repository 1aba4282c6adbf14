"""Help texts: what a newcomer sees first."""

import re
import subprocess
import sys
from importlib import import_module

import pytest

from hdassist.interface.cli import COMMANDS, OTHER_NAMES, module_of
from hdassist.interface.terminal.options import DECLARED, OptionGroup
from tests.helpers.process import on_terminal, run

NAMES = sorted({*COMMANDS} - {"presets"})


def test_hdassist_without_a_command_lists_all_commands_on_one_screen() -> None:
    done = run()
    lines = done.stdout.splitlines()
    assert (done.returncode, done.stderr) == (0, "")
    assert len(lines) < 30 and max(map(len, lines)) <= 80
    assert sum("hdassist check vzp160" in line for line in lines) == 1
    for name in {*COMMANDS} - {*OTHER_NAMES}:
        assert any(re.search(rf"(^| ){name}  +\S", line) for line in lines), name


def test_the_start_page_of_a_narrow_terminal_breaks_no_word() -> None:
    lines = on_terminal(columns=60, env={"NO_COLOR": "1"})[1].split("\n")
    lines = [line.rstrip("\r") for line in lines if line.strip()]
    assert max(map(len, lines)) <= 60
    assert " ".join(lines[-2:]).endswith("hdassist -h lists all commands.")


@pytest.mark.thorough
@pytest.mark.parametrize(("env", "is_bold"), [({}, True), ({"NO_COLOR": "1"}, False), ({"TERM": "dumb"}, False)])
def test_command_names_are_bold_on_a_terminal_that_supports_bold(env: dict[str, str], is_bold: bool) -> None:
    code, shown = on_terminal(columns=80, env=env)
    assert code == 0
    assert ("\x1b[1mmount" in shown) is is_bold
    assert is_bold or "\x1b" not in shown


def test_commands_stand_in_groups_with_their_whole_summaries() -> None:
    lines = run("--help").stdout.splitlines()
    heads = [line for line in lines if line and not line.startswith(" ")]
    assert heads[1:] == ["Design:", "Bench:", "Acceptance:", "Data:", "Help:", "Options:"]
    assert lines.index("Bench:") < next(k for k, line in enumerate(lines) if line.split()[:1] == ["mount"])
    assert not any("..." in line for line in lines if not line.startswith("Usage"))
    assert {line.split()[0] for line in lines if line.startswith("  ")} >= {*NAMES, "presets"}


@pytest.mark.parametrize("name", NAMES)
def test_help_of_a_command_has_examples_and_sections(name: str) -> None:
    told = run(name, "--help").stdout
    assert "Examples:" in told
    assert ("\nOutput:\n" in told) is (name != "explore")
    assert max(map(len, told.splitlines())) <= 80


@pytest.mark.parametrize("name", ["list", "show", "validate", "new"])
def test_help_on_presets_fits_a_terminal_too(name: str) -> None:
    told = run("presets", name, "--help").stdout
    assert "Examples:" in told
    assert max(map(len, told.splitlines())) <= 80


def test_options_stand_in_sections() -> None:
    told = run("check", "--help").stdout
    sections = [line for line in told.splitlines() if line.endswith(":") and not line.startswith(" ")]
    assert sections == ["Arguments:", "Options:", "Drive:", "Tooth deviations:", "Output:", "Advanced:"]


@pytest.mark.parametrize("name", NAMES)
def test_what_few_need_stands_in_a_section_of_its_own(name: str) -> None:
    usual, _, advanced = run(name, "--help").stdout.partition("\nAdvanced:\n")
    options = usual[usual.index("Arguments:" if "Arguments:" in usual else "Options:") :]
    assert "--debug" in advanced
    for option in ("--solver", "--cross-check", "--draws", "--seed", "--jobs", "--ascii", "--debug"):
        assert f"  {option}" not in options


def test_options_of_a_command_take_few_lines() -> None:
    lines = run("accept", "-h").stdout.split("\nOptions:\n")[1].splitlines()
    assert sum(line.startswith("  -") for line in lines) == 52
    assert len(lines) <= 2 * 52


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("accept", "vzp160", "--rule", "simple"), "--set acceptance.rule=simple"),
        (("mount", "vzp160", "--trial", "h0=2"), "hdassist mount PRESET h0=28.1"),
        (("mount", "vzp160", "--samples", "2"), "--draws"),
        (("accept", "vzp160", "--travel", "300"), "--set acceptance.travel="),
        (("report", "a.yaml", "b.yaml"), "hdassist compare"),
        (("stiffness", "vzp160", "b.yaml"), "hdassist compare"),
    ],
)
def test_what_a_command_does_not_take_has_its_remedy_named(args: tuple[str, ...], words: str) -> None:
    done = run(*args)
    assert (done.returncode, done.stdout) == (2, "")
    message, _, hint = done.stderr.partition("hint: ")
    assert words in hint
    assert "Possible options" not in message  # of like letters: --replay for --travel


def test_a_command_that_is_none_has_its_neighbour_named() -> None:
    done = run("mont")
    assert done.returncode == 2
    assert "Did you mean 'mount'?" in done.stderr


def test_the_version_has_a_short_option() -> None:
    assert run("-V").stdout == run("--version").stdout


def test_help_loads_no_command() -> None:
    code = """
import sys
from importlib import import_module
from hdassist.interface.cli import app
app(["--help"], standalone_mode=False)
loaded = {name.removeprefix("hdassist.") for name in sys.modules if name.startswith("hdassist.")}
assert not loaded & {module_of(name).removeprefix("hdassist.") for name in COMMANDS}, loaded
assert not {"numpy", "pydantic"} & {*sys.modules}
"""
    subprocess.run(
        [sys.executable, "-c", "from hdassist.interface.cli import COMMANDS, OTHER_NAMES, module_of" + code], check=True
    )


def test_every_option_that_is_declared_has_its_field():
    for name in COMMANDS:
        import_module(module_of(name))
    for group, declared in DECLARED.items():
        pending, found = [OptionGroup], set()
        while pending:
            cls = pending.pop()
            pending += cls.__subclasses__()
            found |= vars(cls).get("__annotations__", {}).keys() if group in ("any", cls.__name__) else set()
        assert set(declared) <= found, group
