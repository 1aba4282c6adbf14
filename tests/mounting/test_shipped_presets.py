"""Every shipped preset, one without any phase and one of a data sheet have a hole and a card before any value."""

import pytest

from hdassist import load_preset, preset_names
from hdassist.drive.loading import load_text, similar_preset
from hdassist.drive.preset.knowledge import read_requirements
from hdassist.features.mounting.advice import advise
from hdassist.interface.pages.report import card_text
from hdassist.run.run import UNCHECKED
from tests.helpers.advices import card

WITHOUT_PHASES = tuple(f"phases.{name}=unknown" for name in ("xi_g", "xi_b", "phi_hb", "phi_hh"))


def drive_of(name, more):
    if name != "own.yaml":
        return load_preset(name, more)
    like = load_preset("vzp160")
    sheet = read_requirements(like, ratio=100, pitch_diameter="63.5 mm", torque="67")
    return load_text(similar_preset("own", like, sheet), name, more)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "more"), [*((name, ()) for name in preset_names()), ("vzp160", WITHOUT_PHASES), ("own.yaml", ())], ids=str
)
def test_mount_names_a_hole_and_makes_a_card_of(name, more):
    M_g = drive_of(name, ()).operation.M_g[0]
    drive = drive_of(name, ["mounting.holes=2", f"operation.M_g={M_g}", *more])
    advice = advise(drive, (0.0, 180.0), draws=2, run=UNCHECKED)
    assert not advice.fault and advice.samples is not None
    assert advice.chosen.hole in (0, 1)
    assert (advice.word == "ANY_HOLE") is (more != () or not name.startswith(("vzp160", "synthetic")))
    made = card_text(card(advice))
    assert {"TURN": "TURN", "LEAVE": "LEAVE", "BEST_BET": "BEST BET", "ANY_HOLE": "ANY HOLE"}[advice.word] in made
