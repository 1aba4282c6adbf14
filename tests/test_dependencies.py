"""What is needed is told with its reason, and comes under licences that a commercial user can take."""

import re
import tomllib
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

ROOT = Path(__file__).parents[1]
FREE = re.compile(r"MIT|BSD|Apache|ISC|PSF|Python Software Foundation|Zlib|CC0|MPL|Unlicense", re.IGNORECASE)
BARRED = re.compile(r"\bA?GPL|LGPL|SSPL|Commercial|Proprietary", re.IGNORECASE)


def needed() -> set[str]:
    pyproject = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    required = re.search(r"^dependencies = \[(.*?)\]", pyproject, flags=re.DOTALL | re.MULTILINE)
    assert required
    return {re.sub(r"[^A-Za-z0-9_.-].*", "", item) for item in re.findall(r'"(.*?)"', required[1])}


def licence(name: str) -> str:
    told = distribution(name).metadata
    classifiers = [text for text in told.get_all("Classifier") or [] if text.startswith("License")]
    return told.get("License-Expression") or " ".join(classifiers) or (told.get("License") or "")[:200]


def everything(names: set[str]) -> set[str]:
    """The packages, and what they need here in turn."""
    found: set[str] = set()
    left = set(names)
    while left:
        name = re.sub(r"[-_.]+", "-", left.pop()).lower()
        try:
            wants = distribution(name).requires or []
        except PackageNotFoundError:  # of another system or Python
            continue
        found.add(name)
        plain = {re.match(r"[A-Za-z0-9_.-]+", want)[0] for want in wants if "extra ==" not in want}
        left |= {other for other in plain if re.sub(r"[-_.]+", "-", other).lower() not in found}
    return found


def test_each_has_its_reason_and_licence() -> None:
    page = (ROOT / "docs/developers.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| ([a-z0-9.-]+) \| .* \| ([^|]+) \|$", page, flags=re.MULTILINE))
    rows = {name: told for name, told in rows.items() if name not in ("package", "---")}
    assert set(rows) == needed()
    for name, told in rows.items():
        assert told.split("-")[0].lower() in licence(name).lower(), name


def test_no_version_of_jinja2_with_known_advisories_is_let_in() -> None:
    # CVE-2024-22195, -34064, -56201, -56326 and CVE-2025-27516 end with 3.1.6
    pyproject = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert "jinja2>=3.1.6" in pyproject["project"]["dependencies"]


def test_each_extra_is_told() -> None:
    page = (ROOT / "docs/developers.md").read_text(encoding="utf-8")
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    assert {"fuzz", "docs"} <= set(extras)
    assert set(re.findall(r"`hdassist\[(\w+)\]`", page)) == set(extras)


def test_nothing_comes_with_them_under_a_licence_that_binds() -> None:
    names = everything(needed())
    assert {"numpy", "clarabel", "pydantic-core"} <= names
    for name in names:
        assert FREE.search(licence(name)), f"{name}: {licence(name)}"
        assert not BARRED.search(licence(name)), f"{name}: {licence(name)}"
