"""The self error as a table, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import add

from rich.console import Group, RenderableType
from rich.text import Text

from hdassist.error.self_error import SelfError
from hdassist.json_parts import Json, certificate_object
from hdassist.preset.fields import Drive
from hdassist.report.quantities import Quantity, as_object
from hdassist.solve.answers import Certificate
from hdassist.terminal.answers import envelope
from hdassist.terminal.brief import again, facts, on_what, proof
from hdassist.terminal.console import Style, table
from hdassist.terminal.runs import Answer, CsvTable

SELF_ERROR_QUANTITIES: tuple[Quantity[SelfError], ...] = (
    Quantity("M_g_Nm", "torque M_g", "N·m", "g", lambda e: e.M_g),
    Quantity("self_error_arcsec", "self error", "arcsec", ".2f", lambda e: e.range_arcsec),
    Quantity("tooth_phase_arcsec", "tooth phase alone", "arcsec", ".2f", lambda e: e.tooth_phase_arcsec),
    Quantity("ball_phase_arcsec", "ball phase alone", "arcsec", ".2f", lambda e: e.ball_phase_arcsec),
)


def self_error_answer(drive: Drive, results: Sequence[SelfError]) -> Answer:
    """What there is to say of the self error at each torque."""
    return Answer(
        to_json=lambda: self_error_json(drive, results),
        page=lambda style: self_error_page(drive, results, style),
        summary_line=lambda: self_error_summary(results),
        figures=lambda: self_error_figures(results),
        about=drive.name,
        warnings=drive.origin.warnings,
        proof=_proof(results),
    )


def _proof(results: Sequence[SelfError]) -> Certificate:
    """The worst residuals of all torques."""
    return reduce(add, (result.certificate for result in results))


def self_error_page(drive: Drive, results: Sequence[SelfError], style: Style) -> RenderableType:
    """One row per torque, and what is to be known beside."""
    grid = table(style, f"{drive.name}: error of the drive without deviations")
    for quantity in SELF_ERROR_QUANTITIES:
        grid.add_column(style.text(quantity.words), justify="right")
    for result in results:
        grid.add_row(*(quantity.text(result) for quantity in SELF_ERROR_QUANTITIES))
    phases = drive.numerics.n_phase
    below = [
        ("phases", f"{phases} of a tooth, {phases} of a ball"),
        ("rests on", on_what(drive)),
        ("next", again("check", drive)),
        ("proof", proof(_proof(results))),
    ]
    return Group(grid, Text(""), facts(style, below))


def self_error_json(drive: Drive, results: Sequence[SelfError]) -> Json:
    """The self error as a JSON object; rotation_arcsec by tooth phase, then ball phase."""
    return {
        **envelope("self-error", drive, 0, drive.origin.warnings),
        "operating_points": [
            {**as_object(SELF_ERROR_QUANTITIES, result), "rotation_arcsec": result.rotation_arcsec.tolist()}
            for result in results
        ],
        "certificate": certificate_object(_proof(results)),
    }


def self_error_figures(results: Sequence[SelfError]) -> CsvTable:
    """One row per torque and pair of phases."""
    rows = []
    for result in results:
        phases = len(result.rotation_arcsec)
        for i, line in enumerate(result.rotation_arcsec.tolist()):
            rows += [[result.M_g, i / phases, k / phases, value] for k, value in enumerate(line)]
    return ["M_g_Nm", "tau", "beta", "rotation_arcsec"], rows


def self_error_summary(results: Sequence[SelfError]) -> str:
    """The answer alone: torque and self error."""
    return "\n".join(f"{result.M_g:g} N*m: self error {result.range_arcsec:.2f} arcsec" for result in results)
