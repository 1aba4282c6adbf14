"""How the tests are laid out: what folders share lies beside them, so that each can be read, moved and run alone."""

import re
from pathlib import Path

HERE = Path(__file__).parent


def test_no_test_imports_another_folders_tests():
    for file in HERE.rglob("*.py"):
        taken = re.findall(r"^(?:from|import) tests\.(\w+)", file.read_text(encoding="utf-8"), flags=re.MULTILINE)
        folders = {name for name in taken if (HERE / name).is_dir()} - {"helpers"}
        assert folders <= {file.parent.name}, file
