"""The design check as tables and a plot, as JSON, and as CSV."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from hdassist.belief.prior import DrivePrior
from hdassist.belief.samples import ErrorBelief
from hdassist.design.beside_catalogue import accuracy_object, accuracy_words
from hdassist.design.check import DesignCheck, OperatingPoint
from hdassist.json_parts import (
    Json,
    certificate_object,
    influence_objects,
    measure_objects,
    pitch_object,
    samples_object,
    unknown_objects,
)
from hdassist.model.geometry import Geometry
from hdassist.model.unknown import unknown_names
from hdassist.solve.certificate import TOLERANCE
from hdassist.solve.throughcvxpy import CROSS_TOLERANCE
from hdassist.terminal.answers import envelope
from hdassist.terminal.brief import again, facts, proof, verdict_coloured, verdict_text
from hdassist.terminal.console import Style, table
from hdassist.terminal.influence_words import influence_words, measure_words, samples_words
from hdassist.terminal.plot import curve
from hdassist.terminal.quantities import Quantity, as_object
from hdassist.terminal.runs import Answer, CsvTable
from hdassist.terminal.wheels_page import heading
from hdassist.verdict import Verdict

LABEL_WIDTH = 30  # columns of a table's words; numbers take 12 each
NUMBER_WIDTH = 12
LEAST_ERROR = 1e-3  # arcsec: an F'_ior below it counts as that
LEAST_SHARE = 0.1  # of F'_ior, that another coupling takes off where it is named
PLOTTED = 8  # rows of a plot


def turns_text(degrees: float) -> str:
    """A cam angle as turns and the degrees beyond them, for a column under that heading; 359.97 deg is a turn."""
    turns, rest = divmod(round(degrees, 1), 360.0)
    return f"{turns:.0f} + {rest:.1f}"


def _angle(extreme: str, angle: str) -> Callable[[OperatingPoint], float]:
    return lambda p: float(np.degrees(getattr(p.error.states, angle)[getattr(p.error, extreme)]))


POINT_QUANTITIES: tuple[Quantity[OperatingPoint], ...] = (
    Quantity("M_g_Nm", "torque M_g", "N·m", "g", lambda p: p.M_g),
    Quantity("F_ior_arcsec", "F'_ior, full cycle", "arcsec", ".2f", lambda p: p.error.F_ior_arcsec),
    Quantity("self_error_arcsec", "self error", "arcsec", ".2f", lambda p: p.self_error.range_arcsec),
    Quantity("F_ior_upper_arcsec", "F'_ior + self error", "arcsec", ".2f", lambda p: p.F_ior_upper_arcsec),
    Quantity("limit_arcsec", "limit", "arcsec", "g", lambda p: p.limit_arcsec),
    Quantity("verdict", "verdict", "", "", lambda p: str(p.verdict)),
    Quantity(
        "at_max.phi_h_deg",
        "greatest at phi_h",
        "turns + deg",
        turns_text,
        _angle("at_max", "phi_h"),
    ),
    Quantity("at_max.phi_g_deg", "  phi_g there", "deg", ".2f", _angle("at_max", "phi_g")),
    Quantity("at_max.phi_b_deg", "  phi_b there", "deg", ".2f", _angle("at_max", "phi_b")),
    Quantity(
        "at_min.phi_h_deg",
        "least at phi_h",
        "turns + deg",
        turns_text,
        _angle("at_min", "phi_h"),
    ),
    Quantity("at_min.phi_g_deg", "  phi_g there", "deg", ".2f", _angle("at_min", "phi_g")),
    Quantity("at_min.phi_b_deg", "  phi_b there", "deg", ".2f", _angle("at_min", "phi_b")),
    Quantity("one_wave_share", "one-wave meshing, share", "", ".3f", lambda p: p.error.one_wave_share),
    Quantity("max_tooth_force_N", "greatest tooth force", "N", ".0f", lambda p: p.error.max_tooth_force_N),
    Quantity("wind_up_arcsec", "mean wind-up", "arcsec", ".1f", lambda p: p.error.wind_up_arcsec),
    Quantity(
        "tooth_phase_arcsec", "self error of tooth phase", "arcsec", ".2f", lambda p: p.self_error.tooth_phase_arcsec
    ),
    Quantity(
        "ball_phase_arcsec", "self error of ball phase", "arcsec", ".2f", lambda p: p.self_error.ball_phase_arcsec
    ),
    Quantity(
        "F_ior_floating_arcsec",
        "F'_ior, self-aligning cam",
        "arcsec",
        ".2f",
        lambda p: p.floating.F_ior_arcsec if p.floating else None,
    ),
)


def _slope(name: str) -> Callable[[OperatingPoint], float | None]:
    return lambda point: getattr(point.sensitivity, name) if point.sensitivity else None


def _of_belief(value: Callable[[ErrorBelief], float]) -> Callable[[OperatingPoint], float | None]:
    return lambda p: None if p.belief is None else value(p.belief)


def _of_probability(name: str) -> Callable[[OperatingPoint], float | None]:
    return lambda p: None if p.probability is None else getattr(p.probability, name)


BELIEF: tuple[Quantity[OperatingPoint], ...] = (
    Quantity("belief.p5_arcsec", "F'_ior, 5th percentile", "arcsec", ".2f", _of_belief(lambda b: b.p5)),
    Quantity("belief.p50_arcsec", "F'_ior, median", "arcsec", ".2f", _of_belief(lambda b: b.p50)),
    Quantity("belief.p95_arcsec", "F'_ior, 95th percentile", "arcsec", ".2f", _of_belief(lambda b: b.p95)),
    Quantity("belief.probability", "probability of keeping it", "", ".2f", _of_probability("value")),
)
MONTE_CARLO: tuple[Quantity[OperatingPoint], ...] = (
    *(
        Quantity(
            f"belief.p{percent}_error_arcsec", f"standard error of the {words}", "arcsec", ".2f",
            _of_belief(lambda b, percent=percent: b.percentile_error(percent / 100)),  # type: ignore[misc]
        )
        for percent, words in ((5, "5th percentile"), (50, "median"), (95, "95th percentile"))
    ),
    Quantity("belief.probability_low", "probability of keeping it, low", "", ".3f", _of_probability("low")),
    Quantity("belief.probability_high", "probability of keeping it, high", "", ".3f", _of_probability("high")),
)  # fmt: skip

SLOPES: tuple[Quantity[OperatingPoint], ...] = tuple(
    Quantity(f"sensitivity.{name}_arcsec_per_um", words, "arcsec/um", "+.2f", _slope(name))
    for name, words in (
        ("j_n", "flank clearance j_n"),
        ("W_0", "wave W_0"),
        ("g_b", "bearing clearance g_b"),
    )
)


KNOWN_ROWS = tuple(q for q in POINT_QUANTITIES if q.key in ("F_ior_arcsec", "F_ior_upper_arcsec"))
OVER = (*BELIEF[:3], *(q for q in POINT_QUANTITIES if q.key == "self_error_arcsec"))
HELD = ("limit_arcsec", "verdict")


def check_answer(check: DesignCheck, *, seed: int, plots: bool, details: bool = False) -> Answer:
    """What there is to say of a check.

    Arguments: seed, of its sample that was solved again; plots, whether curves are drawn; details, whether all tables
    are shown.
    """
    return Answer(
        to_json=lambda: check_json(check, seed),
        page=lambda style: check_page(check, style, plots=plots, details=details),
        summary_line=lambda: check_summary(check),
        figures=lambda: check_figures(check),
        about=check.drive.name,
        warnings=check.warnings,
        proof=check.certificate,
        exit_code=check.verdict.exit_code,
    )


def check_page(check: DesignCheck, style: Style, *, plots: bool = True, details: bool = False) -> RenderableType:
    """The verdict, F'_ior, a plot per torque of the error over the full cycle, and what to know of the answer."""
    parts: list[RenderableType] = [_heading(check, style), *_reasons(check, style)]
    parts += [_geometry(check, style), *_points(check, style)] if details else _columns(check, style, "", _brief(check))
    if plots:
        parts += [Text(_plot(point, style, ", unknown as 0" if check.unknown else "")) for point in check.points]
    parts.append(facts(style, _lines(check, details)))
    if details:
        parts.append(_certificate(check, style))
    return Group(*(line for part in parts for line in (part, Text(""))))


def _brief(check: DesignCheck) -> list[Quantity[OperatingPoint]]:
    """Rows of the short page: F'_ior, or its range over what is not known; limit and verdict where there is one."""
    shown = OVER if check.samples else KNOWN_ROWS
    if all(point.limit_arcsec is None for point in check.points):
        return [*shown]
    limit, verdict = (q for q in POINT_QUANTITIES if q.key in HELD)
    return [*shown, limit, *(BELIEF[3:] if check.samples else ()), verdict]


def _reasons(check: DesignCheck, style: Style) -> Iterator[Text]:
    """Why the verdict of each torque is as it is, in a line."""
    lines = [words for point in check.points if (words := verdict_reason(point))]
    if lines:
        yield Text(style.text("\n".join(lines)))


def verdict_reason(point: OperatingPoint) -> str:
    """Why the verdict at a torque is as it is; empty where there is no limit, or no probability."""
    found = point.probability
    if found is None:
        return ""
    held = f"F'_ior + self error keep {point.limit_arcsec:g} arcsec"
    interval = f"{100 * found.value:.0f} % sure ({100 * found.low:.0f} to {100 * found.high:.0f})"
    words = {
        Verdict.PASS: f"{held}, {interval}",
        Verdict.FAIL: f"{held.replace('keep', 'do not keep')}: {interval}",
    }
    return f"{point.M_g:g} N·m: {words.get(point.verdict, f'open, {held}: {interval}')}"


def _lines(check: DesignCheck, details: bool) -> Iterator[tuple[str, str]]:
    """What is to be known beside the numbers, a label and a text each."""
    yield "catalogue", accuracy_words(check.drive.catalogue.accuracy, check.points)
    yield "lever", _lever(check)
    coupling = _coupling(check)
    yield "coupling", coupling + "; the unknown as 0" * bool(coupling and check.unknown)
    at = f" at {check.points[check.least_sure].M_g:g} N·m"
    yield "influence", influence_words(check.influences) + at if check.influences else ""
    yield "measure", measure_words(check.to_measure, check.points[check.least_sure].limit_arcsec is not None)
    yield "unknown", ("" if check.samples else "taken as 0: ") + unknown_names(check.unknown) if check.unknown else ""
    yield "samples", samples_words(check.samples) if check.samples else ""
    yield "exact", fitted_words(check.prior) if check.prior and check.samples else ""
    step = "tolerance" if check.verdict is Verdict.PASS else "mount"
    yield "next", again(step, check.drive) + (" with the same pitch files" if check.measured else "")
    yield "proof", proof(check.certificate, check.cross_checks)
    yield "more", "" if details else "--details"


def _lever(check: DesignCheck) -> str:
    """The micrometre that changes the greatest share of F'_ior; empty where nobody computed it."""
    slopes = [
        (abs(slope) / max(point.error.F_ior_arcsec, LEAST_ERROR), slope, quantity.label, point.M_g)
        for point in check.points
        for quantity in SLOPES
        if (slope := quantity.value(point))
    ]
    if not slopes:
        return ""
    _, slope, words, M_g = max(slopes)
    return f"a micrometre more of {words}: {slope:+.2f} arcsec at {M_g:g} N·m"


def _coupling(check: DesignCheck) -> str:
    """What a cam that aligns itself would have, at the torque where it takes most off; empty where it is no lever."""
    pairs = [(p.error.F_ior_arcsec, p.floating.F_ior_arcsec, p.M_g) for p in check.points if p.floating]
    if not pairs:
        return ""
    now, then, M_g = max(pairs, key=lambda pair: 1 - pair[1] / max(pair[0], LEAST_ERROR))
    if then > (1 - LEAST_SHARE) * now or now < LEAST_ERROR:
        return ""
    return f"a self-aligning cam (cam.coupling: oldham) would bring {now:.1f} to {then:.1f} arcsec at {M_g:g} N·m"


def fitted_words(prior: DrivePrior) -> str:
    """Identified fields that samples take as exact."""
    paths = prior.fitted
    more = f" and {len(paths) - 3} more" if len(paths) > 3 else ""
    return f"identified, as fitted: {', '.join(paths[:3])}{more}" if paths else ""


def check_json(check: DesignCheck, seed: int) -> Json:
    """The check as a JSON object."""
    k = check.kinematics
    return {
        **envelope("check", check.drive, check.verdict.exit_code, (*check.warnings, *_at_zero(check))),
        "kinematics": {
            "fixed": k.fixed,
            "u_hg" if k.fixed == "rigid" else "u_hb": k.u,
            "cycle_states": k.cycle_states,
            "cycle_cam_revolutions": k.cycle_cam_revolutions,
        },
        "pitch": pitch_object(check.measured),
        "operating_points": [
            {**as_object((*POINT_QUANTITIES, *BELIEF, *MONTE_CARLO, *SLOPES), p), "held_arcsec": p.held_arcsec}
            for p in check.points
        ],
        "catalogue": accuracy_object(check.drive.catalogue.accuracy, check.points),
        "unknown": unknown_objects(check.unknown),
        "identified_as_exact": list(check.prior.fitted) if check.prior else [],
        "influence": influence_objects(check.influences),
        "to_measure": measure_objects(check.to_measure),
        "least_sure_M_g_Nm": check.points[check.least_sure].M_g,
        "samples": samples_object(check.samples),
        "certificate": certificate_object(check.certificate, check.cross_checks),
        "seed": seed,
        "verdict": str(check.verdict),
    }


def _at_zero(check: DesignCheck) -> list[str]:
    """What a script should know of the value beside a range; a page shows the range alone."""
    words = "F_ior_arcsec, at_max, at_min and sensitivity take what is not known as 0; the verdict is of belief"
    return [words] if check.unknown and check.samples else []


def check_figures(check: DesignCheck) -> CsvTable:
    """One row per torque."""
    shown = (*POINT_QUANTITIES, *BELIEF, *SLOPES)
    rows = [[check.drive.name, *(q.value(point) for q in shown)] for point in check.points]
    return ["preset", *(q.key for q in shown)], rows


def check_summary(check: DesignCheck) -> str:
    """The answer alone: torque, F'_ior, verdict."""
    return "\n".join(
        f"{p.M_g:g} N*m: F'_ior "
        + (f"{p.belief.p5:.2f} to {p.belief.p95:.2f}" if p.belief else f"{p.error.F_ior_arcsec:.2f}")
        + f" arcsec, {p.verdict}"
        for p in check.points
    )


def _heading(check: DesignCheck, style: Style) -> Text:
    k = check.kinematics
    where = "rigid wheel" if k.fixed == "rigid" else "flexspline"
    words = f", {k.z_g}/{k.z_b} teeth, fixed: {where}{heading(check.measured)}"
    return verdict_text(style, f"{check.drive.name}: ", check.verdict, words)


def _geometry(check: DesignCheck, style: Style) -> Table:
    drive, k, g = check.drive, check.kinematics, Geometry.of(check.drive)
    ratio = "u_hg" if k.fixed == "rigid" else "u_hb"
    grid = table(style, "geometry and kinematics", header=False)
    for _ in range(2):
        grid.add_column(overflow="fold")
        grid.add_column(justify="right", no_wrap=True)
    cells = [
        ("module, mm", f"{drive.gears.m:g}"),
        (f"ratio {ratio}", f"{k.u:g}"),
        ("cam deformation W_0, mm", f"{drive.cam.W_0:g}"),
        ("states in the cycle", f"{k.cycle_states}"),
        ("rim mid-line r_m, mm", f"{g.r_m:.3f}"),
        ("cam turns in the cycle", f"{k.cycle_cam_revolutions}"),
        ("tip circles g/b, mm", f"{g.r_ag:.3f}/{g.r_ab:.3f}"),
        ("balls", f"{drive.bearing.N} {drive.bearing.ball_motion}"),
    ]
    for left, right in zip(cells[::2], cells[1::2], strict=True):
        grid.add_row(*left, *right)
    return grid


def _points(check: DesignCheck, style: Style) -> Iterator[RenderableType]:
    moving = "phi_g" if check.kinematics.fixed == "rigid" else "phi_b"
    still = "phi_b" if moving == "phi_g" else "phi_g"
    shown = [q for q in POINT_QUANTITIES[1:] if not q.label.strip().startswith(still)]
    yield from _columns(check, style, "kinematic error", shown)
    if check.samples:
        if check.unknown:
            yield Text(style.text(f"not known, and 0 above: {unknown_names(check.unknown)}"))
        held = any(point.probability for point in check.points)
        shown = [q for q in (*BELIEF, *MONTE_CARLO) if held or "probability" not in q.key]
        yield from _columns(check, style, "F'_ior over all that is not known", shown)
    if any(point.sensitivity for point in check.points):
        yield from _columns(check, style, "what a micrometre more does to F'_ior", SLOPES)


def _columns(
    check: DesignCheck, style: Style, title: str, shown: Sequence[Quantity[OperatingPoint]]
) -> Iterator[Table]:
    """One column per torque; as many tables as the width needs."""
    many = max(1, (style.width - LABEL_WIDTH) // (NUMBER_WIDTH + 2))
    for first in range(0, len(check.points), many):
        points = check.points[first : first + many]
        grid = table(style, title)
        grid.add_column(style.text(POINT_QUANTITIES[0].words), overflow="fold")
        for point in points:
            grid.add_column(POINT_QUANTITIES[0].text(point), justify="right", no_wrap=True, min_width=8)
        for quantity in shown:
            grid.add_row(style.text(quantity.words), *(verdict_coloured(quantity.text(point)) for point in points))
        yield grid


def _plot(point: OperatingPoint, style: Style, taken: str) -> str:
    turns = np.asarray(point.error.states.phi_h / (2 * np.pi))
    return curve(
        style,
        turns,
        point.error.error_arcsec,
        x_label="cam angle phi_h, turns",
        y_label=f"error at {point.M_g:g} N·m{taken}, arcsec: least and greatest around each cam turn",
        height=PLOTTED,
        over=1.0,
    )


def _certificate(check: DesignCheck, style: Style) -> Table:
    certificate = check.certificate
    crosses = certificate_object(certificate, check.cross_checks)["cross_check"]
    grid = table(style, "certificate: every state of the cycle solved", header=False)
    grid.add_column(overflow="fold")
    grid.add_column(justify="right", no_wrap=True)
    grid.add_column(overflow="fold")
    for words, value, limit in (
        ("states solved for all of the above", f"{certificate.states}", ""),
        ("negative force, share of scale", f"{certificate.negative_force:.1e}", f"<= {TOLERANCE:.0e}"),
        ("negative gap", f"{certificate.negative_gap:.1e}", f"<= {TOLERANCE:.0e}"),
        ("force on an open gap", f"{certificate.complementarity:.1e}", f"<= {TOLERANCE:.0e}"),
        ("equilibrium", f"{certificate.equilibrium:.1e}", f"<= {TOLERANCE:.0e}"),
        ("states that needed a fallback", f"{certificate.fallbacks}", ""),
        (
            f"{crosses['states']} states again by {crosses['solver']}, arcsec",
            f"{crosses['max_difference_arcsec']:.1e}",
            f"<= {CROSS_TOLERANCE:g}",
        ),
    ):
        grid.add_row(style.text(words), value, style.text(limit))
    return grid
