"""The stiffness curve as a plot and tables, as JSON, and as CSV."""

from __future__ import annotations

from math import pi

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.error.stiffness import LOST_MOTION, Segment, Stiffness
from hdassist.preset.fields import Drive
from hdassist.terminal.answers import Json, certificate_object, cross_checked, envelope
from hdassist.terminal.console import Style, table
from hdassist.terminal.plot import curve
from hdassist.terminal.quantities import Quantity, as_object
from hdassist.terminal.runs import Answer, Figures

ARCMIN = pi / 10800  # rad

WHOLE: tuple[Quantity[Stiffness], ...] = (
    Quantity("rated_Nm", "rated torque", "N·m", "g", lambda s: s.rated),
    Quantity("lost_motion_arcsec", f"lost motion, +-{LOST_MOTION:.0%} of rated", "arcsec", ".2f",
             lambda s: s.lost_motion_arcsec),
    Quantity("play_arcsec", "play", "arcsec", ".2f", lambda s: s.play_arcsec),
)  # fmt: skip


def answer(drive: Drive, result: Stiffness, *, plots: bool) -> Answer:
    """What there is to say of a drive's stiffness; plots, whether the curve is drawn."""
    return Answer(
        to_json=lambda: to_json(drive, result),
        page=lambda style: render(drive, result, style, plots=plots),
        summary_line=lambda: summary_line(result),
        figures=lambda: figures(result),
        about=drive.name,
        warnings=warnings(drive, result),
        proof=result.certificate,
    )


def warnings(drive: Drive, result: Stiffness) -> tuple[str, ...]:
    """What a reader should know beside the numbers."""
    unrated = f"no operation.rated in the preset: {result.rated:g} N*m, the greatest of operation.M_g, stands for it"
    return (*drive.origin.warnings, *([unrated] if drive.operation.rated is None else []))


def render(drive: Drive, result: Stiffness, style: Style, *, plots: bool = True) -> RenderableType:
    """The curve, the segments of both sides, lost motion and play."""
    parts: list[RenderableType] = [
        Text(style.text(f"{drive.name}: twist of the drive without deviations, the cam held"), style="bold")
    ]
    if plots:
        drawn = curve(style, result.torque, result.twist_arcsec, x_label="torque, N·m", y_label="twist, arcsec")
        parts.append(Text(drawn))
    parts += [*([_segments(result, style)] if result.positive else []), _whole(result, style)]
    words = f"certificate: {result.certificate}{cross_checked([result.cross_check])}"
    parts.append(Text(words))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _segments(result: Stiffness, style: Style) -> Table:
    grid = table(style, "torsional stiffness")
    for words in ("segment", "torque, N·m", "K, 1e4 N·m/rad", "K, N·m/arcmin", "K the other way, 1e4 N·m/rad"):
        grid.add_column(style.text(words), justify="left" if words == "segment" else "right")
    for k, (plus, minus) in enumerate(zip(result.positive, result.negative, strict=True), 1):
        span = f"{plus.start:.4g} to {plus.end:.4g}"
        arcmin = plus.stiffness * ARCMIN
        numbers = (f"{plus.stiffness / 1e4:.3g}", f"{arcmin:.4g}", f"{minus.stiffness / 1e4:.3g}")
        grid.add_row(f"K{k}", span, *numbers)
    return grid


def _whole(result: Stiffness, style: Style) -> Table:
    grid = table(style, "near zero", header=False)
    grid.add_column()
    grid.add_column(justify="right")
    for quantity in WHOLE:
        grid.add_row(style.text(quantity.words), quantity.text(result))
    return grid


def to_json(drive: Drive, result: Stiffness) -> Json:
    """The curve and what is read off it as a JSON object."""

    def segments(side: tuple[Segment, ...]) -> list[dict[str, float]]:
        return [{"from_Nm": s.start, "to_Nm": s.end, "stiffness_Nm_per_rad": s.stiffness} for s in side]

    return {
        **envelope("stiffness", drive, 0, warnings(drive, result)),
        **as_object(WHOLE, result),
        "positive": segments(result.positive),
        "negative": segments(result.negative),
        "curve": {
            "torque_Nm": result.torque.tolist(),
            "twist_arcsec": result.twist_arcsec.tolist(),
            "contact_arcsec": result.contact_arcsec.tolist(),
            "tube_arcsec": result.tube_arcsec.tolist(),
        },
        "certificate": certificate_object(result.certificate, [result.cross_check]),
    }


def figures(result: Stiffness) -> Figures:
    """One row per torque."""
    columns = (result.torque, result.twist_arcsec, result.contact_arcsec, result.tube_arcsec)
    rows = list(zip(*(column.tolist() for column in columns), strict=True))
    return ["torque_Nm", "twist_arcsec", "contact_arcsec", "tube_arcsec"], rows


def summary_line(result: Stiffness) -> str:
    """The answer alone: the segments, and lost motion."""
    lines = [f"K{k}: {s.stiffness / 1e4:.3g}e4 N*m/rad" for k, s in enumerate(result.positive, 1)]
    return "\n".join([*lines, f"lost motion: {result.lost_motion_arcsec:.2f} arcsec"])
