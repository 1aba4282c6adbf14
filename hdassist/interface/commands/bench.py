"""Commands of the test rig: mount with the card, measure with the archive, compensate with controller files."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from datetime import date
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from hdassist.features.report import Report
from hdassist.interface.terminal import options as o
from hdassist.interface.terminal.output import Output, give, run_each, warn
from hdassist.interface.terminal.streams import say, take_output, write_text
from hdassist.run.errors import SURE, UsageError

if TYPE_CHECKING:
    from hdassist.drive.model.deviations import MeasuredTeeth
    from hdassist.drive.preset.fields import Drive
    from hdassist.features.correction.backlash import BacklashFormat
    from hdassist.features.correction.correct import Correction
    from hdassist.features.correction.forms import CorrectionForm
    from hdassist.features.correction.records import RecordedError
    from hdassist.features.correction.writers import ControllerFormat
    from hdassist.features.measuring.bench import LoopRecord, PositionRecord
    from hdassist.features.measuring.measure import LoggedJoint, Measurement, Reading
    from hdassist.features.measuring.shafts import Shaft
    from hdassist.features.mounting.advice import Advice
    from hdassist.features.mounting.posterior import Trial, TrialSetup
    from hdassist.interface.terminal.words import Texts


class MountCommand(
    o.PlotOptions,
    o.CardOptions,
    o.TrialOptions,
    o.TraceOptions,
    o.SamplingOptions,
    o.PitchOptions,
    o.LimitedDriveOptions,
):
    """Hole for the fixed wheel, from the preset and from F'_ior measured in a few holes.

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

    The fixed wheel is the circular spline or the flexspline. A hole is a position in which it can be bolted. Holes are
    numbered, and turns are measured, counter-clockwise, seen from the wave generator side, from hole 0, where the wheel
    was before the first trial. All uncertain inputs are sampled jointly, as in check (docs/unknown.md). The recommended
    hole has the smallest expected excess over the best hole at the governing torque; with a limit, it is the hole most
    likely to meet it. TURN or LEAVE: the probability that the choice is right is at least 95 % (--sure); a turn has to
    reduce F'_ior by more than 1 %. BEST BET: the probability is lower. ANY HOLE: no hole is expected to be better than
    another by 1 %. -q prints only the hole (or the angle), or the word any. The exit code is 0 for all four; with
    --sure it is 6 if the probability is lower than required.

    F'_ior measured in holes raises the probability. Measure the first three values in holes 120 deg apart, at a light
    torque. Take the wheel out and put it back before each measurement. The page names the hole to measure next and the
    expected reduction, until a further value would reduce F'_ior by less than 2 % (--worth). A value may also be the
    file of a recording that covers the full mesh cycle. Its F'_ior and its uncertainty are those of hdassist measure.
    Values in measured.F_ior of the preset are used too. A value that is probably a reading error is the next one to
    repeat. --verify compares the outcome with its prediction. It recommends keeping the hole (exit code 0), going back
    to another hole (3), or measuring again, because the outcome is probably a reading error (6).

    --bolted sets the percentage by which another hole must reduce F'_ior if the drive is already assembled.
    --compensated chooses the hole by the residual error after a stored correction (hdassist compensate), which is
    computed for each hole and torque. --pitch-b and --pitch-g read the measured deviation of each tooth, beginning at
    the marked tooth. Every mesh position is then solved, and no input is sampled. hdassist trials is the same command.
    """

    preset: str
    trials: list[str] | None = None
    verify: str | None = None
    step: float | None = None
    compensated: str | None = None
    bolted: float | None = None
    worth: float = 2.0
    cross_check: str = "highs"
    beside = ("csv", "card")

    def run(self) -> int:
        """Find the hole, and return the exit code."""
        out = self.open()
        with out.progress(self.preset):  # shown before numpy is imported
            card = self._card(out)
        if self.verify is not None and card:
            raise UsageError(
                "--card cannot be combined with --verify, which applies after bolting", "leave out --card or --verify"
            )
        advices: list[Advice] = []

        def one(_: str) -> Report:
            from hdassist.interface.pages.mount import mount_report

            advices.append(self._advice(out))
            return mount_report(
                advices[0],
                self.seed,
                carded=card is not None,
                sure=self.sure,
            )

        code = give("mount", run_each("mount", [self.preset], one, out), out)
        if card and advices:
            write_text(card.path, card.text(advices[0]), card.force)
        return code

    def _card(self, out: Output) -> CardFile | None:
        """Return the requested card, None if none is requested. Raises UsageError for invalid options of the card."""
        if (path := self.card) is None:
            if self.lang is not None or self.serial is not None:
                raise UsageError("--lang and --serial apply to a card only", "add --card FILE")
            return None
        if self.quiet and path == out.target == "-":
            raise UsageError("only one of --card and -q can use standard output", "write the card to a file")
        from hdassist.interface.terminal.words import HOME, texts

        plain = self.ascii or (path == "-" and out.style.ascii)
        say = texts(HOME if self.lang is None else self.lang)
        return CardFile(
            path=path,
            say=say,
            serial=self.serial or "",
            ascii=plain,
            force=out.force,
        )

    def _advice(self, out: Output) -> Advice:
        """Return the choice of a hole, based on the preset and, if there are any, on values measured in holes."""
        files = self.wheels_of_one([self.preset])
        drive = self.load(self.preset)
        reading = self.reading()
        # errors in options and files are reported before these slow imports
        from hdassist.features.mounting.posterior import TrialSetup, read_trial_or_record

        trial_M_g = self.torque_of(drive.operation.M_g)
        trials = [read_trial_or_record(text, drive, reading, trial_M_g, self.seed) for text in self.trials or ()]
        outcome = None
        if self.verify is not None:
            outcome = read_trial_or_record(self.verify, drive, reading, trial_M_g, self.seed, drive.mounting.allowed)
        has_values = bool(trials or outcome)
        self._require_combinable(has_values=has_values, has_teeth=bool(files.files))
        heaviest = () if self.trial_torque else (max(drive.operation.M_g, key=abs),)
        setup = TrialSetup(trial_M_g, self.noise, heaviest)
        measured = self.teeth(files, drive)
        if has_values:
            return self._advice_after(out, drive, trials, outcome, setup)
        return self._advice_before(out, drive, measured, setup)

    def _require_combinable(self, *, has_values: bool, has_teeth: bool) -> None:
        """Raise UsageError for options that cannot be combined with measured values, or with measured teeth."""
        for option in ("step", "compensated", "pitch_b", "pitch_g"):
            if has_values and getattr(self, option) is not None:
                raise UsageError(
                    f"{o.option_name(option)} cannot be combined with measured values", "leave out one of the two"
                )
        if self.compensated and has_teeth:
            raise UsageError(
                "--compensated cannot be combined with measured pitch deviations",
                "leave out either --compensated, or both --pitch-b and --pitch-g",
            )

    def _decision_options(self) -> dict[str, Any]:
        """Return the keyword arguments that advise and advise_after have in common."""
        from hdassist.belief.holes import LEAST_GAIN

        cost = LEAST_GAIN if self.bolted is None else self.bolted / 100
        return {"draws": self.draws, "sure": self.sure or SURE, "cost": cost, "worth": self.worth / 100}

    def _advice_after(
        self,
        out: Output,
        drive: Drive,
        trials: Sequence[Trial],
        outcome: Trial | None,
        setup: TrialSetup,
    ) -> Advice:
        """Return the choice of a hole that takes measured values into account.

        trials: measured values.
        outcome: value measured after bolting in the chosen hole, None if there is none.
        setup: torque and noise of the values.
        """
        from hdassist.features.mounting.advice import advice_states, advise_after

        # torques at which values without a torque may have been measured
        other_torques = drive.operation.M_g
        if self.torque and self.preset != "-":
            other_torques = replace(self, torque=[], limit=[]).load(self.preset).operation.M_g
        states = advice_states(
            drive,
            0,
            draws=self.draws,
            trials=True,
        )
        with out.run(drive.name, states, self) as run:
            return advise_after(
                drive,
                trials,
                setup,
                outcome=outcome,
                other_torques=other_torques,
                run=run,
                **self._decision_options(),
            )

    def _advice_before(
        self,
        out: Output,
        drive: Drive,
        measured: MeasuredTeeth | None,
        setup: TrialSetup,
    ) -> Advice:
        """Return the choice of a hole without measured values.

        measured: measured teeth of the wheels, None if there are none.
        setup: torque and noise of future values.
        """
        from hdassist.features.mounting.advice import advice_states, advise

        rotations = _rotations(drive, self.step)
        states = advice_states(
            drive,
            len(rotations),
            draws=self.draws,
            measured=measured,
        )
        if not self.compensated:
            with out.run(drive.name, states, self) as run:
                return advise(
                    drive,
                    rotations,
                    measured=measured,
                    setup=setup,
                    run=run,
                    **self._decision_options(),
                )
        from hdassist.features.correction.correct import advice_corrected, corrected_states
        from hdassist.features.correction.forms import form_of_text

        form = form_of_text(self.compensated)
        states += corrected_states(drive, len(rotations), self.draws)
        with out.run(drive.name, states, self) as run:
            advice = advise(
                drive,
                rotations,
                measured=measured,
                setup=setup,
                run=run,
                **self._decision_options(),
            )
            return advice_corrected(advice, form, self.draws, run)


def _rotations(drive: Drive, step: float | None) -> list[float]:
    """Return the rotations of the wheel to compute [deg]: the positions of its seat, and a grid of the given step.

    Raises UsageError if the step does not divide 360 deg.
    """
    from hdassist.features.mounting.positions import LEAST_STEP, seat_positions

    positions = seat_positions(drive)
    if step is None:
        return positions
    count = round(360 / step) if LEAST_STEP <= step <= 360 else 0
    if not count or abs(count * step - 360) > 1e-6:
        message = f"invalid --step {step:g}: expected a divisor of 360 degrees, {LEAST_STEP:g} or more"
        raise UsageError(message, "for a seat with 12 holes, use --step 30")
    grid = [360 * k / count for k in range(count)]
    if not drive.mounting.holes:
        return grid
    return sorted({round(angle, 9) for angle in (*positions, *grid)})


CARD_SUFFIXES = (".txt", ".html")
_SERIAL = 60  # largest number of characters of a serial number


@dataclass(frozen=True)
class CardFile:
    """Requested assembly card.

    path: destination of the card; - is standard output.
    say: texts in the language of the card.
    serial: serial number of the drive.
    ascii: whether a card in plain text is limited to 7-bit characters.
    force: whether an existing file is overwritten.
    Raises UsageError for an invalid file name or serial number.
    """

    path: str
    say: Texts
    serial: str = ""
    ascii: bool = False
    force: bool = False

    def __post_init__(self) -> None:
        if self._suffix not in CARD_SUFFIXES:
            names = ", ".join(CARD_SUFFIXES)
            raise UsageError(f"invalid name of a card: {self.path!r}", f"use a name that ends in {names}")
        if len(self.serial) > _SERIAL or (self.serial and not self.serial.isprintable()):
            message = f"invalid serial number: expected up to {_SERIAL} printable characters"
            raise UsageError(message, "state the serial number of the drive, for example --serial 17-041")

    @property
    def _suffix(self) -> str:
        return ".txt" if self.path == "-" else Path(self.path).suffix.lower()

    def text(self, advice: Advice) -> str:
        """Return the card for a choice of a hole, in the format given by the suffix of the card's file."""
        from hdassist.interface.pages.card import card_of
        from hdassist.interface.pages.mount import mount_warnings
        from hdassist.interface.pages.report import card_html, card_text

        warnings = mount_warnings(advice, self.say)
        card = card_of(
            advice,
            self.say,
            warnings,
            serial=self.serial.strip(),
            made=date.today(),
        )
        return card_html(card) if self._suffix == ".html" else card_text(card, ascii=self.ascii)


class ArchiveOptions(o.OptionGroup):
    """Options of the archive: folder, drive and conditions of results to store, or the drive whose history is shown."""

    archive: str | None = None
    serial: str = ""
    conditions: list[str]
    history: str | None = None

    def archiving(self, files: Sequence[str]) -> Callable[[Measurement], None]:
        """Return the function that stores a result in the archive; without an archive, it does nothing.

        Raises UsageError for options that cannot be combined.
        """
        from hdassist.features.measuring.archive import add_to_archive, read_conditions

        stated_options = (bool(files), bool(self.archive), bool(self.serial), self.history is not None)
        if stated_options not in ((1, 0, 0, 0), (1, 1, 1, 0), (0, 1, 0, 1)) or (self.conditions and not self.serial):
            message = "expected FILE, FILE --archive DIR --serial S, or --history S --archive DIR"
            raise UsageError(message, "see the examples of hdassist measure -h")
        conditions = read_conditions(self.serial, self.conditions)

        def take(measurement: Measurement) -> None:
            if not self.archive:
                return
            is_new = add_to_archive(self.archive, conditions, measurement)
            day = f", {conditions['date']}" if "date" in conditions else ""
            text = f"added for {self.serial}{day}" if is_new else f"already stored for {self.serial}; not added again"
            say(f"{self.archive}: {measurement.trace.file} {text}")

        return take

    def history_report(self, serial: str) -> Report:
        """Return the report on the stored results of a drive in the archive."""
        from hdassist.features.measuring.archive import is_cut_off, read_archive
        from hdassist.interface.pages.measure import history_report

        archive = str(self.archive)
        report = history_report(serial, archive, read_archive(archive, serial))
        warning = f"{archive}: its last line is incomplete, so one result is lost; add that recording again"
        return replace(report, warnings=(warning,)) if is_cut_off(archive) else report


class MeasureCommand(o.PlotOptions, o.TraceOptions, ArchiveOptions):
    """F'_ior, orders and coverage of recordings, with their uncertainty.

    \b
    Examples:
      hdassist measure run.csv --drive my-drive.yaml
      hdassist measure run.csv --ratio 100 --error err_mdeg --drift linear
      hdassist measure run.csv --ratio 99.5 --angle enc1 --second enc2
      hdassist measure log.csv --joint J1=cam1,out1,100 --joint J2=cam2,out2,160
      hdassist measure mount.csv --ratio 100 --period 862 --shafts belt=257s
      zcat run.csv.gz | hdassist measure - --ratio 100 --orders 1-6 --json
      hdassist measure run.csv --drive own.yaml --archive rig1 --serial 17-042
      hdassist measure --history 17-042 --archive rig1

    A file has a column of angles and a column of errors, or of a second encoder. F'_ior and its 95 % interval come from
    a statistical model of the recording. F'_ior is a lower bound unless the recording covers the full mesh cycle. Each
    direction is evaluated separately. For a file of approached positions (target_deg, deviation_arcsec, side) or of
    torque loops (torque_Nm, twist_arcsec, place) the page gives the figures that manufacturers state besides F'_ior.
    Exit codes: 0 done, 4 invalid file, 5 the recording does not resolve the orders or F'_ior.
    """

    files: list[str]
    preset: str | None = None
    ratio: float | None = None
    travel: float | None = None
    joint: list[str]
    shafts: str | None = None
    seed: int = 0

    def run(self) -> int:
        """Measure the recordings, and return the exit code."""
        o.stdin_once(*self.files, self.preset)
        out = self.open()
        with out.progress(self.files[0] if self.files else ""):  # shown before numpy is imported
            from hdassist.drive.loading import load_preset
            from hdassist.features.measuring.measure import LoggedJoint
            from hdassist.features.measuring.orders import gearing_of
            from hdassist.features.measuring.shafts import parse_shafts
            from hdassist.interface.pages.measure import joint_lines, repeats

            take = self.archiving(self.files)
            if self.history is not None:
                return give("measure-history", [self.history_report(self.history)], out)
            drive = load_preset(self.preset) if self.preset is not None else None
            form = self.reading()
            form.require_sound()
            gearing_of(drive, self.ratio)  # raises an error for an invalid ratio before any file is read
            shafts = parse_shafts(self.shafts)
            joints = [LoggedJoint.of(text) for text in self.joint]
            if joints and (drive or self.ratio or self.archive):
                raise UsageError("--joint states the ratio of each joint", "leave out --ratio, --drive and --archive")
            session = _MeasureSession(
                options=self,
                form=form,
                drive=drive,
                shafts=shafts,
                take=take,
            )
            for file in self.files:
                for joint in joints:
                    session.joints[f"{file}: {joint.name}"] = (file, joint)
            reports = run_each(
                "measure",
                [*session.joints] or self.files,
                session.report_of,
                out,
                kind="file",
            )
            repeat_values, lines = repeats(session.measurements)
            if joints:  # each joint has its own drive, so results are not repeat runs
                repeat_values = {}
                lines = joint_lines(reports, session.measurements)
        return give("measure", reports, out, more=repeat_values, below=lines)

    def require_recording(self, name: str) -> None:
        """Raise UsageError if positions or torque loops are to be stored in an archive; name: name of their file."""
        if self.archive:
            raise UsageError(
                f"{name}: positions and torque loops cannot be stored in an archive",
                "use --archive with recordings only",
            )

    def next_options(self, joint: LoggedJoint | None) -> list[str]:
        """Return the options that the next command needs to read a recording, or a joint in it, in the same way."""
        options = self.words_of_reading()
        if self.seed:
            options.append(self.typed("seed", self.seed))
        if joint:
            options += [f"--angle={joint.angle}", f"--second={joint.second}"]
        return options


@dataclass(eq=False)
class _MeasureSession:
    """Shared inputs of the recordings in one call of `hdassist measure`, and the results so far.

    options: options of the command.
    form: options for reading recordings.
    drive: drive of the recordings, None if it is unknown.
    shafts: stated shafts whose components are to be determined.
    take: function that stores each result.
    joints: file and joint of each recording, by name; empty without --joint.
    measurements: results so far.
    """

    options: MeasureCommand
    form: Reading
    drive: Drive | None
    shafts: tuple[Shaft, ...]
    take: Callable[[Measurement], None]
    joints: dict[str, tuple[str, LoggedJoint]] = field(default_factory=dict)
    measurements: list[Measurement] = field(default_factory=list)

    def report_of(self, name: str) -> Report:
        """Return the report on a file or a joint; name: the file, or a key of joints."""
        from hdassist.features.measuring.full_cycle import with_full_cycle
        from hdassist.features.measuring.measure import Measurement
        from hdassist.interface.pages.measure import bench_report, measure_report

        file, joint = self.joints.get(name, (name, None))
        next_options = self.options.next_options(joint)
        result = self._read(file, joint)
        if not isinstance(result, Measurement):
            self.options.require_recording(name)
            return bench_report(result, self.drive, self.options.seed, next_options)
        result = with_full_cycle(result)
        self.measurements.append(result)
        self.take(result)
        speed = self.form.output_speed(result.gearing.ratio) if result.gearing else self.options.speed
        report = measure_report(result, self.drive, next_options, speed)
        return _of_joint(report, joint.name, name) if joint else report

    def _read(self, file: str, joint: LoggedJoint | None) -> Measurement | PositionRecord | LoopRecord:
        """Return the measurement from a recording in a file, or the positions or torque loops in the file.

        joint: joint whose columns are evaluated; None for a file with one recording.
        """
        travel_deg = self.options.travel or (self.drive and self.drive.acceptance.travel)
        if joint is None:
            return self.form.measured_or_bench(
                file,
                self.drive,
                self.options.ratio,
                seed=self.options.seed,
                travel_deg=travel_deg,
                shafts=self.shafts,
            )
        form = replace(
            self.form,
            angle=joint.angle,
            second=joint.second,
        )
        return form.measured(
            file, self.drive, joint.ratio, seed=self.options.seed, travel_deg=travel_deg, shafts=self.shafts
        )


def _of_joint(
    report: Report,
    joint: str,
    about: str,
) -> Report:
    """Return a report on a recording with the name of its joint added.

    joint: name of the joint.
    about: name of the file and of the joint.
    """
    values = {"joint": joint, **report.values}
    return replace(
        report,
        head=f"joint {joint}, {report.head}",
        about=about,
        values=values,
    )


class ControllerOptions(o.OptionGroup):
    """Options for the file of a controller, and for the sense and zero of its axis."""

    write: str | None = None
    axis: str = "1"
    clockwise: bool = False
    zero: float = 0.0
    rows_from: float = 0.0
    steps_per_degree: float = 0.0

    def controller_target(self, form: CorrectionForm, *, force: bool) -> tuple[ControllerFormat, str] | None:
        """Return the requested controller and its file, None if none is requested; form: form of the correction.

        Raises UsageError for an unknown controller, or for a form that the controller cannot store, and the errors of
        `take_output` for the file.
        """
        from hdassist.features.correction.backlash import BACKLASH_FORMATS, NO_COMPENSATION
        from hdassist.features.correction.writers import CONTROLLER_FORMATS

        if self.write is None:
            return None
        name, _, path = self.write.partition("=")
        if reason := NO_COMPENSATION.get(name):
            hint = "choose another controller; hdassist compensate -h lists them"
            raise UsageError(f"--write {name}: {reason}", hint)
        if name in BACKLASH_FORMATS:
            backlash = BACKLASH_FORMATS[name]
            message = f"--write {name}: no table is written for {backlash.name}, because {backlash.why_no_table}"
            raise UsageError(
                message,
                "write the points with --csv FILE, or the backlash of a recording in both directions with "
                f"hdassist compensate FILE --ratio N --write {name}=FILE",
            )
        if name not in CONTROLLER_FORMATS or path in ("", "-"):
            format_names = ", ".join((*CONTROLLER_FORMATS, *BACKLASH_FORMATS))
            raise UsageError(
                f"invalid --write {self.write!r}: expected CONTROLLER=FILE",
                f"use one of these controllers: {format_names}",
            )
        if not (self.axis.isascii() and self.axis.isalnum()):
            message = f"invalid --axis {self.axis!r}: expected letters and digits"
            raise UsageError(message, "state the axis, for example --axis A")
        numbers = {"--zero": self.zero, "--rows-from": self.rows_from, "--steps-per-degree": self.steps_per_degree}
        for option, number in numbers.items():
            if not isfinite(number):
                message = f"invalid {option} {number:g}: expected a finite number"
                raise UsageError(message, f"state a number, for example {option} 90")
        controller = CONTROLLER_FORMATS[name]
        controller.require(form.turn, form.points)
        take_output(path, force)
        return controller, path

    def backlash_target(self, *, force: bool) -> tuple[BacklashFormat, str] | None:
        """Return the requested controller and its file if the controller compensates only backlash, or else None.

        Raises UsageError for options that do not apply to a backlash setting, and the errors of `take_output` for the
        file.
        """
        from hdassist.features.correction.backlash import BACKLASH_FORMATS

        name, _, path = (self.write or "").partition("=")
        if name not in BACKLASH_FORMATS or path in ("", "-"):
            return None
        if self.clockwise or self.zero or self.rows_from or self.steps_per_degree:
            message = f"--write {name}: a backlash setting has neither a direction nor a zero"
            raise UsageError(message, "leave out --clockwise, --zero, --rows-from and --steps-per-degree")
        take_output(path, force)
        return BACKLASH_FORMATS[name], path

    def write_controller(
        self,
        result: Correction,
        target: tuple[ControllerFormat, str] | None,
        *,
        force: bool,
    ) -> None:
        """Write the controller file of a correction, unless no file is requested or the correction is refused.

        result: correction.
        target: controller and file, None if no file is requested.
        force: whether an existing file is overwritten.
        """
        from hdassist.features.correction.writers import ControllerAxis, correction_file, poor_table

        if target and not result.chosen.is_refused:
            if warning := poor_table(result, target[0]):
                warn(warning)
            sense = -1 if self.clockwise else 1
            axis = ControllerAxis(
                name=self.axis,
                sense=sense,
                zero_deg=self.zero,
                from_deg=self.rows_from,
                steps_per_degree=self.steps_per_degree,
            )
            text, about = correction_file(result, target[0], axis)
            say(about.rstrip())
            write_text(target[1], text, force)


class CompensateCommand(
    ControllerOptions, o.PlotOptions, o.SamplingOptions, o.SignOptions, o.TraceOptions, o.LoadedDriveOptions
):
    """Residual error after a stored correction, in each form, and the table of the correction.

    \b
    Examples:
      hdassist compensate vzp160
      hdassist compensate own.yaml --csv terms.csv
      hdassist compensate own.yaml --form output --points 720 --csv table.csv
      hdassist compensate own.yaml run80.csv run800.csv --each-load --json
      hdassist compensate own.yaml run80.csv --after corrected80.csv
      hdassist compensate run80.csv --ratio 100 --torque 80 --csv terms.csv
      hdassist compensate run.csv --ratio 100 --torque 80 --form cam --write c=t.h
      hdassist compensate vzp160 --torque 80 --torque -80 --details --json

    The error is separated into three parts: components that repeat in each input revolution, sidebands, and components
    that change with the load. Each form that controllers store is then fitted to the error by least squares over the
    full mesh cycle, for the first torque of the preset. Its residual is computed over all uncertain inputs
    (docs/unknown.md), at every torque. The page also gives the residual for a wrong zero and for a lost input
    revolution. Errors are actual minus ideal angles of the output, counter-clockwise positive, seen from the wave
    generator side. Input angles are measured from the position phi_h = 0. --csv writes the correction. A correction
    that may make a drive worse is refused (docs/correct.md).

    Each FILE is a recording at one torque of the preset, in the sequence of the torques. The correction is then
    computed from the recordings. If a recording covers the full mesh cycle, the correction uses the angles of the
    recording. If it covers only a part, the correction is computed from the sampled drives that agree with the
    recording, and uses the angles of the preset. With --ratio instead of a preset, one FILE of the full mesh cycle,
    recorded at --torque, gives correction terms with uncertainties, or a table. Two encoders must then count in the
    same sense, seen from the wave generator side. If the file contains errors instead, a table over the output needs
    --output-turns. --after reads a recording made with the correction on, and needs the same options as the correction.
    It compares the measured residual with the predicted one, and names the likely cause of a difference. Exit codes: 0
    done, 2 invalid options, 3 the predicted residual is exceeded, 4 invalid file, 5 refused or no trustworthy result, 6
    undecided.
    """

    preset: str
    files: list[str] | None = None
    ratio: float | None = None
    travel: float | None = None
    form: Literal["phasors", "output", "cam", "half-cam"] = "phasors"
    points: int | None = None
    output_turns: Literal["with", "against"] | None = None
    each_load: bool = False
    after: str | None = None

    def correction_form(self) -> CorrectionForm:
        """Return the requested form of correction."""
        from hdassist.features.correction.forms import CAM_POINTS, USUAL_POINTS, CorrectionForm

        if self.form == "phasors":
            return CorrectionForm(None, self.points or 0, self.each_load)
        usual = USUAL_POINTS if self.form == "output" else CAM_POINTS
        return CorrectionForm(self.form, self.points or usual, self.each_load)

    def recorded(
        self,
        file: str,
        drive: Drive,
        M_g: float | None = None,
        *,
        may_be_noise: bool = False,
    ) -> RecordedError:
        """Return the error in a recording.

        file: file of the recording.
        drive: recorded drive.
        M_g: torque [N*m]; None selects the first torque of the drive and omits the checks of counts and sense.
        may_be_noise: whether a recording that contains only noise is accepted, as in `measure`.
        """
        from hdassist.drive.model.geometry import Kinematics
        from hdassist.features.correction.records import recorded_error, require_fine_counts, require_sense

        travel = self.travel or drive.acceptance.travel
        how = {"seed": self.seed, "together": True, "may_be_noise": may_be_noise, "travel_deg": travel}
        record_M_g = drive.operation.M_g[0] if M_g is None else M_g
        measurement = self.reading().measured(
            file,
            drive,
            M_g=record_M_g,
            **how,
        )
        if M_g is not None:
            require_fine_counts(measurement)
            require_sense(measurement, drive, M_g, self.alignment())
        return recorded_error(measurement, Kinematics.of(drive), self.alignment())

    def records(self, drive: Drive) -> dict[float, RecordedError]:
        """Return the error in each recording, by torque [N*m]. Raises UsageError for more recordings than torques."""
        files = self.files or []
        torques = drive.operation.M_g
        if len(files) > len(torques):
            torque_count = "only one torque" if len(torques) == 1 else f"only {len(torques)} torques"
            raise UsageError(
                f"{len(files)} recordings, but {drive.name} has {torque_count}", "give one --torque for each file"
            )
        return {M_g: self.recorded(name, drive, M_g) for M_g, name in zip(torques, files, strict=False)}

    def of_record(self, file: str) -> Report:
        """Return the report of a correction computed from a recording without a preset, and write the requested file.

        file: file of the recording.
        Raises UsageError for options that need a preset.
        """
        from hdassist.drive.preset.knowledge import option_value
        from hdassist.features.correction.correct import correction_alone
        from hdassist.features.correction.records import require_fine_counts
        from hdassist.interface.pages.compensate import compensate_report

        remedy = "for several files, use a preset: hdassist compensate PRESET FILE..."
        if len(self.torque) != 1 or self.files:
            raise UsageError("--ratio needs exactly one FILE and its --torque", remedy)
        if self.after or self.overrides or self.each_load:
            raise UsageError("--ratio cannot be combined with --after, --set or --each-load", remedy)
        form = self.correction_form()
        backlash_target = self.backlash_target(force=self.force)
        target = None if backlash_target else self.controller_target(form, force=self.force)
        M_g = option_value("--torque", self.torque[0], "N*m")
        how = {"seed": self.seed, "together": True, "travel_deg": self.travel}
        measurement = self.reading().measured(
            file,
            None,
            self.ratio,
            M_g=M_g,
            **how,
        )
        require_fine_counts(measurement)
        result = correction_alone(measurement, self.alignment(), M_g, form, self.output_turns)
        self.write_controller(result, target, force=self.force)
        if backlash_target:
            self.write_backlash(file, M_g, backlash_target)
        return compensate_report(
            result,
            is_written=bool(self.csv or self.write),
            warnings=measurement.warnings,
        )

    def write_backlash(
        self,
        file: str,
        M_g: float,
        target: tuple[BacklashFormat, str],
    ) -> None:
        """Write the setting of a controller that compensates only backlash.

        file: recording in both directions.
        M_g: torque of the recording [N*m].
        target: controller and file.
        Raises DataError if the recording has only one direction.
        """
        from hdassist.features.correction.backlash import backlash_file, backlash_of

        controller, path = target
        measured = self.reading().measured(
            file,
            None,
            self.ratio,
            M_g=M_g,
            seed=self.seed,
            travel_deg=self.travel,
        )
        source = f"recording {measured.trace.file}, sha256 {measured.trace.sha256}"
        text, about = backlash_file(backlash_of(measured, M_g), controller, self.axis, source)
        say(about.rstrip())
        write_text(path, text, self.force)

    def report(self, out: Output, preset: str) -> Report:
        """Return the report of the correction of a drive, or of a recording without a preset."""
        from hdassist.features.correction.correct import correct, verify
        from hdassist.features.design import check_states
        from hdassist.interface.pages.compensate import compensate_report, verified_report

        o.stdin_once(*(self.files or []), preset, self.after)
        if self.ratio is not None:
            return self.of_record(preset)
        if preset.endswith(".csv"):
            raise UsageError(
                f"{preset} is not a preset", "for a recording without a preset, add the --ratio of its drive"
            )
        form = self.correction_form()
        target = self.controller_target(form, force=self.force)
        drive = self.load(preset)
        records = self.records(drive)
        after = self.recorded(self.after, drive, may_be_noise=True) if self.after else None
        with out.run(drive.name, 2 * check_states(drive, draws=self.draws), self) as run:
            result = correct(
                drive,
                form=form,
                records=records,
                draws=self.draws,
                run=run,
            )
            if after and not result.chosen.is_refused:
                return verified_report(result, verify(result, after, run))
        self.write_controller(result, target, force=self.force)
        return compensate_report(result, is_written=bool(target or self.csv))
