"""The card in a browser: exactly one A4 page on paper, and on a screen nothing outside of it."""

from __future__ import annotations

import pytest

from hdassist.interface.pages.report import card_html, lines_on_paper
from hdassist.interface.terminal.words import languages
from tests.helpers.advices import card, cards, crowded
from tests.helpers.browser import A4_POINTS, needs_browser, on_screen, printed

CARDS = cards()
PAGES = {"sampled": CARDS["sampled"], "leave": CARDS["leave"], "crowded": crowded(CARDS["many"])}


@needs_browser
@pytest.mark.parametrize("language", languages())
@pytest.mark.parametrize("name", PAGES)
def test_it_prints_on_one_page(tmp_path, name, language):
    [page] = printed(card_html(card(PAGES[name], language, serial="17-042")), tmp_path)
    assert (round(page.width), round(page.height)) == A4_POINTS
    assert page.words_outside() == []


@needs_browser
@pytest.mark.parametrize("width_px", [390, 1280])
@pytest.mark.parametrize("language", languages())
@pytest.mark.parametrize("name", PAGES)
def test_it_fits_the_screen(tmp_path, name, language, width_px):
    screen = on_screen(card_html(card(PAGES[name], language, serial="17-042")), width_px, tmp_path)
    assert screen.width <= width_px
    assert screen.outside == []


def test_letters_shrink_only_where_they_must():
    def size(name: str, language: str = "en") -> float:
        """As the style sheet has it, against the full size."""
        return min(1, 277 / (183 + 3.75 * lines_on_paper(card(PAGES[name], language))))

    assert "min(10pt, calc(2770pt / (183 + 3.75 * var(--lines))))" in card_html(card(PAGES["leave"]))
    assert size("leave") == size("sampled") == 1
    assert 0.5 < size("crowded", "ru") < 1
