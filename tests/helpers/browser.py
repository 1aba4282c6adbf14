"""Layout of pages by a browser: printed on paper, and on a screen of a given width.

This needs Chromium and pdftotext of poppler; `.ci/run pages` installs both.
"""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import pytest

if TYPE_CHECKING:
    from pathlib import Path

CHROMIUM, PDFTOTEXT = shutil.which("chromium"), shutil.which("pdftotext")
A4_POINTS = (595, 842)
XHTML = "{http://www.w3.org/1999/xhtml}"
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update",
)  # fmt: skip
MEASURE = """
addEventListener("load", () => {
    const frame = document.getElementById("page"), page = frame.contentDocument;
    const outside = [], texts = page.createTreeWalker(page.body, NodeFilter.SHOW_TEXT);
    while (texts.nextNode()) {
        const text = texts.currentNode, range = page.createRange();
        if (!text.data.trim() || scrolls(text.parentElement, page.body)) continue;
        range.selectNodeContents(text);
        if ([...range.getClientRects()].some(box => box.left < -1 || box.right > frame.clientWidth + 1))
            outside.push(text.data.trim().slice(0, 60));
    }
    document.getElementById("result").textContent =
        JSON.stringify({width: page.documentElement.scrollWidth, outside: outside});
});
function scrolls(element, body) {  // inside a box that the reader can scroll sideways
    for (let box = element; box && box != body; box = box.parentElement)
        if (["auto", "scroll"].includes(getComputedStyle(box).overflowX)) return true;
    return false;
}
"""

needs_browser = pytest.mark.browser


@dataclass(frozen=True)
class PrintedPage:
    """A printed page.

    width, height: size of the page [points].
    words: words with the left, top, right and bottom of their boxes [points].
    """

    width: float
    height: float
    words: list[tuple[str, float, float, float, float]]

    def words_outside(self) -> list[str]:
        """Return the words that extend beyond the paper."""
        return [
            word
            for word, left, top, right, bottom in self.words
            if left < 0 or top < 0 or right > self.width or bottom > self.height
        ]


@dataclass(frozen=True)
class Screen:
    """A page on a screen.

    width: width of the page [px].
    outside: texts that extend beyond the screen.
    """

    width: int
    outside: list[str]


def printed(text: str, folder: Path) -> list[PrintedPage]:
    """Return the pages of an HTML text as printed by Chromium.

    Args:
        text: HTML page.
        folder: folder for the page, the PDF and the profile of the browser.
    """
    page, paper, layout = folder / "page.html", folder / "page.pdf", folder / "page.xml"
    page.write_text(text, encoding="utf-8")
    _chromium(folder, f"--print-to-pdf={paper}", "--no-pdf-header-footer", page.as_uri())
    subprocess.run([str(PDFTOTEXT), "-bbox", str(paper), str(layout)], check=True, capture_output=True, timeout=60)
    pages = []
    for sheet in ElementTree.parse(layout).iter(f"{XHTML}page"):
        words = []
        for word in sheet.iter(f"{XHTML}word"):
            left, top, right, bottom = (float(word.attrib[key]) for key in ("xMin", "yMin", "xMax", "yMax"))
            words.append((word.text or "", left, top, right, bottom))
        pages.append(PrintedPage(width=float(sheet.attrib["width"]), height=float(sheet.attrib["height"]), words=words))
    return pages


def on_screen(text: str, width_px: int, folder: Path) -> Screen:
    """Return the layout of an HTML text on a screen of a given width.

    The screen is a frame, because windows of browsers are at least 500 px wide.

    text: HTML page.
    width_px: width of the screen [px].
    folder: folder for the page and the profile of the browser.
    """
    frame = f'<iframe id="page" style="width:{width_px}px;height:900px;border:0" srcdoc="{html.escape(text)}"></iframe>'
    page = folder / "screen.html"
    page.write_text(
        f'<!DOCTYPE html><meta charset="utf-8"><pre id="result"></pre>{frame}<script>{MEASURE}</script>',
        encoding="utf-8",
    )
    document = _chromium(folder, "--window-size=1600,1200", "--virtual-time-budget=5000", "--dump-dom", page.as_uri())
    result = re.search(r'<pre id="result">(.*?)</pre>', document, flags=re.DOTALL)
    assert result is not None, document[:500]
    return Screen(**json.loads(html.unescape(result.group(1))))


def _chromium(folder: Path, *arguments: str) -> str:
    """Run the browser, and return its standard output."""
    assert CHROMIUM, "there is no chromium: .ci/run pages installs it"
    command = [CHROMIUM, *OPTIONS, f"--user-data-dir={folder / 'profile'}", *arguments]
    done = subprocess.run(command, check=True, capture_output=True, timeout=120)
    return done.stdout.decode("utf-8")
