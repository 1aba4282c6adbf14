"""The answers of a lot together: counts, and the yield with its interval."""

from __future__ import annotations

from collections.abc import Sequence

from hdassist.acceptance.answer import BROKEN_VERDICT, AcceptAnswer
from hdassist.belief.statistics import CONFIDENCE, probability_by_share
from hdassist.json_parts import Json

LOT_VERDICTS = ("PASS", "FAIL", "INCONCLUSIVE", BROKEN_VERDICT)


def lot_summary(answers: Sequence[AcceptAnswer]) -> Json:
    """Counts, and the share of PASS among drives that pass or fail with its interval, as JSON has them."""
    counts = {verdict: sum(answer.status == verdict for answer in answers) for verdict in LOT_VERDICTS}
    decided = counts["PASS"] + counts["FAIL"]
    share = probability_by_share(counts["PASS"] / decided, decided) if decided else None
    return {
        "drives": len(answers),
        "verdicts": counts,
        "yield": share and {"decided": decided, "share": share.value, "low": share.low, "high": share.high},
        "confidence": CONFIDENCE,
    }
