"""What the answers of a lot say together: counts, yield with its interval, and the spread of each value."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import Any

import numpy as np

from hdassist.acceptance.answer import AcceptAnswer
from hdassist.acceptance.decision import Decision
from hdassist.json_parts import Json

Z = 1.959963984540054  # standard normal: 95 % within
LOT_VERDICTS = ("PASS", "FAIL", "INCONCLUSIVE")
QUANTILES = {"least": 0.0, "quantile_05": 0.05, "median": 0.5, "quantile_95": 0.95, "greatest": 1.0}


def lot_summary(answers: Sequence[AcceptAnswer]) -> Json:
    """Counts, yield with its interval, and how the values of each check spread, as JSON has them."""
    counts = {verdict: sum(answer.status == verdict for answer in answers) for verdict in LOT_VERDICTS}
    decided = sum(counts.values())
    groups: dict[tuple[Any, ...], list[Decision]] = {}
    for answer in answers:
        for check in answer.checks:
            same = (answer.preset.name, check.code, check.M_g_Nm, check.per_cam_rev, check.basis)
            groups.setdefault(same, []).append(check)
    return {
        "drives": len(answers),
        "verdicts": counts,
        "broken": len(answers) - decided,
        "broken_share": (len(answers) - decided) / len(answers) if answers else None,
        "yield": {
            "passed": counts["PASS"],
            "with_verdict": decided,
            "share": counts["PASS"] / decided if decided else None,
            "interval_95": list(wilson(counts["PASS"], decided)),
            "interval": "Wilson",
        },
        "checks": [{"preset": preset, **_spread(checks)} for (preset, *_), checks in groups.items()],
    }


def _spread(checks: Sequence[Decision]) -> Json:
    """How the values of one check spread that are known in one way."""
    first, whole = checks[0], [each.value for each in checks if each.value is not None and each.extent == "whole"]
    limits = [each.limit for each in checks]
    return {
        **{key: getattr(first, key) for key in ("code", "M_g_Nm", "per_cam_rev", "basis", "unit")},
        "drives": len(checks),
        "values": len(whole),
        "of_part_only": len(checks) - len(whole),
        **(quantiles(whole) if whole else dict.fromkeys(QUANTILES)),
        "limit_is": first.limit_is,
        "limit_least": min(limits),
        "limit_greatest": max(limits),
        "passed": sum(each.verdict == "PASS" for each in checks),
    }


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
