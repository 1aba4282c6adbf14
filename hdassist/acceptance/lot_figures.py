"""A lot as data: what its answers say together, as JSON and as CSV. Answers are those of `accept_figures`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from hdassist.acceptance.checks import CODES, Check
from hdassist.acceptance.decision import Asked
from hdassist.acceptance.figures import CHECK
from hdassist.acceptance.lot import Lot
from hdassist.acceptance.shares import quantiles, wilson
from hdassist.terminal.answers import csv_text, together

Answer = Mapping[str, Any]

VERDICTS = ("PASS", "FAIL", "INCONCLUSIVE")
BROKEN = "BROKEN"  # stands where a verdict would
QUANTILE_KEYS = ("least", "quantile_05", "median", "quantile_95", "greatest")
PROVENANCE = ("version", "preset_sha256", "measured_sha256", "seed", "solver", "max_residual", "time")


def status(answer: Answer) -> str:
    """The verdict of an answer, or that it is broken."""
    return BROKEN if "error" in answer else str(answer["verdict"])


def asked(check: Answer) -> Asked:
    """What a check of an answer was asked for."""
    code = CODES[check["code"]]
    assert isinstance(code, Check)
    return Asked(code, check["limit"], check["M_g_Nm"], check["per_cam_rev"])


def provenance(answer: Answer) -> dict[str, Any]:
    """What an answer rests on, flat: the keys of PROVENANCE."""
    certificate = answer.get("certificate")
    values = (
        answer["version"],
        answer["preset"]["sha256"],
        " ".join(entry["sha256"] for entry in answer.get("measured", ())) or None,
        answer.get("seed"),
        answer.get("solver"),
        certificate["max_residual"] if certificate else None,
        answer.get("time"),
    )
    return dict(zip(PROVENANCE, values, strict=True))


def csv(answers: Iterable[Answer]) -> str:
    """One row per drive and check; a drive without an answer has a row with its error."""
    keys = [quantity.key for quantity in CHECK]
    rows = []
    for answer in answers:
        start, end = [answer.get("serial", ""), answer["preset"]["name"]], list(provenance(answer).values())
        error = answer["error"]["message"] if "error" in answer else None
        found = answer.get("checks") or [dict.fromkeys(keys)]
        rows += [[*start, *(check[key] for key in keys), answer["exit_code"], error, *end] for check in found]
    return csv_text(["serial", "preset", *keys, "exit_code", "error", *PROVENANCE], rows)


def summary(answers: Sequence[Answer]) -> dict[str, Any]:
    """Counts, yield and the spread of each check's values."""
    counts = {verdict: sum(status(answer) == verdict for answer in answers) for verdict in VERDICTS}
    decided = sum(counts.values())
    low, high = wilson(counts["PASS"], decided)
    return {
        "drives": len(answers),
        "verdicts": counts,
        "broken": len(answers) - decided,
        "broken_share": (len(answers) - decided) / len(answers) if answers else None,
        "yield": {
            "passed": counts["PASS"],
            "with_verdict": decided,
            "share": counts["PASS"] / decided if decided else None,
            "interval_95": [low, high],
            "interval": "Wilson",
        },
        "checks": _spread(answers),
    }


def _spread(answers: Sequence[Answer]) -> list[dict[str, Any]]:
    """Values by preset, check and how they are known, in the order in which they come first."""
    groups: dict[tuple[Any, ...], list[Answer]] = {}
    for answer in answers:
        for check in answer.get("checks", ()):
            what = (check[key] for key in ("code", "M_g_Nm", "per_cam_rev", "basis"))
            groups.setdefault((answer["preset"]["name"], *what), []).append(check)
    rows = []
    for (preset, code, M_g, order, basis), checks in groups.items():
        whole = [check["value"] for check in checks if check["value"] is not None and check["extent"] == "whole"]
        limits = [check["limit"] for check in checks]
        spread = quantiles(whole) if whole else [None] * len(QUANTILE_KEYS)
        rows.append(
            {
                "preset": preset, "code": code, "M_g_Nm": M_g, "per_cam_rev": order, "basis": basis,
                "unit": checks[0]["unit"], "drives": len(checks), "values": len(whole),
                "of_part_only": len(checks) - len(whole),
                **dict(zip(QUANTILE_KEYS, spread, strict=True)),
                "limit_is": checks[0]["limit_is"], "limit_least": min(limits), "limit_greatest": max(limits),
                "passed": sum(check["verdict"] == "PASS" for check in checks),
            }
        )  # fmt: skip
    return rows


def combined(lot: Lot, answers: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The lot as one JSON object: every answer, and what they say together."""
    return {
        **together("accept", answers),
        "lot": {"name": lot.file, "sha256": lot.sha256, "rows": len(lot.rows), "notes": list(lot.notes)},
        "summary": summary(answers),
    }
