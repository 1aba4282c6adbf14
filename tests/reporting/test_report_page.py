"""The report in a browser: two A4 pages on paper, and on a screen nothing outside of it."""

from __future__ import annotations

import pytest

from hdassist import load_preset
from hdassist.features.preset_comparison import sheet_of
from hdassist.interface.pages.report import drive_report, report_html
from tests.helpers.browser import A4_POINTS, needs_browser, on_screen, printed

pytestmark = needs_browser
DRIVES = {"small": "tests/data/small.yaml", "vzp160": "vzp160"}


@pytest.fixture(scope="module", params=DRIVES)
def report(request) -> str:
    sheet = sheet_of(load_preset(DRIVES[request.param]), draws=16)
    return report_html(drive_report(sheet, draws=16, seed=0))


def test_it_prints_on_two_pages(report, tmp_path):
    pages = printed(report, tmp_path)
    assert [(round(page.width), round(page.height)) for page in pages] == [A4_POINTS] * 2
    assert [page.words_outside() for page in pages] == [[], []]


@pytest.mark.parametrize("width_px", [390, 800, 1280])
def test_it_fits_the_screen(report, tmp_path, width_px):
    screen = on_screen(report, width_px, tmp_path)
    assert screen.width <= width_px
    assert screen.outside == []


WIDE = """<!DOCTYPE html><style>@page { size: A4; margin: 0 }</style>
<p style="white-space: nowrap; margin-left: %s">A line of words</p>"""


def test_what_is_outside_is_seen(tmp_path):
    [page] = printed(WIDE % "570pt", tmp_path)
    assert page.words_outside()
    assert on_screen(WIDE % "380px", 390, tmp_path).outside == ["A line of words"]
    assert on_screen(WIDE % "100px", 390, tmp_path).outside == []
