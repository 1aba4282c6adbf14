"""The design check of a drive as a report."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from hdassist.belief.prior import DrivePrior
from hdassist.belief.samples import ErrorBelief, Samples
from hdassist.design.beside_catalogue import accuracy_object, accuracy_words
from hdassist.design.check import DesignCheck, OperatingPoint
from hdassist.json_parts import influence_objects, measure_objects, pitch_object, samples_object, unknown_objects
from hdassist.model.geometry import Geometry
from hdassist.model.unknown import unknown_names
from hdassist.report.blocks import Block, Curve, Facts, Paragraph, Table
from hdassist.report.quantities import Quantity, as_object, csv_table
from hdassist.report.report import CsvTable, Report
from hdassist.terminal.brief import again
from hdassist.terminal.influence_words import influence_words, measure_words, samples_words
from hdassist.terminal.wheels_page import heading
from hdassist.verdict import Verdict

LEAST_ERROR = 1e-3  # arcsec: an F'_ior below it counts as that
LEAST_SHARE = 0.1  # of F'_ior, that another coupling takes off where it is named


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


def _range_text(belief: ErrorBelief) -> str:
    return f"{belief.p5:.1f} to {belief.p95:.1f}"


_ON_PAGE: tuple[Quantity[OperatingPoint], ...] = (
    Quantity("torque", "torque, N·m", "", "g", lambda p: p.M_g),
    Quantity("F_ior", "F'_ior", "", ".2f", lambda p: p.belief.p50 if p.belief else p.error.F_ior_arcsec),
    Quantity("range", "5 to 95 %", "", _range_text, lambda p: p.belief),
    Quantity("self_error", "self error", "", ".2f", lambda p: p.self_error.range_arcsec),
    Quantity("limit", "limit", "", "g", lambda p: p.limit_arcsec),
    Quantity("verdict", "verdict", "", "", lambda p: str(p.verdict)),
)


def check_report(check: DesignCheck, seed: int) -> Report:
    """A design check; seed, of its sample that was solved again."""
    least_sure = check.points[check.least_sure]
    first = spread_curve(check, check.samples) if check.unknown and check.samples else error_curve(check, least_sure)
    others = [point for point in check.points if check.unknown or point is not least_sure]
    return Report(
        command="check",
        drive=check.drive,
        head=_head(check),
        verdict=str(check.verdict),
        why=tuple(filter(None, map(verdict_reason, check.points))),
        blocks=(F_ior_table(check), Facts.of(_facts(check)), first),
        details=(*error_tables(check), Facts.of(_more_facts(check)), *(error_curve(check, each) for each in others)),
        certificate=check.certificate,
        cross_checks=check.cross_checks,
        values=_values(check, seed),
        csv=check_csv(check),
        line=_line(check),
        warnings=check.warnings,
        exit_code=check.verdict.exit_code,
    )


def _head(check: DesignCheck) -> str:
    k = check.kinematics
    where = "rigid wheel" if k.fixed == "rigid" else "flexspline"
    return f"{check.drive.name}, {k.z_g}/{k.z_b} teeth, {where} fixed{heading(check.measured)}"


def F_ior_table(check: DesignCheck) -> Table:
    """F'_ior by torque, with its range over all that is not known exactly and its limit where there are such."""
    empty = {"range"} if not check.samples else set()
    if all(point.limit_arcsec is None for point in check.points):
        empty |= {"limit", "verdict"}
    title = "kinematic error F'_ior over the full cycle, arcsec" + ", unknown as 0" * bool(check.unknown)
    if check.samples and check.prior:
        fitted = f" ({len(check.prior.fitted)} others as fitted)" if check.prior.fitted else ""
        title = f"F'_ior, arcsec: median and range over {len(check.prior.fields)} uncertain inputs{fitted}"
    return Table.by_row(title, [q for q in _ON_PAGE if q.key not in empty], check.points, words=())


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


def _facts(check: DesignCheck) -> Iterator[tuple[str, str]]:
    """Largest influences, the next measurement and the next command, a label and a text each."""
    least_sure = check.points[check.least_sure]
    at = f" at {least_sure.M_g:g} N·m"
    yield "influence", influence_words(check.influences) + at if check.influences else ""
    yield "measure", measure_words(check.to_measure, least_sure.limit_arcsec is not None)
    yield "unknown", "" if check.samples or not check.unknown else f"taken as 0: {unknown_names(check.unknown)}"
    if check.verdict in (Verdict.FAIL, Verdict.INCONCLUSIVE) and not check.unknown:
        yield "coupling", _coupling(check)
    step = "tolerance" if check.verdict is Verdict.PASS else "mount"
    yield "next", again(step, check.drive) + (" with the same pitch files" if check.measured else "")


def _more_facts(check: DesignCheck) -> Iterator[tuple[str, str]]:
    """More to be known beside the numbers, a label and a text each."""
    yield "catalogue", accuracy_words(check.drive.catalogue.accuracy, check.points)
    if check.verdict in (Verdict.PASS, Verdict.NO_LIMIT) or check.unknown:
        yield "coupling", _coupling(check)
    yield "sensitive", _most_sensitive(check)
    yield "unknown", unknown_names(check.unknown) if check.unknown and check.samples else ""
    yield "samples", samples_words(check.samples) if check.samples else ""
    yield "exact", fitted_words(check.prior) if check.prior and check.samples else ""


def _most_sensitive(check: DesignCheck) -> str:
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
    return f"to {words}: {slope:+.2f} arcsec per µm at {M_g:g} N·m"


def _coupling(check: DesignCheck) -> str:
    """F'_ior with a cam that aligns itself, at the torque where it takes most off; empty where it is no lever."""
    pairs = [(p.error.F_ior_arcsec, p.floating.F_ior_arcsec, p.M_g) for p in check.points if p.floating]
    if not pairs:
        return ""
    now, then, M_g = max(pairs, key=lambda pair: 1 - pair[1] / max(pair[0], LEAST_ERROR))
    if then > (1 - LEAST_SHARE) * now or now < LEAST_ERROR:
        return ""
    words = f"a self-aligning cam (cam.coupling: oldham) would bring {now:.1f} to {then:.1f} arcsec at {M_g:g} N·m"
    return words + "; the unknown as 0" * bool(check.unknown)


def fitted_words(prior: DrivePrior) -> str:
    """Identified fields that samples take as exact."""
    paths = prior.fitted
    more = f" and {len(paths) - 3} more" if len(paths) > 3 else ""
    return f"identified, as fitted: {', '.join(paths[:3])}{more}" if paths else ""


def error_curve(check: DesignCheck, point: OperatingPoint) -> Curve:
    """The error over the full cycle at a torque."""
    taken = ", unknown as 0" if check.unknown else ""
    return Curve(
        np.asarray(point.error.states.phi_h / (2 * np.pi)),
        point.error.error_arcsec,
        x_label="cam angle phi_h, turns",
        y_label=f"error at {point.M_g:g} N·m{taken}, arcsec: least and greatest around each cam turn",
        caption=f"Error over the full cycle at {point.M_g:g} N·m{taken}",
        over=1.0,
        rows=8,
    )


def spread_curve(check: DesignCheck, samples: Samples) -> Curve:
    """Percentiles of F'_ior over samples, at the torque that is least sure."""
    point, F_ior = check.points[check.least_sure], samples.F_ior_arcsec[:, check.least_sure]
    order, weights = np.argsort(F_ior), samples.weights / samples.weights.sum()
    held = "" if point.left_arcsec is None else "; line: limit less self error"
    return Curve(
        100 * np.cumsum(weights[order]),
        F_ior[order],
        x_label="% of them stay below",
        y_label=f"F'_ior at {point.M_g:g} N·m, arcsec, of the drives that it may be{held}",
        caption=f"F'_ior at {point.M_g:g} N·m over all that is not known exactly{held}",
        limit=point.left_arcsec,
        rows=8,
    )


def error_tables(check: DesignCheck) -> Iterator[Block]:
    """All figures of the error by torque, and of the drive's geometry."""
    still = "phi_b" if check.kinematics.fixed == "rigid" else "phi_g"
    shown = [q for q in POINT_QUANTITIES if not q.label.strip().startswith(still) and q.key != "verdict"]
    yield geometry_table(check)
    yield Table.by_column(f"over the full cycle{', unknown as 0' * bool(check.unknown)}", shown, check.points)
    if check.samples:
        if check.unknown:
            yield Paragraph(f"not known, and 0 above: {unknown_names(check.unknown)}")
        held = any(point.probability for point in check.points)
        shown = [q for q in (POINT_QUANTITIES[0], *BELIEF, *MONTE_CARLO) if held or "probability" not in q.key]
        yield Table.by_column("F'_ior over all that is not known exactly", shown, check.points)
    if any(point.sensitivity for point in check.points):
        yield Table.by_column("change of F'_ior by a micrometre more", (POINT_QUANTITIES[0], *SLOPES), check.points)


def geometry_table(check: DesignCheck) -> Table:
    """Sizes and cycle of the drive."""
    drive, k, g = check.drive, check.kinematics, Geometry.of(check.drive)
    rows = (
        ("module, mm", f"{drive.gears.m:g}"),
        ("ratio " + ("u_hg" if k.fixed == "rigid" else "u_hb"), f"{k.u:g}"),
        ("cam deformation W_0, mm", f"{drive.cam.W_0:g}"),
        ("rim mid-line r_m, mm", f"{g.r_m:.3f}"),
        ("tip circles g/b, mm", f"{g.r_ag:.3f}/{g.r_ab:.3f}"),
        ("balls", f"{drive.bearing.N} {drive.bearing.ball_motion}"),
        ("states in the cycle", f"{k.cycle_states}"),
        ("cam turns in the cycle", f"{k.cycle_cam_revolutions}"),
    )
    return Table("geometry and kinematics", ("", ""), rows, header=False)


def _values(check: DesignCheck, seed: int) -> dict[str, object]:
    k = check.kinematics
    return {
        "warnings": [*check.warnings, *_at_zero(check)],
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
        "seed": seed,
        "verdict": str(check.verdict),
    }


def _at_zero(check: DesignCheck) -> list[str]:
    """A remark for scripts on the value beside a range; a page shows the range alone."""
    words = "F_ior_arcsec, at_max, at_min and sensitivity take what is not known as 0; the verdict is of belief"
    return [words] if check.unknown and check.samples else []


def check_csv(check: DesignCheck) -> CsvTable:
    """One row per torque."""
    return csv_table(check.drive.name, (*POINT_QUANTITIES, *BELIEF, *SLOPES), check.points)


def _line(check: DesignCheck) -> str:
    """Torque, F'_ior, verdict."""
    return "\n".join(
        f"{p.M_g:g} N*m: F'_ior "
        + (f"{p.belief.p5:.2f} to {p.belief.p95:.2f}" if p.belief else f"{p.error.F_ior_arcsec:.2f}")
        + f" arcsec, {p.verdict}"
        for p in check.points
    )
