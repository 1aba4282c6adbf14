"""Drawings of the bench are what the script makes, stand on a page, and count as the assembly card does."""

import re
from math import atan2, degrees

import pytest

from benchmarks.bench_pictures import DRAWINGS, FIGURES, HOLES, drawn
from hdassist.interface.pages.report import CENTRE, HOLE_CIRCLE, at


def direction(x: float, y: float) -> float:
    """Counter-clockwise from the right [deg], y downwards."""
    return degrees(atan2(-y, x)) % 360


@pytest.mark.parametrize("name", DRAWINGS)
def test_a_drawing_is_as_it_is_made_and_shown(name: str):
    assert (FIGURES / f"{name}.svg").read_text(encoding="utf-8") == drawn(name), "python -m benchmarks.bench_pictures"
    names = ("index.md", "mount.md", "measure.md")
    pages = "".join((FIGURES.parent / page).read_text(encoding="utf-8") for page in names)
    assert f"](figures/{name}.svg)" in pages


def test_holes_count_as_on_the_card():
    svg, size = drawn("bench-holes"), 16
    texts = re.findall(rf'<text x="(.*?)" y="(.*?)" [^>]*font-size="{size}">(\d+)<', svg)
    assert len(texts) == 2 * HOLES
    for half, (left, top) in ((texts[:HOLES], (180, 205)), (texts[HOLES:], (540, 205))):
        for x, y, number in half:
            drawn_at = direction(float(x) - left, float(y) - 0.36 * size - top)
            u, v = at(360 * int(number) / HOLES, HOLE_CIRCLE)
            assert abs((drawn_at - direction(u - CENTRE[0], v - CENTRE[1]) + 180) % 360 - 180) < 0.5
    (sweep,) = re.findall(r'class="go" d="M\S+ \S+A74 74 0 0 (\d) ', svg)
    assert sweep == "0"  # from hole 0 to hole 4 counter-clockwise
