"""What can be computed and is hardly meant: proportions that no drive has. Remarks, each with its number and source."""

from __future__ import annotations

from collections.abc import Iterator

from hdassist.preset.fields import Drive
from hdassist.preset.knowledge import PROPORTIONS, TORQUE_DENSITY

SLACK = 1e-9  # of a bound: what rounding may take

PlausibleRemark = tuple[str, str, str]  # path of the field to look at, message with its number, what is usual


def remarks(drive: Drive) -> Iterator[PlausibleRemark]:
    """What is hardly meant in a drive."""
    for each in PROPORTIONS:
        value, base = drive.value(each.path), each.base(drive)
        share = value / base if value and base else None
        if share is not None and not each.low * (1 - SLACK) <= share <= each.high * (1 + SLACK):
            words = each.words.format(value=value, base=base, share=share, ball=drive.bearing.d_ball)
            yield each.path, words, f"usual: {each.usual.format(low=each.low, high=each.high)}"
    yield from _torques(drive)


def _torques(drive: Drive) -> Iterator[PlausibleRemark]:
    """The torques are those of a drive of this size."""
    most, rated, d = max(map(abs, drive.operation.M_g)), drive.operation.rated, drive.gears.m * drive.gears.z_g
    limit = TORQUE_DENSITY[1] * d**3
    usual = f"{limit:.3g} N*m, the highest of catalogues at {d:.4g} mm: 52 N*m for size 20, ratio 100, by d^3"
    beyond = "times what drives of this size are rated for"
    if rated is None and most > limit:
        words = f"{most:g} N*m is {most / limit:.3g} {beyond}"
        yield "operation.M_g", words, f"{usual}; give operation.rated where it is another"
    if rated is not None and most > rated * (1 + SLACK):
        words = f"{most:g} N*m is {most / rated:.3g} times the rated torque"
        yield "operation.M_g", words, f"operation.rated: {rated:g} N*m"
    if rated is not None and rated > limit * 1.01:
        yield "operation.rated", f"{rated:g} N*m is {rated / limit:.3g} {beyond}", usual
