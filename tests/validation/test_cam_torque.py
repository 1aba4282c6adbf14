"""Torque of the balls on the cam by number of teeth: M_g/u by virtual work, which nothing in (1) was given."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.loading import load_text, similar_preset
from hdassist.drive.model.contacts import ContactSystems
from hdassist.drive.preset.knowledge import PITCH_DIAMETER, SimilarValue
from tests.helpers.support import changed, solve_state
from tests.validation.case import Case, Kind, about, parameters
from tests.validation.whole_flanks import whole_flanks

TITLE = "Torque on the wave generator"
ABOUT = (
    "By the principle of virtual work, the torque on the wave generator is the output torque divided by the ratio, "
    "M_g/u. The equilibrium of the contacts (equation (1) of [theory](theory.md#equilibrium-of-the-contacts)) does "
    "not contain this condition, so it is an independent check of the geometry, the moment arm and the signs. The "
    "torque is computed from the ball forces Q_k as the sum of 2 W_0 Q_k sin 2 theta_k over all balls.\n\nThe table "
    "gives the ratio of the computed torque to M_g/u, averaged over 4 tooth phases and 4 ball phases. The drives are "
    "similar to `vzp160`, without deviations, at 80 N·m. The ratio is below 1 by about W_0/r for whole flanks, and by "
    "half of this for coned flanks."
)
WAVE = 2.4  # W_0 over the pitch radius, times z_g: a wave of 1.2 modules
PHASES = (0.0, 0.25, 0.5, 0.75)  # of the teeth and of the balls
TORQUE = 80e3  # N*mm


def share(z_g: int, stations: int) -> float:
    """Torque on the cam over M_g/u, mean over the phases: a drive like vzp160 as identified with such flanks."""
    like = whole_flanks() if stations == 1 else load_preset("vzp160")
    # the bearing without clearance, as in vzp160: a drive by similarity would have the usual one of its size
    given = {"gears.z_g": z_g, PITCH_DIAMETER: 160.0, "operation.rated": 800.0, "bearing.g_b": like.bearing.g_b}
    required = {path: SimilarValue(value, "given", "") for path, value in given.items()}
    text = similar_preset(f"teeth-{z_g}", like, required)
    drive = changed(load_text(text, f"teeth-{z_g}"), numerics__stations=stations)
    systems, found = ContactSystems(drive), []
    for tau, beta in product(PHASES, PHASES):
        system = systems.at(tau, beta)
        forces, _, _ = solve_state(system, TORQUE, system.delta_p)
        found.append(forces[system.balls] @ (2 * system.geometry.W_0 * np.sin(2 * system.ball_theta)))
    return float(np.mean(found) * z_g / 2 / TORQUE)


CASES = [
    Case(
        f"{z_g} teeth, {words} flanks",
        "",
        f"1 minus {law}",
        **about(1 - WAVE * part / z_g, 0.005),
        why="This law describes the computed values. It was not derived",
        kind=Kind.MODEL,
        digits=".3f",
        value=lambda z_g=z_g, n=n: share(z_g, n),
        slow=z_g == 96 or n > 1,
    )
    for words, n, part, law in (("whole", 1, 1.0, "W_0/r"), ("coned", 5, 0.5, "W_0/2r"))
    for z_g in (200, 96, 51)
]


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case: Case) -> None:
    case.check()
