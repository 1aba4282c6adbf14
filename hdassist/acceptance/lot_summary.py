"""What a lot says as a whole: counts, the share that passed with its interval, and how its values spread."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

import numpy as np

from hdassist.acceptance.answer import Answer
from hdassist.acceptance.decision import Decision

Z = 1.959963984540054  # standard normal: 95 % within
VERDICTS = ("PASS", "FAIL", "INCONCLUSIVE")
QUANTILES = {"least": 0.0, "quantile_05": 0.05, "median": 0.5, "quantile_95": 0.95, "greatest": 1.0}


def summary(answers: Sequence[Answer]) -> dict[str, Any]:
    """Counts, yield and the spread of each check's values, as JSON has them."""
    counts = {verdict: sum(answer.status == verdict for answer in answers) for verdict in VERDICTS}
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
    groups: dict[tuple[Any, ...], list[Decision]] = {}
    for answer in answers:
        for check in answer.checks:
            what = (answer.preset.name, check.code, check.M_g_Nm, check.per_cam_rev, check.basis)
            groups.setdefault(what, []).append(check)
    rows = []
    for (preset, code, M_g, order, basis), checks in groups.items():
        whole = [check.value for check in checks if check.value is not None and check.extent == "whole"]
        limits = [check.limit for check in checks]
        rows.append(
            {
                "preset": preset, "code": code, "M_g_Nm": M_g, "per_cam_rev": order, "basis": basis,
                "unit": checks[0].unit, "drives": len(checks), "values": len(whole),
                "of_part_only": len(checks) - len(whole),
                **(quantiles(whole) if whole else dict.fromkeys(QUANTILES)),
                "limit_is": checks[0].limit_is, "limit_least": min(limits), "limit_greatest": max(limits),
                "passed": sum(check.verdict == "PASS" for check in checks),
            }
        )  # fmt: skip
    return rows


def wilson(passed: int, of: int) -> tuple[float, float]:
    """The 95 % interval of a share, after Wilson (1927); 0 to 1 where nothing was counted."""
    if not of:
        return 0.0, 1.0
    share, weight = passed / of, Z**2 / of
    centre = (share + weight / 2) / (1 + weight)
    half = Z / (1 + weight) * sqrt(share * (1 - share) / of + weight / (4 * of))
    return max(centre - half, 0.0), min(centre + half, 1.0)


def quantiles(values: Sequence[float]) -> dict[str, float]:
    """Least, 5 %, 50 %, 95 % and greatest of some values, straight between neighbours."""
    found = np.quantile(np.asarray(values, dtype=float), list(QUANTILES.values()))
    return dict(zip(QUANTILES, map(float, found), strict=True))
