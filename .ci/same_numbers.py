"""Compare the numbers of two answers in JSON: equal to 1e-8 of the larger one, or of one. Usage: FILE FILE."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

MOST = 1e-8
OWN = ("seconds", "version", "created")  # of the run, not of the answer


def numbers(value: Any, place: str = "") -> Iterator[tuple[str, float]]:
    """Numbers of an answer with their places."""
    if isinstance(value, dict):
        for key, inner in value.items():
            if key not in OWN:
                yield from numbers(inner, f"{place}.{key}")
    elif isinstance(value, list):
        for item, inner in enumerate(value):
            yield from numbers(inner, f"{place}[{item}]")
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield place, float(value)


def main() -> None:
    """Print how many numbers there are and how far apart; end with 1 where they do not agree."""
    first, second = (dict(numbers(json.loads(Path(name).read_text("utf-8")))) for name in sys.argv[1:])
    if first.keys() != second.keys():
        raise SystemExit(f"other numbers: {sorted(first.keys() ^ second.keys())[:10]}")
    apart = {}
    for place, number in first.items():
        apart[place] = abs(number - second[place]) / max(1.0, abs(number), abs(second[place]))
    farthest = max(apart, key=lambda place: apart[place])
    print(f"{len(first)} numbers, at most {apart[farthest]:.1e} apart ({farthest})")
    if apart[farthest] > MOST:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
