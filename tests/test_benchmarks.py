"""benchmarks/: every module can be imported, and all that it imports later on is there; mypy looks at its calls."""

import ast
import pkgutil
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

import benchmarks

FOLDER = Path(benchmarks.__file__).parent
MODULES = sorted(each.name for each in pkgutil.iter_modules([str(FOLDER)]))


@pytest.mark.parametrize("name", MODULES)
def test_all_that_a_benchmark_imports_is_there(name: str) -> None:
    module = import_module(f"benchmarks.{name}")
    tree = ast.parse(Path(module.__file__ or "").read_text(encoding="utf-8"))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.module != "__future__"]
    wanted = {(node.module or "", each.name) for node in imports for each in node.names}
    missing = {
        f"{source}.{what}"
        for source, what in wanted
        if not hasattr(import_module(source), what) and f"benchmarks.{what}" not in {f"{source}.{n}" for n in MODULES}
    }
    assert missing == set()


def test_mypy_looks_at_the_calls_of_every_benchmark() -> None:
    config = tomllib.loads((FOLDER.parent / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]
    assert "benchmarks" in config["packages"]
    assert config["strict"]
