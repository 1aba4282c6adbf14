"""What the answers of a lot say together: counts, and the yield with its interval."""

from __future__ import annotations

from collections.abc import Sequence

from hdassist.acceptance.answer import BROKEN_VERDICT, AcceptAnswer
from hdassist.belief.statistics import CONFIDENCE, Probability, probability_by_share
from hdassist.json_parts import Json

LOT_VERDICTS = ("PASS", "FAIL", "INCONCLUSIVE", BROKEN_VERDICT)


def yield_of_lot(answers: Sequence[AcceptAnswer]) -> tuple[int, Probability | None]:
    """Drives that pass or fail, and the share of them that passes with its interval; None where none is decided."""
    passed, failed = (sum(answer.status == verdict for answer in answers) for verdict in ("PASS", "FAIL"))
    decided = passed + failed
    return decided, probability_by_share(passed / decided, decided) if decided else None


def lot_summary(answers: Sequence[AcceptAnswer]) -> Json:
    """Counts, and yield with its interval, as JSON has them."""
    decided, share = yield_of_lot(answers)
    return {
        "drives": len(answers),
        "verdicts": {verdict: sum(answer.status == verdict for answer in answers) for verdict in LOT_VERDICTS},
        "yield": share and {"decided": decided, "share": share.value, "low": share.low, "high": share.high},
        "confidence": CONFIDENCE,
    }
