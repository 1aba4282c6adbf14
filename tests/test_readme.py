"""The README is true: its commands are those that run before a change lands, its Python runs."""

import re
from pathlib import Path

import hdassist
from hdassist.interface.cli import COMMANDS
from hdassist.run.files import preset_names

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_set_up_commands_are_those_of_the_ci_script():
    script = (ROOT / ".ci/run").read_text(encoding="utf-8").splitlines()
    commands = [line for block in blocks("sh") for line in block.splitlines() if line.startswith("python3 -m venv")]
    assert len(commands) == 2
    assert [line for line in script if line.startswith("python3 -m venv")] == commands
    assert "hdassist check vzp160" in commands[0]
    assert "pytest" in commands[1]


def test_python_example_runs(capsys):
    (code,) = blocks("python")
    exec(compile(code, "README.md", "exec"), {})
    told = capsys.readouterr().out
    assert re.match(r"F'_ior = \d+\.\d\d arcsec over 20200 states\nlargest relative residual: .*e-1\d\n$", told)


def test_commands_that_it_names_exist():
    commands = {re.sub(r" .*", "", line[9:]) for line in re.findall(r"^hdassist .*", README, flags=re.MULTILINE)}
    assert commands <= {*COMMANDS}
    assert "vzp160" in preset_names()


def test_pages_that_it_names_are_there_and_each_is_named():
    named = set(re.findall(r"\]\(docs/([a-z0-9_]+\.md)\)", README))
    assert named == {page.name for page in (ROOT / "docs").glob("*.md")} - {"index.md"}  # the site's start


def test_public_names_are_there_with_their_types():
    for name in hdassist.__all__:
        assert getattr(hdassist, name) is not None
    stub = (ROOT / "hdassist/__init__.pyi").read_text(encoding="utf-8")
    assert sorted(re.findall(r"(?: as (?=\w+$)|^(?=\w+: ))(\w+)", stub, re.MULTILINE)) == sorted(hdassist.__all__)
