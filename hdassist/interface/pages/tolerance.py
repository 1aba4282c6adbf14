"""Reports of random drives: yield and F'_ior, the tolerance to tighten first, the cheapest tolerances for a yield."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from hdassist.belief.samples import Samples
from hdassist.belief.statistics import shares_below
from hdassist.belief.steps import MeasurementGain
from hdassist.features.report import (
    Curve,
    Fact,
    Facts,
    Json,
    Quantity,
    Report,
    Table,
    as_object,
    attributes,
    csv_table,
    influence_objects,
    measure_objects,
    objects,
    quantity_table,
    samples_object,
    to_error_digit,
)
from hdassist.features.tolerance import TOLERANCE_DRIVES
from hdassist.features.tolerance.production import TIGHTER_STEP, Production, ProductionLaw, RandomDrive, TolerancedSize
from hdassist.features.tolerance.tightening import (
    PERCENTILE_SHARES,
    Allocation,
    Allocator,
    Sensitivities,
    Tightened,
    to_measure,
)
from hdassist.features.tolerance.yields import YIELD_TAIL, AtTorque, Percentile, Summary, YieldBelief
from hdassist.interface.terminal.words import MORE_DRAWS, again, field_unit, measure_words, named
from hdassist.run.errors import Verdict

_PLOTTED_SHARES = np.linspace(0, 100, 201)  # shares of the drives at which a plot is evaluated, %
_PLOTTED_ROWS = 5
_AS_ASSEMBLED = "as assembled"  # text on pages for the value "as built" in CSV files
_MORE_DRIVES = "more drives (-n) may decide the verdict"
_FEW_DESIGNS = 8  # number of designs below which a warning says that the range of the yield is uncertain


@dataclass(frozen=True)
class _MountedDrives:
    """Random drives at one torque, either as assembled or with each fixed wheel in its best hole.

    summary: results of all drives.
    point: results at the torque.
    best: whether the fixed wheel of each drive is in its best hole.
    """

    summary: Summary
    point: AtTorque
    best: bool

    @property
    def F_ior(self) -> Sequence[float]:
        """F'_ior of each drive [arcsec]."""
        return self.point.best if self.best else self.point.as_built

    def percentile(self, share: float) -> Percentile:
        """Return a percentile of F'_ior over the drives [arcsec]; share: from 0 to 1."""
        return self.summary.percentile(self.F_ior, share)

    @property
    def yield_belief(self) -> YieldBelief | None:
        """The yield of the drives at this torque; None without a limit."""
        return None if self.point.limit is None else self.summary.yield_of(self.best, self.point)


def _yield_words(found: YieldBelief, digits: str = ".0f") -> str:
    """Return a yield with its interval as text: the median over the designs, or the yield of the only design."""
    middle = found.share if len(found.weights) == 1 else found.percentile(0.5)
    low, high = (format(100 * end, digits) for end in found.range)
    return f"{100 * middle:{digits}} % ({low} to {high})"


def _percentile_words(share: float, drives: _MountedDrives) -> str:
    """Return a percentile of F'_ior [arcsec] as text, rounded to the first digit of its standard error."""
    percentile = drives.percentile(share)
    return to_error_digit(percentile.value, percentile.standard_error)


def _percentile(share: float, drives: _MountedDrives) -> float:
    """Return a percentile of F'_ior [arcsec]."""
    return drives.percentile(share).value


_PERCENTILES = (("p5", "5 %", 0.05), ("p50", "median", 0.5), ("p95", "95 %", 0.95))
_MOUNTING_COLUMNS = quantity_table(
    "tolerance.page",
    wheel=lambda drives: f"best of {drives.summary.positions}" if drives.best else "as built",
    wheel_words=lambda name: _AS_ASSEMBLED if name == "as built" else f"{name} holes",
)
_F_IOR_COLUMNS = quantity_table(
    "tolerance.F_ior", **{name: partial(_percentile, share) for name, _, share in _PERCENTILES}
)
_DRIVES_CSV = (*_MOUNTING_COLUMNS, *_F_IOR_COLUMNS, Quantity("yield", value="yield_belief.share"))
_F_IOR_ON_PAGE = tuple(
    replace(column, digits="", value=partial(_percentile_words, share))
    for column, (_, _, share) in zip(_F_IOR_COLUMNS, _PERCENTILES, strict=True)
)
_YIELD_COLUMNS = quantity_table("tolerance.yield", **{"yield": _yield_words})


def _verdict_of_drives(summary: Summary) -> str:
    """Return the verdict on the required yield; if no yield is required but there are limits, return the yield."""
    # without a required yield there is no verdict, so the yield is the result
    if summary.has_limit and summary.wanted is None:
        return _yields(summary)
    return str(summary.verdict)


def _measure_words(
    summary: Summary,
    gains: Sequence[MeasurementGain],
    M_g: float,
) -> str:
    """Return the measurements that may decide the verdict, or else the hint to sample more drives, as text.

    The text is empty unless the verdict is INCONCLUSIVE.
    """
    if summary.verdict is not Verdict.INCONCLUSIVE:
        return ""
    return measure_words(gains, M_g) or _MORE_DRIVES


def _head_of_drives(law: ProductionLaw, summary: Summary) -> str:
    """Return the heading of the page: the drive, the number of random drives, and the number of their designs."""
    designs = f" of {summary.design_count} sampled designs" if law.shared else ""
    return f"{law.drive.name}, {summary.count} random drives{designs}"


def _least_yield_torque(summary: Summary) -> int:
    """Return the index of the torque at which the yield is smallest, with each fixed wheel in its best hole."""
    # True selects the best holes
    shares = [summary.yield_of(True, point).share for point in summary.points]
    return shares.index(min(shares))


def _plots_by_torque(summary: Summary, drives: Sequence[_MountedDrives]) -> list[Curve]:
    """Return one plot per torque, with the distribution of F'_ior as assembled and in the best holes."""
    return [_share_below([of_way for of_way in drives if of_way.point is point]) for point in summary.points]


def _mounted_drives(summary: Summary) -> list[_MountedDrives]:
    """Return the drives at each torque, as assembled and, if the wheel has several positions, in the best holes."""
    # a wheel with a single position is always in its best hole
    ways = (False, True) if summary.positions > 1 else (False,)
    return [_MountedDrives(summary, point, best) for point in summary.points for best in ways]


def tolerance_report(
    law: ProductionLaw,
    seed: int,
    summary: Summary,
    samples: Samples | None,
    *,
    interrupted: bool = False,
) -> Report:
    """Return the report of random drives: their F'_ior and their yield.

    law: distributions of the random drives.
    seed: seed of the random drives.
    summary: results of the drives.
    samples: samples of the designs; None for a single design, or if all drives were stored by an earlier run.
    interrupted: whether the user stopped the computation.
    """
    drive = law.drive
    points = summary.points
    drives = _mounted_drives(summary)
    worst = _least_yield_torque(summary)
    # a measurement narrows the range of the yield only if designs differ
    gains = to_measure(law, samples, worst) if samples else ()
    table = _drives_table(law, summary, drives)
    plots = _plots_by_torque(summary, drives)
    # the short page shows the plot for the torque with the smallest yield, and the details show the other plots
    worst_plot = plots.pop(worst)
    facts = [
        ("best hole", _best_of(summary, drives)),
        ("measure", _measure_words(summary, gains, points[worst].M_g)),
        ("next", again("sensitivity", drive)),
    ]
    # all numbers on the page depend on these distributions
    distributions = Facts((("distributions", _drawn(law, seed)),))
    return Report(
        command="tolerance",
        drive=drive,
        head=_head_of_drives(law, summary),
        verdict=_verdict_of_drives(summary),
        why=tuple(_reasons(summary)),
        blocks=(table, Facts.of(facts), worst_plot),
        details=(distributions, *plots),
        certificate=summary,
        values=_values(law, seed, summary, gains),
        csv=csv_table(drive.name, _DRIVES_CSV, drives),
        line=_tolerance_line(summary, table),
        warnings=(*_law_warnings(law), *_few(law, summary)),
        exit_code=130 if interrupted else summary.verdict.exit_code,
    )


def _drives_table(
    law: ProductionLaw,
    summary: Summary,
    drives: Sequence[_MountedDrives],
) -> Table:
    """Return the table of the percentiles of F'_ior over random drives, with the yield if there is a limit."""
    title = "F'_ior of drives of this type, ″ (percentiles)"
    if summary.has_limit and law.shared:
        title += f"; yield: median ({100 * YIELD_TAIL:.0f} to {100 - 100 * YIELD_TAIL:.0f} %) over designs"
    columns = (*_MOUNTING_COLUMNS, *_F_IOR_ON_PAGE)
    if summary.has_limit:
        columns = (*columns, *_YIELD_COLUMNS)
    return Table.by_row(title, columns, drives)


def _tolerance_line(summary: Summary, table: Table) -> str:
    """Return the result for -q: the yield, or without a limit the 95th percentile from each row of the table.

    table: table of the page.
    """
    if not summary.has_limit:
        return "\n".join(f"{row[0]} N*m, {row[1]}: 95 % of drives below {row[4]}″" for row in table.rows)
    verdict = "" if summary.wanted is None else f": {summary.verdict}"
    return f"{_yields(summary)}{verdict}"


def drive_table(
    production: Production, records: Iterable[RandomDrive]
) -> tuple[dict[str, type], Iterator[tuple[Any, ...]]]:
    """Return random drives as a table: the type of each column by its name, and one row per drive.

    Missing values are None.
    """
    torques = [repr(M_g).removesuffix(".0") for M_g in production.torques]
    F_ior = [f"{which}F_ior_arcsec@{M_g}" for which in ("", "best_") for M_g in torques]
    drawn = [field.path for field in production.law.joint.fields]
    floats = (*F_ior, "best_rotation_deg", "max_residual")
    none = [None for _ in torques]
    kinds = {"drive": int, "design": int, "weight": float, **dict.fromkeys(floats, float), "refused": str}
    rows = (
        (
            *(number, record.design, record.weight),
            *(record.F_ior_arcsec or none),
            *(record.best_F_ior_arcsec or none),
            *(record.best_rotation_deg, record.max_residual, record.refused),
            *map(record.values.get, drawn),
        )
        for number, record in enumerate(records)
    )
    return kinds | dict.fromkeys(drawn, float), rows


def _drawn(law: ProductionLaw, seed: int) -> str:
    """Return the distributions of the random drives as text."""
    laws = ", ".join(sorted({field.law for field in law.own if isinstance(field, TolerancedSize)}))
    parts = [f"stated sizes: {laws}" if laws else "", "other sizes: uniform" if law.not_given else "", f"seed {seed}"]
    return "; ".join(filter(None, parts))


def _few(law: ProductionLaw, summary: Summary) -> Iterator[str]:
    """Yield a warning if there are too few designs for the range of a yield, and one if drives have no result."""
    if law.shared and summary.design_count < _FEW_DESIGNS:
        designs = f"only {summary.design_count} designs were sampled"
        yield f"{designs}; a yield range needs at least {_FEW_DESIGNS}. Use more drives (-n)"
    if summary.refused:
        yield (
            f"{len(summary.refused)} drives have no result ({summary.reason}); the range of the yield "
            "covers both PASS and FAIL for these drives"
        )


def _best_of(summary: Summary, drives: Sequence[_MountedDrives]) -> str:
    """Return the reason why, at some torque, the best hole is worse than the hole as assembled.

    The text is empty if neither a percentile of F'_ior nor the 5th percentile of its reduction is worse in the best
    holes than as assembled.
    """
    built, best = (
        np.array(
            [[_percentile(share, curves) for *_, share in _PERCENTILES] for curves in drives if curves.best is way]
        )
        for way in (False, True)
    )
    if not best.size:
        return ""
    smallest_reduction = min(summary.reduction(point, 0.05).value for point in summary.points)
    if not np.any(best > built) and smallest_reduction >= 0:
        return ""
    reference = "its limit" if summary.has_limit else "the value as assembled"
    hole = f"one hole per drive for all torques, with the smallest F'_ior relative to {reference} at the worst torque"
    return f"{hole}. At a single torque this hole may be worse than the hole as assembled"


def _law_warnings(law: ProductionLaw) -> tuple[str, ...]:
    """Return the warnings about a drive and about the distributions of the random drives."""
    if not law.not_given:
        return law.drive.origin.warnings
    names = ", ".join(law.not_given)
    return (*law.drive.origin.warnings, f"inputs without a tolerance are sampled as in check: {names}")


def _yields(summary: Summary) -> str:
    assembled = f"yield as assembled {_yield_words(summary.yield_of(False), '.1f')}"
    if summary.positions == 1:
        return assembled
    return f"{assembled}, with each wheel in its best hole {_yield_words(summary.yield_of(True), '.1f')}"


def _reasons(summary: Summary) -> Iterator[str]:
    """Yield the probability of the required yield, and the yields; without a limit, the gain from the best hole."""
    if summary.has_limit and summary.wanted is not None:
        probability = summary.yield_of(True).probability(summary.wanted).text(summary.sure)
        name = "best-hole yield" if summary.positions > 1 else "yield"
        yield f"Probability that the {name} is at least {100 * summary.wanted:g} %: {probability}"
        yield _yields(summary)
    elif summary.positions > 1 and not summary.has_limit:
        off = []
        for point in summary.points:
            low, median, high = (100 * summary.reduction(point, share).value for *_, share in _PERCENTILES)
            off.append(f"{median:z.0f} % ({low:z.0f} to {high:z.0f}) at {point.M_g:g} N·m")
        yield f"Reduction of F'_ior by the best hole, median (5 to 95 % of the drives): {', '.join(off)}"


def _share_below(drives: Sequence[_MountedDrives]) -> Curve:
    """Return the curve of F'_ior over the share of drives below it, as assembled and in the best holes.

    drives: drives at one torque, as assembled first.
    """
    point = drives[0].point
    weights = np.array(drives[0].summary.weights)
    limit = None if point.limit is None or point.limit <= point.self_error else point.limit - point.self_error
    curves = [np.interp(_PLOTTED_SHARES, *shares_below(np.array(curves.F_ior), weights)) for curves in drives]
    x_label = "share of the drives, %"
    y_label = f"F'_ior at {point.M_g:g} N·m, ″"
    y_label += "" if limit is None else f"; line: {limit:.4g} (limit {point.limit:g} minus self error)"
    best = curves[1] if len(curves) > 1 else None
    return Curve(
        x=_PLOTTED_SHARES,
        y=curves[0],
        x_label=x_label,
        y_label=y_label,
        second=best,
        names=() if best is None else ("as assembled", "best hole"),
        limit=limit,
        rows=_PLOTTED_ROWS,
    )


def _values(
    law: ProductionLaw,
    seed: int,
    summary: Summary,
    gains: Sequence[MeasurementGain],
) -> Json:
    ways = {"as_built": False, "best_position": True}
    has_yield = summary.has_limit and summary.count
    return {
        **attributes(summary, "positions", "sure", "verdict", drives="count", designs="design_count"),
        "refused": len(summary.refused),
        "seed": seed,
        "scatter": [
            {
                **attributes(f, "low", "high", field="path"),
                "kind": f.law if isinstance(f, TolerancedSize) else f.distribution,
                "unit": field_unit(f.path),
                "shared": f in law.shared,
                "assumed": f.path in law.not_given,
            }
            for f in law.joint.fields
        ],
        "yield": {name: _yield_object(summary, best) for name, best in ways.items()} if has_yield else None,
        "yield_wanted": summary.wanted,
        "operating_points": [
            {
                **attributes(point, M_g_Nm="M_g", limit_arcsec="limit", self_error_arcsec="self_error"),
                "gain": {name: summary.reduction(point, share).value for name, _, share in _PERCENTILES},
                **{name: _F_ior_object(_MountedDrives(summary, point, best)) for name, best in ways.items()},
            }
            for point in summary.points
        ],
        "to_measure": measure_objects(gains),
    }


def _F_ior_object(drives: _MountedDrives) -> Json:
    """Return the percentiles of F'_ior over random drives, with their Monte Carlo intervals, as JSON."""
    percentiles = {name: drives.percentile(share) for name, _, share in _PERCENTILES}
    intervals = {
        f"{name}_interval_arcsec": (percentile.low, percentile.high) for name, percentile in percentiles.items()
    }
    return as_object(_F_IOR_COLUMNS, drives) | intervals


def _yield_object(summary: Summary, best: bool) -> Json:
    """Return a yield with its range over the designs and the probability of the required yield, as JSON.

    best: whether the fixed wheel of each drive is in its best hole.
    """
    yield_ = summary.yield_of(best)
    wanted = summary.wanted
    return {
        **_yield_range(yield_),
        "median": yield_.percentile(0.5),
        "good": yield_.passed.sum(),
        "probability": None if wanted is None else yield_.probability(wanted),
    }


def _yield_range(found: YieldBelief) -> Json:
    """Return a yield with the 5th and 95th percentile over the designs, as JSON."""
    low, high = found.range
    return {"share": found.share, "low": low, "high": high}


_LISTED = (5, 3)  # numbers of fields on the first screen, with a tolerance and without
_NO_SHARE = "-: contribution too small to distinguish from chance with this number of drives (-n)"
_UNDECIDED = "undecided, more drives (-n) are needed"
_MORE_TIMES = 4
_STEP_WORDS = f"{100 * (1 - TIGHTER_STEP):.0f} % tighter"


@dataclass(frozen=True)
class _FieldEffect:
    """Effect of a field at a torque.

    M_g: torque [N*m].
    path: path of the field.
    share: contribution to the variance of F'_ior; None if it is unknown.
    tightened: effect of a tighter tolerance; None for a field without a tolerance.
    """

    M_g: float
    path: str
    share: float | None
    tightened: Tightened | None


_TIGHTENED_KEYS = ("now", "now_error", "then", "low", "high", "proven", "reduction", "reduction_low", "reduction_high")
_EFFECT_CSV = quantity_table("sensitivity.csv")
_EFFECT_COLUMNS = quantity_table(
    "sensitivity.page",
    words=named,
    whole_percent=lambda share: f"{100 * share:.0f}",
    reduction=lambda way: _reduction_words(way) if way.proven else f"≤ {_reduction_words(way)}",
)


def _reduction_words(way: Tightened, unit: str = "") -> str:
    """Return the relative reduction of the 95th percentile by a tighter tolerance, with its interval [%], as text."""
    return f"{100 * way.reduction:z.0f}{unit} ({100 * way.reduction_low:z.0f} to {100 * way.reduction_high:z.0f})"


def _allocate_command(sensitivities: Sensitivities) -> str:
    """Return the command that chooses tolerances, with a placeholder for the limit if a torque has none."""
    drive = sensitivities.law.drive
    has_limits = all(drive.limit(M_g) is not None for M_g in sensitivities.samples.torques)
    return again("allocate", drive) if has_limits else again("allocate", drive, "--limit", "LIMIT")


def sensitivity_report(found: Sensitivities) -> Report:
    """Return the report of the sensitivities of a drive."""
    law = found.law
    samples = found.samples
    torques = found.samples.torques
    effects = [_effects(found, t) for t in range(len(torques))]
    verdict, reason, measured = _answer(found)
    drawn = f"{found.count} random drives, each of its own design, seed {samples.seed}"
    # if an input without a tolerance contributes most, measuring this input comes first
    next_command = again("sensitivity", law.drive, *_as_measured(measured)) if measured else _allocate_command(found)
    # only more drives can decide which tolerance to tighten first
    if verdict == _UNDECIDED:
        next_command = again("sensitivity", law.drive, "-n", f"{_MORE_TIMES * len(samples.weights)}")
    facts = [("measure", measure_words(found.to_measure, torques[found.worst])), ("next", next_command)]
    short = _table(effects[found.worst], *_LISTED)
    torque_tables = [_table(of_torque, len(of_torque), len(of_torque)) for of_torque in effects]
    return Report(
        command="sensitivity",
        drive=law.drive,
        head=f"{law.drive.name}, tighten first at {torques[found.worst]:g} N·m",
        verdict=verdict,
        why=(f"{reason} {_percentile_basis(found)}",),
        blocks=(short, Facts.of(facts)),
        details=(Facts((("distributions", drawn),)), *(table for table in torque_tables if table != short)),
        certificate=found,
        values=_sensitivities_object(found),
        csv=csv_table(law.drive.name, _EFFECT_CSV, [effect for at_torque in effects for effect in at_torque]),
        line=f"tighten first: {verdict}; {reason}",
        warnings=_law_warnings(law),
    )


def _sensitivities_object(found: Sensitivities) -> Json:
    """Return the sensitivities of a drive as JSON."""
    samples = found.samples
    points = [
        {
            "M_g_Nm": M_g,
            "F_ior_arcsec": _percentiles_object(found, torque),
            "influence": influence_objects(found.influences[torque]),
            "tighter": objects(found.tightened[torque], *_TIGHTENED_KEYS, field="path"),
        }
        for torque, M_g in enumerate(samples.torques)
    ]
    return {
        "operating_points": points,
        "tighter_factor": TIGHTER_STEP,
        "tighten_first": found.first.path if found.is_worth_tightening else None,
        "to_measure": measure_objects(found.to_measure),
        "samples": samples_object(samples),
        "drives": found.drives,
        "seed": samples.seed,
    }


def _percentiles_object(found: Sensitivities, torque: int) -> Json:
    """Return the percentiles of F'_ior at a torque, with their Monte Carlo intervals, as JSON.

    torque: index of the torque.
    """
    values: Json = {}
    for share, percentile in zip(PERCENTILE_SHARES, found.percentiles[torque], strict=True):
        name = f"p{100 * share:.0f}"
        values[name] = percentile.value
        values[f"{name}_interval_arcsec"] = (percentile.low, percentile.high)
    return values


def _answer(found: Sensitivities) -> tuple[str, str, str]:
    """Return the tolerance to tighten first, the reason, and the path of the field to measure instead.

    If no tolerance is worth tightening, the first text says so. The path is empty if no field is to be measured.
    """
    first = found.first
    largest = found.largest
    percentile = "the 95th percentile of F'_ior"
    if found.is_worth_tightening:
        reduction = _reduction_words(first, " %")
        return named(first.path), f"If this tolerance is {_STEP_WORDS}, {percentile} decreases by {reduction}.", ""
    largest_reduction = max(0.0, *(way.reduction_high for way in found.tightened[found.worst]))
    reason = f"If a tolerance is {_STEP_WORDS}, {percentile} decreases by at most {100 * largest_reduction:.0f} %."
    if largest and largest.group not in {way.path for way in found.tightened[found.worst]}:
        share = f"This input contributes {100 * largest.share:.0f} % to the variance of F'_ior."
        return f"no tolerance; measure {named(largest.group)}", f"{share} {reason}", largest.group
    return _UNDECIDED, reason, ""


def _percentile_basis(found: Sensitivities) -> str:
    """Return the present 95th percentile of F'_ior, with its interval and the number of drives, as text."""
    percentile = found.percentiles[found.worst][-1]
    ends = (percentile.value, percentile.low, percentile.high)
    value, low, high = (to_error_digit(end, percentile.standard_error, 1) for end in ends)
    basis = f"This percentile is now {value}″ ({low} to {high}) over {found.count} random drives."
    if found.count >= TOLERANCE_DRIVES:
        return basis
    return f"{basis} The command tolerance uses {TOLERANCE_DRIVES}."


def _as_measured(path: str) -> tuple[str, str]:
    """Return the option that sets a measured value, with VALUE as placeholder; path: path of the measured field."""
    return "--set", f"{path.replace('stiffness.', 'measured.')}=VALUE"


def _effects(found: Sensitivities, torque: int) -> list[_FieldEffect]:
    """Return the effect of each field at a torque, the largest contributions first; torque: index of the torque."""
    shares = {influence.group: influence.share for influence in found.influences[torque]}
    ways = {way.path: way for way in found.tightened[torque]}
    M_g = found.samples.torques[torque]
    return [
        _FieldEffect(M_g=M_g, path=p, share=shares.get(p), tightened=ways.get(p))
        for p in dict.fromkeys((*shares, *ways))
    ]


def _table(
    effects: Sequence[_FieldEffect],
    tolerances: int,
    others: int,
) -> Table:
    """Return a table of the fields with a tolerance, the largest gain first, followed by other fields.

    effects: effects at one torque.
    tolerances: largest number of fields with a tolerance.
    others: largest number of other fields.
    """
    tight = sorted((e for e in effects if e.tightened), key=lambda e: -e.tightened.gain if e.tightened else 0.0)
    not_tightened = [e for e in effects if not e.tightened]
    shown = [*tight[:tolerances], *not_tightened[:others]]
    has_shares = any(effect.share is not None for effect in shown)
    share = "contribution to the variance of F'_ior; " if has_shares else ""
    reduction = f"reduction of the 95th percentile if the tolerance is {_STEP_WORDS}"
    title = f"at {effects[0].M_g:g} N·m: {share}{reduction}"
    table = Table.by_row(title, _EFFECT_COLUMNS, shown)
    lacks_share = any(effect.share is None for effect in shown)
    return replace(table, notes=(_NO_SHARE,) if lacks_share else ())


@dataclass(frozen=True)
class _TorqueLimit:
    """Limit of F'_ior and self error at a torque.

    M_g: torque [N*m].
    limit: limit [arcsec], None if there is none.
    self_error: self error [arcsec].
    """

    M_g: float
    limit: float | None
    self_error: float

    def as_object(self) -> Mapping[str, float | None]:
        """Return torque, limit and self error by the keys of the JSON result."""
        return {"M_g_Nm": self.M_g, "limit_arcsec": self.limit, "self_error_arcsec": self.self_error}


def _torque_limits(allocator: Allocator, self_errors: Sequence[float]) -> list[_TorqueLimit]:
    """Return the limit at each torque of a drive; self_errors: self error at each torque [arcsec]."""
    limit_at = allocator.production.law.drive.limit
    return [
        _TorqueLimit(M_g, limit_at(M_g), self_error)
        for M_g, self_error in zip(allocator.production.torques, self_errors, strict=True)
    ]


def _self_error_words(torque_limits: Sequence[_TorqueLimit]) -> str:
    """Return the self error and the limit at each torque as text."""
    parts = [f"{row.self_error:.1f} of {row.limit:g}″ at {row.M_g:g} N·m" for row in torque_limits]
    return f"{', '.join(parts)}; no tolerance reduces it"


def _assumed_costs(allocator: Allocator) -> list[str]:
    """Return a list with one note on the fields whose cost is assumed; empty if the preset states all costs."""
    assumed = [choice.path for choice in allocator.choices if choice.assumed_law]
    if not assumed:
        return []
    return [
        f"costs are assumed (1 at present, increasing as 1/tolerance): {', '.join(assumed)} (set "
        "them in the section cost of the preset)"
    ]


def _best_verdict(ways: Sequence[Allocation]) -> Verdict:
    """Return the best verdict of the ways to build a drive, because one way that passes is sufficient."""
    verdicts = {way.verdict for way in ways}
    best_first = (Verdict.PASS, Verdict.INCONCLUSIVE, Verdict.FAIL)
    return next(verdict for verdict in best_first if verdict in verdicts)


def _remaining_facts(
    verdict: Verdict,
    torque_limits: Sequence[_TorqueLimit],
    to_measure: Sequence[MeasurementGain],
    M_g: float,
) -> list[Fact]:
    """Return the facts that explain why the verdict is not PASS: the self error, and the inputs to measure.

    The list is empty if the verdict is PASS.

    to_measure: useful measurements of the design.
    M_g: torque [N*m] at which they are evaluated.
    """
    if verdict is Verdict.PASS:
        return []
    facts = [("self error", _self_error_words(torque_limits))]
    if verdict is Verdict.INCONCLUSIVE:
        facts.append(("measure", measure_words(to_measure, M_g) or _MORE_DRIVES))
    return facts


def allocate_report(
    found: Allocator,
    ways: Sequence[Allocation],
    self_errors: Sequence[float],
    to_measure: Sequence[MeasurementGain],
    M_g: float,
) -> Report:
    """Return the report of the cheapest tolerances of a drive.

    found: finished search for the tolerances.
    ways: ways to build the drive, with their tolerances.
    self_errors: self error at each torque [arcsec].
    to_measure: useful measurements of the design.
    M_g: torque [N*m] at which they are evaluated.
    """
    law = found.production.law
    drive = law.drive
    verdict = _best_verdict(ways)
    torque_limits = _torque_limits(found, self_errors)
    limits = ", ".join(f"{row.limit:g}″ at {row.M_g:g} N·m" for row in torque_limits)
    reasons = [_words(way, found) for way in ways]
    facts = [
        *_remaining_facts(verdict, torque_limits, to_measure, M_g),
        ("next", _next(found, ways, verdict, to_measure)),
    ]
    return Report(
        command="allocate",
        drive=drive,
        head=f"{drive.name}, tolerances for {100 * found.wanted:g} % of drives within {limits}",
        verdict=str(verdict),
        why=tuple(reasons),
        blocks=(_tolerances_table(found, ways), Facts.of(facts)),
        values={
            **attributes(found, "sure", seed="production.seed", yield_wanted="wanted"),
            "verdict": verdict,
            "to_measure": measure_objects(to_measure),
            "limits": [row.as_object() for row in torque_limits],
            "laws": _law_objects(found),
            "allocations": [_allocation_object(way) for way in ways],
        },
        csv=_allocations_csv(found, ways),
        line="\n".join(reasons),
        warnings=(*_law_warnings(law), *_assumed_costs(found)),
        exit_code=verdict.exit_code,
    )


def _allocations_csv(found: Allocator, ways: Sequence[Allocation]) -> tuple[list[str], list[list[Any]]]:
    """Return the tolerances for each way to build the drive as a CSV table: names of the columns, and rows."""
    name = found.production.law.drive.name
    rows = [
        [name, _column(way), way.fits, choice.path, choice.now, way.values[choice.path], way.cost]
        for way in ways
        for choice in found.choices
    ]
    return ["preset", "wheel", "fits", "field", "now", "tolerance", "cost_of_all"], rows


def _law_objects(found: Allocator) -> list[Json]:
    """Return the tolerances that the search varies, with their cost laws, as JSON."""
    return [
        {
            **attributes(choice, "now", "least", "most", field="path", assumed="assumed_law"),
            **attributes(choice.law, "share", "k"),
            "unit": field_unit(choice.path),
        }
        for choice in found.choices
    ]


def _allocation_object(way: Allocation) -> Json:
    """Return a way to build the drive, with its tolerances and its yield, as JSON."""
    return {
        **attributes(way, "turned", "fits", "cost", "probability", "verdict", tolerances="values"),
        "yield": _yield_range(way.tried),
        "drives": way.tried.drives.sum(),
    }


def _words(way: Allocation, found: Allocator) -> str:
    """Return a text on a way to build the drive: its cost, its yield, and the probability of the required yield."""
    how = "In the best holes" if way.turned else "As assembled"
    none = (
        "no tolerances achieve the required yield" if way.verdict is Verdict.FAIL else "no tolerances are recommended"
    )
    cost = f"cost {way.cost:.2f}" if way.fits else f"{none}; the best tolerances found cost {way.cost:.2f}"
    return (
        f"{how}: {cost}; {100 * way.tried.share:.1f} % of "
        f"{way.tried.drives.sum()} further random drives meet the limits. Probability of a yield of at least "
        f"{100 * found.wanted:g} %: {way.probability.text(found.sure)}"
    )


def _next(
    found: Allocator,
    ways: Sequence[Allocation],
    verdict: Verdict,
    to_measure: Sequence[MeasurementGain],
) -> str:
    """Return the next command.

    For PASS, the command applies the tolerances; for FAIL, it shows other options. If the verdict is INCONCLUSIVE, it
    repeats the search with a measured value or with more drives.
    """
    drive = found.production.drive
    if verdict is Verdict.PASS:
        cheapest = min((way for way in ways if way.fits), key=lambda way: way.cost)
        values = [f"{path}={value:.3g}" for path, value in cheapest.values.items()]
        as_built = [] if cheapest.turned else ["--as-built"]
        aim = ("--yield", f"{found.wanted:g}", "--sure", f"{found.sure:g}", *as_built)
        return again("tolerance", drive, *aim, *(word for value in values for word in ("--set", value)))
    if verdict is Verdict.FAIL:
        return again("check", drive)
    times, measured = (1, _as_measured(to_measure[0].measured)) if to_measure else (MORE_DRAWS, ())
    options = ("--yield", f"{found.wanted:g}", "--sure", f"{found.sure:g}", "-n", str(times * found.drives))
    return again("allocate", drive, *options, *measured)


def _tolerances_table(found: Allocator, ways: Sequence[Allocation]) -> Table:
    """Return the table of the present tolerances and of the tolerances for each way to build the drive, with costs."""
    rows = [
        (
            f"{choice.path}, {field_unit(choice.path)}",
            f"{choice.now:g} ({choice.law.share:.2f})",
            *(f"{way.values[choice.path]:.3g} ({choice.cost(way.values[choice.path]):.2f})" for way in ways),
        )
        for choice in found.choices
    ]
    present_cost = sum(choice.law.share for choice in found.choices)
    rows.append(("cost", f"{present_cost:.2f}", *(f"{way.cost:.2f}" for way in ways)))
    heads = ("best hole" if way.turned else _AS_ASSEMBLED for way in ways)
    return Table("tolerances (cost in brackets)", ("field", "preset", *heads), tuple(rows))


def _column(way: Allocation) -> str:
    """Return the name of a way to build the drive in CSV files."""
    return "best hole" if way.turned else "as built"
