"""`hdassist trials`: the position of the fixed wheel from measurements in a few positions."""

import time
from dataclasses import dataclass, replace

from hdassist.commands.card import CardFile, give_with_card
from hdassist.terminal import options as o


@dataclass(frozen=True, kw_only=True)
class TrialsCommand(o.PlotOptions, o.CardOptions, o.TraceOptions, o.LoadedDriveOptions, o.TrialOptions):
    """Where to mount the fixed wheel when the direction of the cam offset is not known: trials tell.

    \b
    Examples:
      hdassist trials vzp160 h0=28.1 h4=17.3 h8=24.9
      hdassist trials own.yaml h0=28.1 h4=17.3 h8=24.9 h4=17.9 --noise 0.5
      hdassist trials own.yaml h0=28.1 h4=17.3 h8=24.9 --card card.html
      hdassist trials own.yaml h0=28.1 h4=17.3 h8=24.9 --verify h5=16.2

    Mount the fixed wheel (the rigid wheel, that is the circular spline, or the flexspline) in a few positions of its
    seat, the first three 120 deg apart, at a light torque, measure F'_ior in each and give them all: the offset of the
    cam (wave generator) is inferred, with all that is uncertain, and the best position with it. Five or six trials are
    normal; the position to measure next is named. Turns and holes count from where the wheel stood before the first
    trial, counter-clockwise seen from the cam side. Repeat one position: only that gives the noise.
    It is settled where the choice loses less than 5 % against the best position with a probability of 90 % (--sure),
    else the exit code is 6; values that the drive cannot show are refused at once (5). --verify compares the outcome
    with its prediction and with the other positions, and says keep, or go back (3), or that another may be better (6).
    -q prints the hole to be in, 0 being the first one, or unknown; before it is settled there is no card.
    In place of a value a record of the error may stand: its F'_ior and the uncertainty of that are those of hdassist
    measure, the full cycle needed. The preset's measured.F_ior at the torque is one more trial, given or not.
    Measured teeth cannot be combined with trials: these need searches, and measured teeth every state.
    """

    preset: str
    trials: list[str] | None = None
    verify: str | None = None
    draws: int = 32
    seed: int = 0
    jobs: int = 0

    def run(self) -> int:
        """Weigh the trials; returns the exit code."""
        from hdassist.errors import UsageError
        from hdassist.trials.record import read_trial_or_record

        out = self.open()
        card = CardFile.asked(self, self, out)
        drive, reading = self.load(self.preset), self.reading()
        if self.verify is not None and card:
            raise UsageError("a card is for the mounting that --verify comes after", "leave --card or --verify out")
        # before the imports below, which take longer than all of this
        trials = [read_trial_or_record(text, drive, reading, self.seed) for text in self.trials or ()]
        outcome = None
        if self.verify is not None:
            outcome = read_trial_or_record(self.verify, drive, reading, self.seed, drive.mounting.allowed)

        from hdassist.pages.trials import trials_card_facts, trials_report
        from hdassist.terminal.runs import note_time
        from hdassist.trials.advice import advise_from_trials
        from hdassist.trials.prior import Rig, TrialEffort, trial_states

        torques = others = drive.operation.M_g
        begun = time.monotonic()
        if self.torque and self.preset != "-":
            others = replace(self, torque=[]).load(self.preset).operation.M_g
        rig, effort = Rig(self.torque_of(torques), self.noise), TrialEffort.of(self.draws)
        states = trial_states(drive, len({*torques, rig.M_g}), effort)
        with out.run(drive.name, states, self) as run:
            advice = advise_from_trials(
                drive, trials, rig, outcome=outcome, needed=self.sure, effort=effort, other_torques=others, run=run
            )
        facts = (lambda say: trials_card_facts(advice, say)) if advice.settled else None
        report = trials_report(advice, carded=card is not None)
        if self.verbose:
            note_time(report, begun)
        return give_with_card("trials", report, card, facts, self, out)
