"""Presets and command are found from a wheel, and from an editable install."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def build(tmp_path: Path, target: str) -> Path:
    """Build a wheel without the network, by the build backend that is installed."""
    code = f"from hatchling import build; build.{target}({str(tmp_path)!r})"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    site = tmp_path / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    return site


@pytest.mark.parametrize("target", ["build_wheel", "build_editable"])
def test_presets_are_found(tmp_path, target):
    site = build(tmp_path, target)
    # -S -E: nothing of this environment but its packages; .pth files of the editable wheel are read by addsitedir
    code = (
        f"import site, sys; site.addsitedir({str(site)!r}); sys.path.insert(0, {str(site)!r})\n"
        "import hdassist\n"
        "from hdassist import load_preset, preset_names\n"
        "print(hdassist.__file__); print(*preset_names()); print(load_preset('vzp160').gears.z_g)\n"
    )
    others = os.pathsep.join(p for p in sys.path if p.endswith("site-packages"))
    result = subprocess.run(
        [sys.executable, "-I", "-c", f"import sys; sys.path.append({others!r})\n{code}"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    home, names, teeth = result.stdout.splitlines()
    assert Path(home).is_relative_to(site if target == "build_wheel" else ROOT)
    assert {"vzp160", "synthetic-160-162"} <= set(names.split())
    assert teeth == "200"


def test_wheel_holds_the_presets_as_they_are(tmp_path):
    site = build(tmp_path, "build_wheel")
    shipped = {p.name: p.read_bytes() for p in (site / "hdassist/presets").glob("*.yaml")}
    assert shipped == {p.name: p.read_bytes() for p in (ROOT / "presets").glob("*.yaml")}
    for folder in ("hdassist/mounting/templates", "hdassist/reporting/templates", "hdassist/terminal/languages"):
        data = [p.name for p in (ROOT / folder).iterdir()]
        assert data
        assert all((site / folder / name).read_bytes() == (ROOT / folder / name).read_bytes() for name in data)
    assert (site / "hdassist/py.typed").exists()  # types of the package are for its users too
    (metadata,) = site.glob("*.dist-info/METADATA")
    assert "Requires-Python: >=3.11" in metadata.read_text()
    assert not list(site.glob("tests"))


@pytest.mark.parametrize("pure", [False, True])
def test_a_wheel_is_compiled_where_there_is_a_compiler_and_pure_where_not(tmp_path, monkeypatch, pure):
    monkeypatch.setenv("CC", "/bin/false" if pure else "cc")
    stray = ROOT / "hdassist/solve/stray.so"  # not by a name that a process beside this one would load
    stray.touch()
    try:
        site = build(tmp_path, "build_wheel")
    finally:
        stray.unlink()
    (wheel,) = tmp_path.glob("*.whl")
    compiled = not pure and shutil.which("cc") is not None
    assert wheel.name.endswith("-py3-none-any.whl") is not compiled
    libraries = list((site / "hdassist/solve").glob("_walk_*"))
    assert not (site / "hdassist/solve/stray.so").exists()
    assert bool(libraries) is compiled
    assert all(library.stat().st_size for library in libraries)
