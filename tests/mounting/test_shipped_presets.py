"""Every shipped preset, and one without any phase, has a hole and a card before any value; few draws, two holes."""

import pytest

from hdassist import load_preset, preset_names
from hdassist.mounting.advice import advise
from hdassist.pages.report import card_text
from hdassist.run.run import UNCHECKED
from tests.advices import card

WITHOUT_PHASES = tuple(f"phases.{name}=unknown" for name in ("xi_g", "xi_b", "phi_hb", "phi_hh"))


@pytest.mark.parametrize(
    ("name", "more"), [*((name, ()) for name in preset_names()), ("vzp160", WITHOUT_PHASES)], ids=str
)
def test_mount_names_a_hole_and_makes_a_card_of(name, more):
    M_g = load_preset(name).operation.M_g[0]
    drive = load_preset(name, ["mounting.holes=2", f"operation.M_g={M_g}", *more])
    advice = advise(drive, (M_g,), (0.0, 180.0), draws=1, run=UNCHECKED)
    assert not advice.fault and advice.samples is not None
    assert advice.choice.target.hole in (0, 1)
    assert (advice.word == "ANY_HOLE") is (more != () or not name.startswith(("vzp160", "synthetic")))
    made = card_text(card(advice))
    assert {"TURN": "TURN", "LEAVE": "LEAVE", "BEST_BET": "BEST BET", "ANY_HOLE": "ANY HOLE"}[advice.word] in made
