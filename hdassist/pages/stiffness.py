"""The torsional stiffness of a drive as a report."""

from collections.abc import Iterator
from math import pi

from hdassist.design.beside_catalogue import SegmentBeside, ends_elsewhere, off, segments_beside, stiffness_object
from hdassist.error.stiffness import LOST_MOTION_SHARE, Segment, Stiffness
from hdassist.json_parts import attributes
from hdassist.preset.fields import Drive
from hdassist.preset.overrides import is_overridden
from hdassist.report import Curve, Fact, Facts, Quantities, Quantity, Report, Table, as_object, csv_columns
from hdassist.terminal.words import again, on_what

ARCMIN = pi / 10800  # rad
TWIST_CAPTION = "Twist of the drive without deviations, the cam held"


def _scaled(stiffness: float) -> str:
    return f"{stiffness / 1e4:.3g}"


def _percent(percent: float) -> str:
    return f"{percent:+.0f} %"


WHOLE_QUANTITIES: Quantities[Stiffness] = (
    Quantity("rated_Nm", "rated torque", "N·m", "g", "rated"),
    Quantity("lost_motion_arcsec", f"lost motion, +-{LOST_MOTION_SHARE:.0%} of rated", "″", ".2f"),
    Quantity("play_arcsec", "play", "″", ".2f"),
)
SEGMENT_QUANTITIES: Quantities[Segment] = (
    Quantity("from_Nm", value="start"),
    Quantity("to_Nm", value="end"),
    Quantity("stiffness_Nm_per_rad", value="stiffness"),
)
_ON_PAGE: Quantities[SegmentBeside] = (
    Quantity("name", "", "", lambda name: name.replace("_", "")),
    Quantity("segment", "torque, N·m", "", lambda segment: f"{segment.start:.4g} to {segment.end:.4g}"),
    Quantity("K", "K, 1e4 N·m/rad", "", _scaled, "segment.stiffness"),
    Quantity("catalogue", "catalogue", "", _scaled),
    Quantity("off_percent", "off by", "", _percent),
    Quantity("by_arcmin", "K, N·m/arcmin", "", ".4g", lambda each: each.segment.stiffness * ARCMIN),
)


def stiffness_report(drive: Drive, found: Stiffness) -> Report:
    """The stiffness of a drive: twist over torque, K1, K2, K3, lost motion."""
    curve = {"torque_Nm": found.torque, **attributes(found, "twist_arcsec", "contact_arcsec", "tube_arcsec")}
    sides = {"positive": found.positive, "negative": found.negative}
    rows = [each for side in sides.values() for each in segments_beside(drive.catalogue, side)]
    lines = [f"K{k}: {_scaled(segment.stiffness)}e4 N*m/rad" for k, segment in enumerate(found.positive, 1)]
    return Report(
        command="stiffness",
        drive=drive,
        head=f"{drive.name}: torsional stiffness without deviations, the cam held",
        blocks=(
            Table.by_row("torsional stiffness in both directions", _ON_PAGE, rows),
            Facts.of(_facts(drive, found)),
            Curve(found.torque, found.twist_arcsec, "torque, N·m", "twist, ″", TWIST_CAPTION),
        ),
        certificate=found.certificate,
        cross_checks=(found.cross_check,),
        values={
            **as_object(WHOLE_QUANTITIES, found),
            "catalogue": stiffness_object(drive.catalogue, found),
            **{name: [as_object(SEGMENT_QUANTITIES, each) for each in side] for name, side in sides.items()},
            "curve": curve,
        },
        csv=csv_columns(**curve),
        line="\n".join([*lines, f"lost motion: {found.lost_motion_arcsec:.2f} arcsec"]),
        warnings=stiffness_warnings(drive, found),
    )


def stiffness_warnings(drive: Drive, result: Stiffness) -> tuple[str, ...]:
    """Warnings beside the numbers."""
    if drive.operation.rated is not None:
        return drive.origin.warnings
    asked = is_overridden("operation.M_g", drive.origin.overrides)
    whose = "the greatest torque asked for" if asked else "the greatest of operation.M_g"
    stands = f"no operation.rated in the preset: {result.rated:g} N*m, {whose}, stands for it"
    return (*drive.origin.warnings, f"{stands} in lost motion; --set operation.rated=T tells it" if asked else stands)


def _facts(drive: Drive, found: Stiffness) -> Iterator[Fact]:
    """Facts beside the segments, a label and a text each."""
    elsewhere = ends_elsewhere(drive.catalogue, found.positive)
    yield "segments", "end at other torques than the catalogue's, so K is not compared" * elsewhere
    ends = f"±{100 * LOST_MOTION_SHARE:.0f} % of {found.rated:g} N·m"
    yield "lost motion", f"{found.lost_motion_arcsec:.2f}″ between {ends}; play {found.play_arcsec:.2f}″"
    theirs = drive.catalogue.lost_motion
    percent = _percent(off(found.lost_motion_arcsec, theirs) or 0.0)
    yield "  catalogue", f"{theirs:g}″, with friction; ours is off by {percent}" if theirs else ""
    yield "assumed", on_what(drive)
    yield "next", again("check", drive)
