"""docs/tutorial.md, line by line: what it runs, what is printed, and how each command ends."""

import pytest

from tests.tutorial import require_told, told_by


@pytest.mark.slow
def test_the_way_from_a_data_sheet_to_a_card_is_as_the_page_has_it(tmp_path):
    require_told("tutorial.md", told_by("tutorial.md", tmp_path))
    card = " ".join((tmp_path / "card.txt").read_text(encoding="utf-8").split())
    assert "Turn the rigid wheel by 3 holes (90 deg) clockwise" in card
    assert "Values of the preset: 4 given, 0 identified, 29 assumed." in card
    assert "By the trials this position is good (within 5 % of the best one) with a probability of" in card
    assert "hole 9: 22.1 arcsec" in card
