"""Choices of holes for tests of cards and pages, constructed without solving any mesh position."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import date

import numpy as np

from hdassist import load_preset
from hdassist.drive.model.deviations import MeasuredTeeth, MeasuredWheel, PitchFile, no_hole_better
from hdassist.drive.solve.answers import EMPTY
from hdassist.features.mounting.advice import Advice
from hdassist.features.mounting.decision import Decision
from hdassist.features.mounting.positions import MountingCurve
from hdassist.features.mounting.posterior import Trial, TrialSetup
from hdassist.interface.pages.card import Card, card_of
from hdassist.interface.pages.mount import mount_warnings
from hdassist.interface.terminal.words import texts
from hdassist.readers.pitch import ASSUMED
from tests.helpers.process import SMALL

MADE = date(2026, 3, 9)
LIGHT = [28.09, 29.5, 30.8, 31.44, 30.0, 27.0, 24.0, 17.0, 14.94, 18.16, 21.0, 25.0]
QUARTERS = [k / 4 for k in range(1, 15)]
HEAVY = [8.09, 9.0, 11.0, 12.62, 11.0, 9.0, 7.0, 5.0, 4.52, 2.9, 4.0, 6.0]
PITCH = PitchFile(np.zeros(62), 17, None, "wheel.csv", "0123456789abcdef", (ASSUMED["sense"][1],))
TEETH = MeasuredTeeth(b=MeasuredWheel(PITCH, 33.0))


def advice_of(*values: list[float], rotations: list[float] | None = None, overrides: tuple[str, ...] = (), **options):
    """Return a choice of a hole for the small drive with given F'_ior.

    values: F'_ior at each position [arcsec], one list per torque.
    rotations: positions [deg]; None for evenly spaced positions.
    overrides: fields of the preset in the form of --set.
    options: torques [N*m], if they are not powers of 10.
    """
    values = values or (LIGHT, HEAVY)
    torques = options.pop("torques", tuple(float(10**k) for k in range(len(values))))
    drive = load_preset(SMALL, [*overrides, f"operation.M_g={list(torques)}"])
    found = np.array(values)
    turns = np.array(rotations or [360.0 * k / found.shape[1] for k in range(found.shape[1])])
    holes, allowed = drive.mounting.holes, drive.mounting.allowed
    curve = MountingCurve(
        torques, turns, turns, found, EMPTY, (), np.ones(found.shape, dtype=bool), holes=holes,
        allowed=None if allowed == "all" else allowed,
    )  # fmt: skip
    found = replace(Decision.as_given(curve), all_alike=bool(no_hole_better(drive)))
    return Advice(drive, found, TrialSetup(torques[0]), curve)


def sampled(advice: Advice, spread: float = 0.02, seed: int = 1) -> Advice:
    """Return the choice with 50 samples of its curve.

    spread: relative standard deviation of the samples.
    """
    given = advice.decision
    noise = 1 + spread * np.random.default_rng(seed).standard_normal((1, 50, len(given.rotations_deg)))
    now = np.repeat(given.now_arcsec, 50, axis=1)
    found = Decision(given.rotations_deg, given.F_ior_arcsec * noise, now, np.ones(50))
    return replace(advice, decision=found, open_=("gears.j_n",) * 3)


def cards() -> dict[str, Advice]:
    """Return choices, by name, whose cards use every text of the catalogue of messages."""
    free = [float(k) for k in range(0, 360, 30)]
    fixed = "mounting.fixed=flexspline"
    many = [[v * (1 + k) for v in LIGHT] for k in range(14)]
    return {
        "plain": advice_of(),
        "sampled": sampled(advice_of()),
        "leave": advice_of([10.0, 11.0, 12.0], overrides=("mounting.holes=3",)),
        "any": sampled(advice_of([10.0, 10.0, 10.0], overrides=("mounting.holes=3",)), spread=1e-3),
        "not sure": sampled(advice_of([10.0, 11.5, 13.0], overrides=("mounting.holes=3",)), spread=0.3),
        "allowed": advice_of(
            [28.0, 9.0, 20.0, 30.0], rotations=[0.0, 60.0, 90.0, 270.0], overrides=("mounting.allowed=[2,3,9]",)
        ),
        "free": advice_of(
            [*LIGHT, 14.5], rotations=[*free, 245.3], overrides=("mounting.holes=0", "mounting.mark_kind=pitch")
        ),
        "flexspline": advice_of(overrides=(fixed, "tolerances.e_hg=20", "mounting.mark_kind=runout")),
        "many": sampled(advice_of(*many, torques=tuple(QUARTERS), overrides=("phases.xi_b=10",))),
        "measured": replace(
            advice_of(overrides=("mounting.holes=0",)), measured=TEETH
        ),
        "fine": advice_of(
            [20.0 + 10 * float(np.cos(k / 57.3)) for k in range(360)], overrides=("mounting.holes=360",)
        ),
    }  # fmt: skip


def crowded(advice: Advice) -> Advice:
    """Return the choice for a drive with a long name, long warnings and many overrides."""
    drive = advice.drive.model_copy(update={"name": "Long name of a drive " * 9})
    drive._origin = replace(
        advice.drive.origin, warnings=("a limit at a torque that is not in operation.M_g; " * 9,) * 6,
        overrides=("tolerances.F_i1=60", "phases.xi_b=10") * 20,
    )  # fmt: skip
    return replace(advice, drive=drive)


TRIALS = [Trial(0.0, 28.1), Trial(120.0, 17.35), Trial(245.3, 24.9)] * 3  # more values than a card has room for


def card(advice: Advice, language: str = "en", serial: str = "", trials: Sequence[Trial] = ()) -> Card:
    say, warnings = texts(language), mount_warnings(advice, texts(language))
    return card_of(replace(advice, trials=tuple(trials)), say, warnings, serial=serial, made=MADE)
