"""The torsional stiffness of a drive as a report."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import pi

from hdassist.design.beside_catalogue import ends_words, off, segments_off, stiffness_object
from hdassist.error.stiffness import LOST_MOTION_SHARE, Segment, Stiffness, Tangent
from hdassist.json_parts import Json
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.preset.overrides import is_overridden
from hdassist.report.blocks import Curve, Facts, Table
from hdassist.report.quantities import NO_VALUE, Quantity, as_object
from hdassist.report.report import CsvTable, Report
from hdassist.terminal.brief import again, on_what

ARCMIN = pi / 10800  # rad

WHOLE_QUANTITIES: tuple[Quantity[Stiffness], ...] = (
    Quantity("rated_Nm", "rated torque", "N·m", "g", lambda s: s.rated),
    Quantity("lost_motion_arcsec", f"lost motion, +-{LOST_MOTION_SHARE:.0%} of rated", "arcsec", ".2f",
             lambda s: s.lost_motion_arcsec),
    Quantity("play_arcsec", "play", "arcsec", ".2f", lambda s: s.play_arcsec),
)  # fmt: skip
TANGENT_QUANTITIES: tuple[Quantity[Tangent], ...] = (
    Quantity("M_g_Nm", "torque", "N·m", "g", lambda t: t.torque),
    Quantity("stiffness_Nm_per_rad", "stiffness", "1e4 N·m/rad", lambda K: _scaled(K), lambda t: t.stiffness),
    Quantity("by_arcmin", "stiffness", "N·m/arcmin", ".4g", lambda t: t.stiffness * ARCMIN),
)
SEGMENT_QUANTITIES: tuple[Quantity[Segment], ...] = (
    Quantity("from_Nm", "from", "N·m", ".4g", lambda s: s.start),
    Quantity("to_Nm", "to", "N·m", ".4g", lambda s: s.end),
    Quantity("stiffness_Nm_per_rad", "stiffness", "N·m/rad", "g", lambda s: s.stiffness),
)


def stiffness_report(drive: Drive, found: Stiffness) -> Report:
    """The stiffness of a drive: twist over torque, K1, K2, K3, lost motion, tangents."""
    return Report(
        command="stiffness",
        drive=drive,
        head=f"{drive.name}: torsional stiffness without deviations, the cam held",
        blocks=(segments_table(drive, found), Facts.of(_facts(drive, found)), twist_curve(found)),
        details=tuple(details_tables(drive, found)),
        certificate=found.certificate,
        cross_checks=(found.cross_check,),
        values=_values(drive, found),
        csv=_csv(found),
        line=_line(found),
        warnings=stiffness_warnings(drive, found),
    )


def stiffness_warnings(drive: Drive, result: Stiffness) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    if drive.operation.rated is not None:
        return drive.origin.warnings
    asked = is_overridden("operation.M_g", drive.origin.overrides)
    whose = "the greatest torque asked for" if asked else "the greatest of operation.M_g"
    stands = f"no operation.rated in the preset: {result.rated:g} N*m, {whose}, stands for it"
    return (*drive.origin.warnings, f"{stands} in lost motion; --set operation.rated=T tells it" if asked else stands)


def twist_curve(found: Stiffness) -> Curve:
    """Twist over torque."""
    caption = "Twist of the drive without deviations, the cam held"
    return Curve(found.torque, found.twist_arcsec, "torque, N·m", "twist, arcsec", caption, rows=8)


def _facts(drive: Drive, found: Stiffness) -> Iterator[tuple[str, str]]:
    """Facts beside the segments, a label and a text each."""
    yield "segments", ends_words(drive, found)
    slopes = ", ".join(f"{_scaled(t.stiffness)} at {t.torque:g} N·m" for t in found.tangents)
    yield "tangent", slopes and f"{slopes}, 1e4 N·m/rad"
    ends = f"±{LOST_MOTION_SHARE:.0%} of {found.rated:g} N·m".replace("%", " %")
    play = f"; play {found.play_arcsec:.2f} arcsec"
    yield "lost motion", f"{found.lost_motion_arcsec:.2f} arcsec between {ends}{play}"
    theirs = drive.catalogue.lost_motion
    compared = f"{theirs:g} arcsec, with friction; ours is off by {_lost_motion_off(drive, found)}" if theirs else ""
    yield "  catalogue", compared
    yield "assumed", on_what(drive)
    yield "next", again("check", drive)


def _scaled(stiffness: float) -> str:
    return f"{stiffness / 1e4:.3g}"


def _lost_motion_off(drive: Drive, found: Stiffness) -> str:
    return _percent(off(found.lost_motion_arcsec, drive.catalogue.lost_motion))


def _percent(percent: float | None) -> str:
    return NO_VALUE if percent is None else f"{percent:+.0f} %"


def segments_table(drive: Drive, found: Stiffness) -> Table:
    """A row for each segment of both sides, beside the catalogue's stiffness where it gives one."""
    theirs = (drive.catalogue.K_1, drive.catalogue.K_2, drive.catalogue.K_3)
    rows = []
    for side in (found.positive, found.negative):
        percents = segments_off(drive.catalogue, side)
        for k, (segment, K, percent) in enumerate(zip(side, theirs, percents, strict=False), 1):
            beside = (NO_VALUE if K is None else _scaled(K), _percent(percent)) if any(theirs) else ()
            span, by_arcmin = f"{segment.start:.4g} to {segment.end:.4g}", f"{segment.stiffness * ARCMIN:.4g}"
            rows.append((f"K{k}", span, _scaled(segment.stiffness), *beside, by_arcmin))
    beside = ("catalogue", "off by") if any(theirs) else ()
    heads = ("", "torque, N·m", "K, 1e4 N·m/rad", *beside, "K, N·m/arcmin")
    return Table("torsional stiffness in both directions", heads, tuple(rows))


def details_tables(drive: Drive, found: Stiffness) -> Iterator[Table]:
    """Tangent stiffnesses, and the figures near zero beside the catalogue's."""
    if found.tangents:
        yield Table.by_row("tangent stiffness dT/dphi", TANGENT_QUANTITIES, found.tangents, words=())
    rows = [(quantity.words, quantity.text(found)) for quantity in WHOLE_QUANTITIES]
    if drive.catalogue.lost_motion:
        rows.append(("lost motion of the catalogue, arcsec", f"{drive.catalogue.lost_motion:g}"))
        rows.append(("  ours off by", _lost_motion_off(drive, found)))
    yield Table("near zero", ("", ""), tuple(rows), header=False)


def _values(drive: Drive, found: Stiffness) -> Json:
    return {
        **as_object(WHOLE_QUANTITIES, found),
        "catalogue": stiffness_object(drive.catalogue, found),
        "positive": segment_objects(found.positive),
        "negative": segment_objects(found.negative),
        "tangents": [as_object(TANGENT_QUANTITIES[:2], tangent) for tangent in found.tangents],
        "curve": {name: values.tolist() for name, values in _columns(found).items()},
    }


def segment_objects(side: Iterable[Segment]) -> list[Json]:
    """Segments of one side for JSON."""
    return [as_object(SEGMENT_QUANTITIES, segment) for segment in side]


def _columns(found: Stiffness) -> dict[str, Array]:
    return {
        "torque_Nm": found.torque,
        "twist_arcsec": found.twist_arcsec,
        "contact_arcsec": found.contact_arcsec,
        "tube_arcsec": found.tube_arcsec,
    }


def _csv(found: Stiffness) -> CsvTable:
    """One row per torque."""
    columns = _columns(found)
    return [*columns], list(zip(*(values.tolist() for values in columns.values()), strict=True))


def _line(found: Stiffness) -> str:
    """The segments, and lost motion."""
    lines = [f"K{k}: {s.stiffness / 1e4:.3g}e4 N*m/rad" for k, s in enumerate(found.positive, 1)]
    return "\n".join([*lines, f"lost motion: {found.lost_motion_arcsec:.2f} arcsec"])
