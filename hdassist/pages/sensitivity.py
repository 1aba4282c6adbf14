"""Which tolerance to tighten first, and which fields F'_ior comes from, as a report."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from hdassist.json_parts import attributes, influence_objects, measure_objects, samples_object
from hdassist.pages.tolerance import law_warnings
from hdassist.report import Facts, Quantities, Quantity, Report, Table, csv_table
from hdassist.terminal.words import again, measure_words, named
from hdassist.tolerance.production import TIGHTER_STEP
from hdassist.tolerance.sensitivity import Sensitivities, Tightened

LISTED = (5, 3)  # on the first screen: fields with a tolerance, and others
NO_SHARE = "no variance: a share too small to be told from chance by so many drives (-n)"
STEP_WORDS = f"{100 * (1 - TIGHTER_STEP):.0f} % tighter"


@dataclass(frozen=True)
class FieldEffect:
    """A field at a torque: its share of the variance of ln F'_ior, and its tolerance's effect; None without any."""

    M_g: float
    path: str
    share: float | None
    tightened: Tightened | None


EFFECT_CSV: Quantities[FieldEffect] = (
    Quantity("M_g_Nm", "torque", "N·m", "g", "M_g"),
    Quantity("field", "field", value="path"),
    Quantity("share", "variance, %", "", lambda share: f"{100 * share:.0f}", "share"),
    Quantity("now_arcsec", "95th percentile", "", ".2f", "tightened.now"),
    Quantity("tighter_arcsec", STEP_WORDS, "", ".2f", "tightened.then"),
)
EFFECT_COLUMNS: Quantities[FieldEffect] = (
    *EFFECT_CSV[1:3],
    Quantity(
        "gain",
        "takes off, ″",
        "",
        lambda way: f"{'' if way.proven else '≤ '}{way.gain:.2f}",
        "tightened",
    ),
)


def sensitivity_report(found: Sensitivities) -> Report:
    """The sensitivities of a drive."""
    law, samples, torques = found.law, found.samples, found.samples.torques
    effects = [_effects(found, t) for t in range(len(torques))]
    verdict, reason = _answer(found)
    drawn = f"{len(samples.weights)} random drives, each of a design of its own, seed {samples.seed}"
    limited = all(law.drive.limit(M_g) is not None for M_g in torques)
    next_ = again("allocate", law.drive, *(() if limited else ("--limit", "LIMIT")))
    facts = [("measure", measure_words(found.to_measure, False)), ("next", next_)]
    return Report(
        command="sensitivity",
        drive=law.drive,
        head=f"{law.drive.name}, tighten first at {torques[found.worst]:g} N·m",
        verdict=verdict,
        why=(reason,),
        blocks=(_table(effects[found.worst], *LISTED), Facts.of(facts)),
        details=(Facts((("drawn", drawn),)), *(_table(each, len(each), len(each)) for each in effects)),
        certificate=found,
        values={
            "operating_points": [
                {
                    "M_g_Nm": M_g,
                    "F_ior_arcsec": {f"p{p}": samples.percentile(p / 100, t) for p in (5, 50, 95)},
                    "influence": influence_objects(found.influences[t]),
                    "tighter": [
                        {"field": way.path, **attributes(way, "now", "then", "low", "high", "proven")}
                        for way in found.tightened[t]
                    ],
                }
                for t, M_g in enumerate(torques)
            ],
            "tighter_factor": TIGHTER_STEP,
            "tighten_first": found.first.path if found.is_worth_tightening else None,
            "to_measure": measure_objects(found.to_measure),
            "samples": samples_object(samples),
            "drives": found.drives,
            "seed": samples.seed,
        },
        csv=csv_table(law.drive.name, EFFECT_CSV, [each for at_torque in effects for each in at_torque]),
        line=f"tighten first: {verdict}; {reason}",
        warnings=law_warnings(law),
    )


def _answer(found: Sensitivities) -> tuple[str, str]:
    """The tolerance to tighten first and the gain of a step; or why there is none, and the remedy."""
    first, largest = found.first, found.largest
    percentile = f"the 95th percentile of F'_ior, {first.now:.2f}″"
    if found.is_worth_tightening:
        gain = f"{first.gain:.2f}″ ({first.now - first.high:.2f} to {first.now - first.low:.2f})"
        return named(first.path), f"made {STEP_WORDS} it takes {gain} off {percentile}"
    reason = f"a tolerance {STEP_WORDS} takes at most {max(first.gain, 0):.2f}″ off {percentile}"
    if largest and largest.group not in {way.path for way in found.tightened[found.worst]}:
        share = f"{100 * largest.share:.0f} % of the variance of ln F'_ior"
        return f"no tolerance, measure {named(largest.group)}", f"{share}; {reason}"
    return f"no tolerance, more drives are needed (-n {4 * len(found.samples.weights)})", reason


def _effects(found: Sensitivities, torque: int) -> list[FieldEffect]:
    """All fields that do something at a torque, the greatest shares of the variance first."""
    shares = {each.group: each.share for each in found.influences[torque]}
    ways = {way.path: way for way in found.tightened[torque]}
    M_g = found.samples.torques[torque]
    return [FieldEffect(M_g, p, shares.get(p), ways.get(p)) for p in dict.fromkeys((*shares, *ways))]


def _table(effects: Sequence[FieldEffect], tolerances: int, others: int) -> Table:
    """So many fields with a tolerance, the greatest gain first, and so many others."""
    tight = sorted((e for e in effects if e.tightened), key=lambda e: -e.tightened.gain if e.tightened else 0.0)
    rest = [e for e in effects if not e.tightened]
    title = f"at {effects[0].M_g:g} N·m: share of the variance of ln F'_ior; gain of a tolerance {STEP_WORDS}"
    shown = [*tight[:tolerances], *rest[:others]]
    empty = {"share"} if all(each.share is None for each in shown) else set()
    columns = [q for q in EFFECT_COLUMNS if q.key not in empty]
    table = Table.by_row(title, columns, shown)
    return replace(table, notes=(NO_SHARE,) * any(each.share is None for each in shown))
