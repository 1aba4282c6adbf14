"""Pages of docs/ from the code's declarations, drawings from the model: `python -m tests.reference [--check]`."""

from __future__ import annotations

import sys

from tests.reference import figures, pages


def main() -> int:
    """Write the pages; with --check only say which of them is not what would be written."""
    made = pages.made() | figures.made()
    stale = [path for path, text in made.items() if not path.exists() or path.read_text("utf-8") != text]
    if "--check" not in sys.argv:
        for path, text in made.items():
            path.write_text(text, encoding="utf-8")
        return 0
    for path in stale:
        sys.stderr.write(f"{path} is stale: python -m tests.reference\n")
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
