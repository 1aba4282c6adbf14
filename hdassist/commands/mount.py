"""`hdassist mount`: the hole in which to mount the fixed wheel, and the assembly card beside the answer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hdassist.errors import SURE, UsageError
from hdassist.report import Report
from hdassist.terminal import options as o
from hdassist.terminal.output import Output, give, run_each
from hdassist.terminal.streams import take_output, write_text

if TYPE_CHECKING:
    from hdassist.mounting.advice import Advice
    from hdassist.preset.fields import Drive
    from hdassist.terminal.words import Texts


class MountCommand(
    o.PlotOptions, o.CardOptions, o.TrialOptions, o.TraceOptions, o.SamplingOptions, o.PitchOptions,
    o.LimitedDriveOptions,
):  # fmt: skip
    """In which hole of its seat to mount the fixed wheel, by its preset and F'_ior measured in a few holes.

    \b
    Examples:
      hdassist mount vzp160
      hdassist mount own.yaml h0=28.1 h4=17.3 h8=24.9 --noise 0.5 --card card.html
      hdassist mount own.yaml h0@4=28.1 h4@4=17.3 h8@4=24.9 h4@40=9.3
      hdassist mount own.yaml h0=28.1 h4=17.3 h8=24.9 h5=16.4 --verify h5=16.2
      hdassist mount my-drive.yaml --set "phases.xi_b=260±10" --limit 30
      hdassist mount my-drive.yaml --bolted 5 -q
      hdassist mount my-drive.yaml --pitch-b wheel.csv --mark-b 120
      hdassist mount my-drive.yaml --compensated output:256
      hdassist mount my-drive.yaml --card card.html --lang ru --serial 17-042

    The fixed wheel is the rigid wheel (circular spline) or the flexspline. Turns are counter-clockwise seen from the
    side of the cam (wave generator), from where the wheel stood at first. All that the preset does not know exactly is
    drawn jointly, as check draws it (docs/unknown.md). The hole is that of the least expected loss at the torque served
    worst, with a limit the likeliest to keep it. TURN or LEAVE: the choice is right with a probability of 95 %
    (--sure), a turn where it gains more than 1 %. BEST BET: it is less sure. ANY HOLE: none is expected to be better
    than another by 1 %. -q prints the hole (or the angle) alone. The exit code is 0 for all of them; with --sure it is
    6 where the choice is less sure.

    F'_ior measured in holes makes it surer: the first three 120 deg apart, at a light torque, the wheel taken out and
    put back each time. The page names the hole to measure next and what that is expected to bring, until a further
    value is worth less than 2 % (--worth). A value may be the file of a record: its F'_ior and uncertainty are those of
    hdassist measure, the full cycle needed. measured.F_ior of the preset counts too. A misread value is named; --verify
    compares the outcome with its prediction and says keep, or go back (3).

    --bolted has a turn earn so many per cent, for a drive that is assembled already. --compensated has what a stored
    correction (hdassist compensate) leaves that is made in each hole for each torque. --pitch-b and --pitch-g put
    measured teeth in place of the first harmonics, tooth by tooth from the mark: every state is solved then, and no
    input is drawn. hdassist trials is the same command.
    """

    preset: str
    trials: list[str] | None = None
    verify: str | None = None
    step: float | None = None
    compensated: str | None = None
    bolted: float | None = None
    worth: float = 2.0
    cross_check: str = "highs"

    def run(self) -> int:
        """Find the hole; returns the exit code."""
        out = self.open()
        with out.progress(self.preset):  # words before numpy is imported
            card = self._card(out)
        if self.verify is not None and card:
            raise UsageError("a card is for the mounting that --verify comes after", "leave --card or --verify out")
        advices: list[Advice] = []

        def one(_: str) -> Report:
            from hdassist.pages.mount import mount_report

            advices.append(self._advice(out))
            report = mount_report(advices[0], self.seed, carded=card is not None, sure=self.sure)
            # the card in place of the page, where both go to standard output
            return replace(report, head="") if card and card.path == out.target == "-" else report

        code = give("mount", run_each("mount", [self.preset], one, out), out)
        if card and advices:
            write_text(card.path, card.text(advices[0]), card.force)
        return code

    def _card(self, out: Output) -> CardFile | None:
        """The card that is asked for. Raises UsageError and DataError before anything is computed."""
        if (path := self.card) is None:
            if self.lang is not None or self.serial is not None:
                raise UsageError("--lang and --serial are those of a card", "--card FILE writes one")
            return None
        from hdassist.terminal.words import HOME, texts

        plain, say = self.ascii or (path == "-" and out.style.ascii), texts(HOME if self.lang is None else self.lang)
        card = CardFile(path, say, self.serial or "", plain, out.force)
        if path == "-" and (out.csv == "-" or (out.target == "-" and (out.json or out.quiet))):
            raise UsageError("--card - leaves no standard output for --json, -q or --csv -")
        take_output(path, out.force)
        return card

    def _advice(self, out: Output) -> Advice:
        """The advice by the preset alone, or after measured values."""
        files = self.wheels_of_one([self.preset])
        drive, reading = self.load(self.preset), self.reading()
        # before the imports below, which take longer than all of this
        from hdassist.mounting.posterior import TrialSetup, read_trial_or_record

        trials = [read_trial_or_record(text, drive, reading, self.seed) for text in self.trials or ()]
        outcome = None
        if self.verify is not None:
            outcome = read_trial_or_record(self.verify, drive, reading, self.seed, drive.mounting.allowed)
        has_values = bool(trials or outcome)
        for option in ("step", "compensated", "pitch_b", "pitch_g"):
            if has_values and getattr(self, option) is not None:
                raise UsageError(f"{o.option_name(option)} does not take measured values", "leave one of them out")
        if self.compensated and files.files:
            raise UsageError("--compensated does not take measured teeth", "leave out --pitch-b and --pitch-g")

        from hdassist.mounting.advice import advice_states, advise, advise_after
        from hdassist.mounting.decision import LEAST_GAIN

        measured, torques = self.teeth(files, drive), drive.operation.M_g
        rotations = [] if has_values else _rotations(drive, self.step)
        heaviest = () if self.trial_torque else (max(torques, key=abs),)
        setup = TrialSetup(self.torque_of(torques), self.noise, heaviest)
        states = advice_states(drive, len(rotations), draws=self.draws, measured=measured, trials=has_values)
        if self.compensated:
            from hdassist.correction.correct import advice_corrected, corrected_states
            from hdassist.correction.forms import form_of_text

            form = form_of_text(self.compensated)
            states += corrected_states(drive, len(rotations), self.draws)
        others = torques  # at which values without a torque may have been measured
        if has_values and self.torque and self.preset != "-":
            others = replace(self, torque=[], limit=[]).load(self.preset).operation.M_g
        cost = LEAST_GAIN if self.bolted is None else self.bolted / 100
        wanted: Any = {"draws": self.draws, "sure": self.sure or SURE, "cost": cost, "worth": self.worth / 100}
        with out.run(drive.name, states, self) as run:
            if has_values:
                return advise_after(drive, trials, setup, outcome=outcome, other_torques=others, run=run, **wanted)
            advice = advise(drive, rotations, measured=measured, setup=setup, run=run, **wanted)
            return advice_corrected(advice, form, self.draws, run) if self.compensated else advice


def _rotations(drive: Drive, step: float | None) -> list[float]:
    """Turns of the wheel to try [deg]: those of the seat, and a step between. Raises UsageError: not a part of 360."""
    from hdassist.mounting.positions import LEAST_STEP, seat_positions

    positions = seat_positions(drive)
    if step is None:
        return positions
    count = round(360 / step) if LEAST_STEP <= step <= 360 else 0
    if not count or abs(count * step - 360) > 1e-6:
        words = f"--step must divide 360 degrees, and be {LEAST_STEP:g} or more, not {step:g}"
        raise UsageError(words, "30 is the step of 12 seat holes")
    grid = [360 * k / count for k in range(count)]
    if not drive.mounting.holes:
        return grid
    return sorted({round(angle, 9) for angle in (*positions, *grid)})


CARD_SUFFIXES = (".txt", ".html")
_SERIAL = 60  # letters that a serial number may have


@dataclass(frozen=True)
class CardFile:
    """A card that was asked for: where it goes, its language and serial number, in 7-bit letters, over a file or not.

    Raises UsageError for a name or serial number that no card has.
    """

    path: str
    say: Texts
    serial: str = ""
    ascii: bool = False
    force: bool = False

    def __post_init__(self) -> None:
        if self._suffix not in CARD_SUFFIXES:
            names = ", ".join(CARD_SUFFIXES)
            raise UsageError(f"a card cannot be written as {self.path!r}", f"its name ends in {names}")
        if len(self.serial) > _SERIAL or (self.serial and not self.serial.isprintable()):
            raise UsageError(f"a serial number has up to {_SERIAL} printable characters")

    @property
    def _suffix(self) -> str:
        return ".txt" if self.path == "-" else Path(self.path).suffix.lower()

    def text(self, advice: Advice) -> str:
        """The card of an advice as its file has it."""
        from hdassist.pages.card import card_of
        from hdassist.pages.mount import mount_warnings
        from hdassist.pages.report import card_html, card_text

        warnings = mount_warnings(advice, self.say)
        card = card_of(advice, self.say, warnings, serial=self.serial.strip(), made=date.today())
        return card_html(card) if self._suffix == ".html" else card_text(card, ascii=self.ascii)
