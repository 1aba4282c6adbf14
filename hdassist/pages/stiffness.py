"""The stiffness curve as a plot and tables, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import pi

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.design.beside_catalogue import ends_words, off, segments_off, stiffness_object
from hdassist.error.stiffness import LOST_MOTION_SHARE, Segment, Stiffness
from hdassist.json_parts import Json, certificate_object
from hdassist.preset.fields import Drive
from hdassist.preset.overrides import is_overridden
from hdassist.report.quantities import Quantity, as_object
from hdassist.terminal.answers import cross_check_words, envelope
from hdassist.terminal.brief import again, facts, on_what, proof
from hdassist.terminal.console import Style, TextTable, grid
from hdassist.terminal.plot import curve
from hdassist.terminal.runs import Answer, CsvTable

ARCMIN = pi / 10800  # rad
NARROW_TABLE = 60  # columns below which a table leaves out what can be worked out from the rest of it

WHOLE_QUANTITIES: tuple[Quantity[Stiffness], ...] = (
    Quantity("rated_Nm", "rated torque", "N·m", "g", lambda s: s.rated),
    Quantity("lost_motion_arcsec", f"lost motion, +-{LOST_MOTION_SHARE:.0%} of rated", "arcsec", ".2f",
             lambda s: s.lost_motion_arcsec),
    Quantity("play_arcsec", "play", "arcsec", ".2f", lambda s: s.play_arcsec),
)  # fmt: skip


def stiffness_answer(drive: Drive, result: Stiffness, *, plots: bool, details: bool = False) -> Answer:
    """What there is to say of a drive's stiffness; plots, whether the curve is drawn; details, whether all tables."""
    return Answer(
        to_json=lambda: stiffness_json(drive, result),
        page=lambda style: stiffness_page(drive, result, style, plots=plots, details=details),
        summary_line=lambda: stiffness_summary(result),
        figures=lambda: stiffness_csv(result),
        about=drive.name,
        warnings=stiffness_warnings(drive, result),
        proof=result.certificate,
    )


def stiffness_warnings(drive: Drive, result: Stiffness) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    if drive.operation.rated is not None:
        return drive.origin.warnings
    asked = is_overridden("operation.M_g", drive.origin.overrides)
    whose = "the greatest torque asked for" if asked else "the greatest of operation.M_g"
    stands = f"no operation.rated in the preset: {result.rated:g} N*m, {whose}, stands for it"
    return (*drive.origin.warnings, f"{stands} in lost motion; --set operation.rated=T tells it" if asked else stands)


def stiffness_page(
    drive: Drive, result: Stiffness, style: Style, *, plots: bool = True, details: bool = False
) -> RenderableType:
    """The curve, the segments, and what to know of them; with details both sides, tangents and the whole proof."""
    parts: list[RenderableType] = [
        Text(style.text(f"{drive.name}: twist of the drive without deviations, the cam held"), style="bold")
    ]
    if plots:
        drawn = curve(style, result.torque, result.twist_arcsec, x_label="torque, N·m", y_label="twist, arcsec")
        parts.append(Text(drawn))
    parts += [segments_table(drive, result, style, both=details)] if result.positive else []
    if details:
        parts += [facts(style, [("segments", words)])] if (words := ends_words(drive, result)) else []
        parts += details_tables(drive, result, style)
        parts.append(Text(f"certificate: {result.certificate}{cross_check_words([result.cross_check])}"))
    else:
        parts.append(facts(style, _lines(drive, result)))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _lines(drive: Drive, result: Stiffness) -> Iterator[tuple[str, str]]:
    """What is to be known beside the segments, a label and a text each."""
    yield "segments", ends_words(drive, result)
    slopes = ", ".join(f"{_scaled(t.stiffness)} at {t.torque:g} N·m" for t in result.tangents)
    yield "tangent", slopes and f"{slopes}, 1e4 N·m/rad"
    play = f"; play {result.play_arcsec:.2f} arcsec"
    ends = f"±{LOST_MOTION_SHARE:.0%} of {result.rated:g} N·m".replace("%", " %")
    yield "lost motion", f"{result.lost_motion_arcsec:.2f} arcsec between {ends}{play}"
    theirs = drive.catalogue.lost_motion
    compared = f"{theirs:g} arcsec, with friction; ours is off by {_lost_motion_off(drive, result)}" if theirs else ""
    yield "  catalogue", compared
    yield "rests on", on_what(drive)
    yield "next", again("check", drive)
    yield "proof", proof(result.certificate, [result.cross_check])
    yield "more", "--details"


def _scaled(stiffness: float) -> str:
    return f"{stiffness / 1e4:.3g}"


def _lost_motion_off(drive: Drive, result: Stiffness) -> str:
    return _percent(off(result.lost_motion_arcsec, drive.catalogue.lost_motion))


def _percent(percent: float | None) -> str:
    return "-" if percent is None else f"{percent:+.0f} %"


def segments_table(drive: Drive, result: Stiffness, style: Style, *, both: bool) -> TextTable:
    """A row for each segment, beside what the catalogue says of it; both, whether those of the negative side follow."""
    theirs = (drive.catalogue.K_1, drive.catalogue.K_2, drive.catalogue.K_3)
    wide = style.width >= NARROW_TABLE
    beside = ["catalogue", "off by"][: 1 + wide] if any(theirs) else []
    other = ["K, N·m/arcmin"][:wide]
    found = grid(style, "torsional stiffness", "", "torque, N·m", "K, 1e4 N·m/rad", *beside, *other)
    found.overflow = "fold"
    for side in (result.positive, result.negative)[: 1 + both]:
        percents = segments_off(drive.catalogue, side)
        for k, (segment, K, percent) in enumerate(zip(side, theirs, percents, strict=False), 1):
            known = ["-" if K is None else _scaled(K), _percent(percent)][: len(beside)]
            span = f"{segment.start:.4g} to {segment.end:.4g}"
            by_arcmin = [f"{segment.stiffness * ARCMIN:.4g}"][:wide]
            found.add_row(f"K{k}", span, _scaled(segment.stiffness), *known, *by_arcmin)
    return found


def details_tables(drive: Drive, result: Stiffness, style: Style) -> Iterator[TextTable]:
    """Tangent stiffnesses where torques were asked for, and the figures near zero."""
    if result.tangents:
        yield _tangents(result, style)
    yield _near_zero(drive, result, style)


def _tangents(result: Stiffness, style: Style) -> TextTable:
    found = grid(style, "tangent stiffness dT/dphi", "torque, N·m", "1e4 N·m/rad", "N·m/arcmin", words=0)
    for tangent in result.tangents:
        found.add_row(f"{tangent.torque:g}", _scaled(tangent.stiffness), f"{tangent.stiffness * ARCMIN:.4g}")
    return found


def _near_zero(drive: Drive, result: Stiffness, style: Style) -> TextTable:
    found = TextTable(style, "near zero", ("", ""), (False, True), header=False)
    for quantity in WHOLE_QUANTITIES:
        found.add_row(style.text(quantity.words), quantity.text(result))
    if drive.catalogue.lost_motion:
        found.add_row("lost motion of the catalogue, arcsec", f"{drive.catalogue.lost_motion:g}")
        found.add_row("  ours off by", _lost_motion_off(drive, result))
    return found


def stiffness_json(drive: Drive, result: Stiffness) -> Json:
    """The curve and what is read off it as a JSON object."""
    return {
        **envelope("stiffness", drive, 0, stiffness_warnings(drive, result)),
        **as_object(WHOLE_QUANTITIES, result),
        "catalogue": stiffness_object(drive.catalogue, result),
        "positive": segment_objects(result.positive),
        "negative": segment_objects(result.negative),
        "tangents": [{"M_g_Nm": t.torque, "stiffness_Nm_per_rad": t.stiffness} for t in result.tangents],
        "curve": {
            "torque_Nm": result.torque.tolist(),
            "twist_arcsec": result.twist_arcsec.tolist(),
            "contact_arcsec": result.contact_arcsec.tolist(),
            "tube_arcsec": result.tube_arcsec.tolist(),
        },
        "certificate": certificate_object(result.certificate, [result.cross_check]),
    }


def segment_objects(side: Iterable[Segment]) -> list[Json]:
    """Segments of one side for JSON."""
    return [{"from_Nm": s.start, "to_Nm": s.end, "stiffness_Nm_per_rad": s.stiffness} for s in side]


def stiffness_csv(result: Stiffness) -> CsvTable:
    """One row per torque."""
    columns = (result.torque, result.twist_arcsec, result.contact_arcsec, result.tube_arcsec)
    rows = list(zip(*(column.tolist() for column in columns), strict=True))
    return ["torque_Nm", "twist_arcsec", "contact_arcsec", "tube_arcsec"], rows


def stiffness_summary(result: Stiffness) -> str:
    """The answer alone: the segments, and lost motion."""
    lines = [f"K{k}: {s.stiffness / 1e4:.3g}e4 N*m/rad" for k, s in enumerate(result.positive, 1)]
    return "\n".join([*lines, f"lost motion: {result.lost_motion_arcsec:.2f} arcsec"])
