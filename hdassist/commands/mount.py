"""`hdassist mount`: the position in which to mount the fixed wheel."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hdassist.commands.card import CardFile, give_with_card
from hdassist.errors import UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.preset.fields import Drive


@dataclass(frozen=True, kw_only=True)
class MountCommand(o.FigureOptions, o.CardOptions, o.SamplingOptions, o.PitchOptions, o.LimitedDriveOptions):
    """Where to mount the fixed wheel: the hole of its seat with the least error F'_ior.

    \b
    Examples:
      hdassist mount vzp160
      hdassist mount vzp160 --step 10 --csv curve.csv
      hdassist mount my-drive.yaml --set "phases.xi_b=260±10"
      hdassist mount my-drive.yaml --set mounting.holes=0 --torque 80 -q
      hdassist mount my-drive.yaml --pitch-b wheel.csv --mark-b 120
      hdassist mount my-drive.yaml --compensated output:256
      hdassist mount my-drive.yaml --card card.html --lang ru --serial 17-042

    The fixed wheel is the rigid wheel (circular spline) or the flexspline. Turns are counter-clockwise seen from the
    side of the cam (wave generator), from where the wheel stands. The best position is that in which the torque served
    worst gains most, among the holes that mounting.allowed leaves; mounting.holes: 0 means a free angle. All that the
    preset does not know exactly is drawn jointly, as check draws it (docs/unknown.md): what is assumed with a range,
    has an uncertainty (k = 2), or is not given. A turn is ordered where it gains more than 1 % with the --probability;
    else there is no order, no card, and exit code 6, and the page names the measurement to make. -q prints the hole (or
    the angle) alone, 0 for "leave it", unknown where no order can be given.

    Where the direction of the cam offset is not known, hdassist trials finds it from measurements in a few positions.

    --compensated has what a stored correction (hdassist compensate) leaves that is made in each hole for each torque,
    and the order goes by that; where it tells no hole from another, by F'_ior.

    --pitch-b and --pitch-g put measured teeth in place of the first harmonics, tooth by tooth from the mark. Every
    state is solved then, and no input is drawn.
    """

    preset: str
    step: float | None = None
    compensated: str | None = None
    probability: float = 0.95
    plot: bool = True
    details: bool = False
    cross_check: str = "highs"

    def run(self) -> int:
        """Find the position; returns the exit code."""
        from hdassist.correction.mounted import advice_corrected, corrected_states, form_of_text
        from hdassist.mounting.advice import advice_states, advise
        from hdassist.pages.mount import mount_card_facts, mount_report
        from hdassist.terminal.runs import note_time
        from hdassist.terminal.wheels import pitch_files, read_teeth

        out = self.open()
        form = form_of_text(self.compensated) if self.compensated else None
        card = CardFile.asked(self, self, out)
        files = pitch_files([self.preset], self)
        if form and files.files:
            raise UsageError("--compensated does not take measured teeth", "leave out --pitch-b and --pitch-g")
        drive = self.load(self.preset)
        measured = read_teeth(files, drive)
        torques, rotations, begun = drive.operation.M_g, _rotations(drive, self.step), time.monotonic()
        states = advice_states(drive, len(rotations), draws=self.draws, measured=measured)
        if form:
            states += corrected_states(drive, len(rotations), self.draws)
        with out.run(drive.name, states, self) as run:
            advice = advise(
                drive,
                torques=torques,
                rotations_deg=rotations,
                measured=measured,
                draws=self.draws,
                needed=self.probability,
                run=run,
            )
            advice = advice_corrected(advice, form, self.draws, run) if form else advice
        facts = None if advice.order == "none" else lambda say: mount_card_facts(advice, say)
        report = mount_report(advice, self.seed, carded=card is not None)
        if self.verbose:
            note_time(report, begun)
        return give_with_card("mount", report, card, facts, self, out)


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
