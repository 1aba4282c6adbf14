"""Every state that is solved stands in the proof of the answer."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from hdassist import load_preset
from hdassist.mounting.advice import advise
from hdassist.mounting.positions import seat_positions
from hdassist.planning import choose_plan
from hdassist.preset.fields import Drive
from hdassist.run.run import UNCHECKED
from hdassist.solve import answers
from hdassist.solve.answers import Certificate
from tests.process import TINY

LIMITED = ("operation.M_g=[4]", "acceptance.F_ior=2000", "mounting.holes=6")
ANSWERS: dict[str, Callable[[Drive], Certificate]] = {
    "mount": lambda drive: advise(drive, seat_positions(drive), draws=0, run=UNCHECKED).certificate,
    "plan": lambda drive: choose_plan(drive, draws=0, run=UNCHECKED).certificate,
}


@pytest.mark.parametrize("command", ["mount", "plan"])
def test_all_solved_states_are_reported(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    solved = 0

    def counted(*values: float, **sums: float) -> Certificate:
        nonlocal solved
        if values:  # a proof of new states, and no sum of proofs
            solved += int(values[0])
        return Certificate(*values, **sums)

    drive = load_preset(TINY, LIMITED)
    monkeypatch.setattr(answers, "Certificate", counted)
    reported = ANSWERS[command](drive)
    assert reported.states == solved > 0
