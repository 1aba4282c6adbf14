"""The card on paper: exactly one A4 page, as a browser prints it."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

from hdassist.pages.report import card_html, lines_on_paper
from hdassist.terminal.words import languages
from tests.advices import card, cards, crowded

CHROMIUM = shutil.which("chromium")
CARDS = cards()
PAGES = {"sampled": CARDS["sampled"], "leave": CARDS["leave"], "crowded": crowded(CARDS["many"])}


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium")
@pytest.mark.parametrize("language", languages())
@pytest.mark.parametrize("name", PAGES)
def test_it_prints_on_one_page(tmp_path, name, language):
    page, paper = tmp_path / "card.html", tmp_path / "card.pdf"
    page.write_text(card_html(card(PAGES[name], language, serial="17-042")), encoding="utf-8")
    subprocess.run(
        [
            str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
            "--disable-background-networking", "--disable-component-update", "--disable-sync",
            f"--user-data-dir={tmp_path / 'profile'}", f"--print-to-pdf={paper}", page.as_uri(),
        ],
        check=True, capture_output=True, timeout=120,
    )  # fmt: skip
    assert re.findall(rb"/Count (\d+)", paper.read_bytes()) == [b"1"]
    (box,) = set(re.findall(rb"/MediaBox ?\[([^]]*)\]", paper.read_bytes()))
    assert [round(float(x)) for x in box.split()] == [0, 0, 595, 842]  # A4, in points


def test_letters_shrink_only_where_they_must():
    def size(name: str, language: str = "en") -> float:
        """As the style sheet has it, against the full size."""
        return min(1, 277 / (183 + 3.75 * lines_on_paper(card(PAGES[name], language))))

    assert "min(10pt, calc(2770pt / (183 + 3.75 * var(--lines))))" in card_html(card(PAGES["leave"]))
    assert size("leave") == size("sampled") == 1
    assert 0.5 < size("crowded", "ru") < 1
