"""Hidden characters are written out, all that is seen stays."""

from __future__ import annotations

import sys
import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from hdassist.run.files import printable, visible

TURNS = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}  # of Unicode's bidi classes
WIDTHLESS = set("\u200b\u200c\u200d\u200e\u200f\u2060\ufeff\u061c\u00ad\u180e")


def hidden(text: str) -> set[str]:
    """What of a text steers a terminal or hides, by Unicode's own tables; newlines and tabs may stand."""
    found = {c for c in text if unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp")}
    return (found | {c for c in text if unicodedata.bidirectional(c) in TURNS or c in WIDTHLESS}) - set("\n\t")


EVERY_HIDDEN = "".join(sorted(hidden("".join(map(chr, range(sys.maxunicode + 1))))))


def test_every_hidden_character_is_escaped_and_can_be_told() -> None:
    told = visible(EVERY_HIDDEN)
    assert told.isascii() and told.isprintable()
    assert told.encode().decode("unicode_escape") == EVERY_HIDDEN
    assert visible("a\x1b[2J\u202eb") == "a\\x1b[2J\\u202eb"


def test_what_is_seen_stays() -> None:
    seen = "Привод №5, Müller\n\t20±1 N·m, 5 µm × 3 ≤ 4 −1 1\u00a0000 ⣿⠁ ─┼│ 減速機 عربي 🙂"
    assert visible(seen) == seen


@given(st.text())
def test_nothing_hidden_is_left_and_the_rest_is_the_same(text: str) -> None:
    told = visible(text)
    assert not hidden(told)
    assert visible(told) == told
    assert told == text or hidden(text) or any(unicodedata.category(c) in ("Cf", "Cn") for c in text)


def test_json_is_printable_and_the_same() -> None:
    assert printable('"\x7f"') == '"\\u007f"'
