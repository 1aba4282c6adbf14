"""Every state that is solved stands in the proof of the answer."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from hdassist import load_preset
from hdassist.drive.preset.fields import Drive
from hdassist.drive.solve import answers
from hdassist.drive.solve.answers import Certificate, Residuals
from hdassist.features.mounting.advice import advise
from hdassist.features.mounting.positions import seat_positions
from hdassist.features.planning import choose_plan
from hdassist.run.run import UNCHECKED
from tests.helpers.process import TINY

LIMITED = ("operation.M_g=[4]", "acceptance.F_ior=2000", "mounting.holes=6")
ANSWERS: dict[str, Callable[[Drive], Certificate]] = {
    "mount": lambda drive: advise(drive, seat_positions(drive), draws=0, run=UNCHECKED).certificate,
    "plan": lambda drive: choose_plan(drive, draws=0, run=UNCHECKED).certificate,
}


@pytest.mark.parametrize("command", ["mount", "plan"])
def test_all_solved_states_are_reported(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    solved = 0
    require_proof = answers._require_small_residuals

    def counted(proof: Residuals, place: Callable[[int], str], first: int) -> None:
        nonlocal solved
        solved += len(proof.shares)
        require_proof(proof, place, first)

    drive = load_preset(TINY, LIMITED)
    monkeypatch.setattr(answers, "_require_small_residuals", counted)
    reported = ANSWERS[command](drive)
    assert reported.states == solved > 0
