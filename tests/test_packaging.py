"""Presets and command are found from a wheel, and from an editable install."""

import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import yaml

from hdassist import __version__
from tests.helpers.support import HAS_COMPILER

ROOT = Path(__file__).parents[1]


def build(folder: Path, target: str = "build_wheel", compiler: str = "cc") -> Path:
    """Build a wheel without the network, by the build backend that is installed, and unpack it."""
    code = f"from hatchling import build; build.{target}({str(folder)!r})"
    env = os.environ | {"CC": compiler}
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True, env=env)
    (wheel,) = folder.glob("*.whl")
    site = folder / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    return site


def test_version_changelog_and_citation_are_of_one_release() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    unreleased, release = re.findall(r"^## (.*)$", changelog, re.MULTILINE)[:2]
    assert unreleased == "Unreleased"
    number, date = re.fullmatch(r"(\S+) \((\d{4}-\d\d-\d\d)\)", release).groups()
    assert number == __version__ or __version__.endswith(".dev0")  # towards the next one
    citation = yaml.safe_load((ROOT / ".github/CITATION.cff").read_text(encoding="utf-8"))
    assert (citation["version"], str(citation["date-released"])) == (number, date)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel, unpacked; it was built beside a stray library."""
    stray = ROOT / f"hdassist/drive/solve/stray_{os.getpid()}.so"  # each worker of a distributed run has its own
    stray.touch()
    try:
        return build(tmp_path_factory.mktemp("wheel"))
    finally:
        stray.unlink()


def require_presets(site: Path, home: Path) -> None:
    """Presets and package are found below a folder in a Python that has a site folder and nothing else of this one."""
    # -I: nothing of this environment but its packages; .pth files of the editable wheel are read by addsitedir
    code = (
        f"import site, sys; site.addsitedir({str(site)!r}); sys.path.insert(0, {str(site)!r})\n"
        "import hdassist\n"
        "from hdassist import load_preset, preset_names\n"
        "print(hdassist.__file__); print(*preset_names()); print(load_preset('vzp160').gears.z_g)\n"
    )
    others = os.pathsep.join(p for p in sys.path if p.endswith("site-packages"))
    result = subprocess.run(
        [sys.executable, "-I", "-c", f"import sys; sys.path.append({others!r})\n{code}"],
        cwd=site, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    found, names, teeth = result.stdout.splitlines()
    assert Path(found).is_relative_to(home)
    assert {"vzp160", "synthetic-160-162"} <= set(names.split())
    assert teeth == "200"


@pytest.mark.thorough
def test_presets_are_found_in_a_wheel(wheel):
    require_presets(wheel, wheel)


@pytest.mark.thorough
def test_presets_are_found_in_an_editable_install(tmp_path):
    require_presets(build(tmp_path, "build_editable", "/bin/false"), ROOT)  # no library of this tree is made anew


@pytest.mark.thorough
def test_wheel_holds_the_presets_as_they_are(wheel):
    shipped = {p.name: p.read_bytes() for p in (wheel / "hdassist/presets").glob("*.yaml")}
    assert shipped == {p.name: p.read_bytes() for p in (ROOT / "presets").glob("*.yaml")}
    for folder in ("hdassist/interface/pages/templates", "hdassist/interface/terminal/languages"):
        data = [p.name for p in (ROOT / folder).iterdir()]
        assert data
        assert all((wheel / folder / name).read_bytes() == (ROOT / folder / name).read_bytes() for name in data)
    assert (wheel / "hdassist/py.typed").exists()  # types of the package are for its users too
    (metadata,) = wheel.glob("*.dist-info/METADATA")
    assert "Requires-Python: >=3.11" in metadata.read_text()
    assert not list(wheel.glob("tests"))
    assert not list(wheel.rglob("stray*"))


@pytest.mark.thorough  # installing the project, which comes before any test, compiles as well
@pytest.mark.skipif(not HAS_COMPILER, reason="needs a compiler")
def test_a_wheel_is_compiled_where_there_is_a_compiler(wheel):
    assert [*wheel.parent.glob("*.whl")] and not [*wheel.parent.glob("*-py3-none-any.whl")]
    libraries = list((wheel / "hdassist/drive/solve").glob("_walk_*"))
    assert libraries
    assert all(library.stat().st_size for library in libraries)


def test_a_wheel_is_pure_where_there_is_no_compiler(tmp_path):
    site = build(tmp_path, compiler="/bin/false")
    assert [*tmp_path.glob("*-py3-none-any.whl")]
    assert not list((site / "hdassist/drive/solve").glob("_walk_*"))
