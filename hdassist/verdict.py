"""Verdicts and the exit codes that they end a command with."""

from collections.abc import Iterable
from enum import StrEnum
from math import ceil, floor


class Verdict(StrEnum):
    """Decision of a check, as in JSON."""

    PASS = "PASS"
    FAIL = "FAIL"
    INCONCLUSIVE = "INCONCLUSIVE"
    NO_LIMIT = "NO_LIMIT"

    @property
    def exit_code(self) -> int:
        """Exit code of a command that ends with this verdict."""
        return {Verdict.FAIL: 3, Verdict.INCONCLUSIVE: 6}.get(self, 0)


GUARD = 1.65  # standard uncertainties of a measured value to its limit: one-sided 95 %
SURE = 0.95  # probability of keeping a limit from which on a verdict is PASS; FAIL up to 1 less it


def verdict_by_probability(kept: float, sure: float = SURE) -> Verdict:
    """Verdict on the probability of keeping a limit: PASS from sure on, FAIL up to 1 - sure, else INCONCLUSIVE."""
    if kept >= sure:
        return Verdict.PASS
    return Verdict.FAIL if kept <= 1 - sure else Verdict.INCONCLUSIVE


def percent_text(value: float, low: float, high: float, needed: float | None = None) -> str:
    """A probability in per cent with its Monte Carlo interval, the ends rounded outwards: 89 % (81 to 94).

    needed: probability that a verdict needs, named where it is given; one that misses it is not rounded up to it, nor
    is one above 1 - needed rounded down to that.
    """
    percent = f"{100 * value:.0f}"
    if needed and verdict_by_probability(value, needed) is not verdict_by_probability(round(value, 2), needed):
        percent = f"{(floor if value > 0.5 else ceil)(1000 * value) / 10:.1f}"
    ends = f" ({floor(round(100 * low, 6))} to {ceil(round(100 * high, 6))})" if low < high else ""
    return f"{percent} %{ends}" + ("" if needed is None else f", {100 * needed:g} % needed")


def is_settled(low: float, high: float, sure: float = SURE) -> bool:
    """Whether no threshold of a verdict lies within the Monte Carlo interval of a probability: else more are drawn."""
    return not any(low < threshold < high for threshold in (sure, 1 - sure))


SEVERITY = (Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.PASS, Verdict.NO_LIMIT)
_EXIT_SEVERITY = (1, 5, 4, 2, 3, 6, 0)  # the worst of several drives, first


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """The most severe of some verdicts; NO_LIMIT where there is none."""
    return min(verdicts, key=SEVERITY.index, default=Verdict.NO_LIMIT)


def worst_exit_code(codes: Iterable[int]) -> int:
    """The most severe of some exit codes; 0 where there is none."""
    return min(codes, key=lambda code: _EXIT_SEVERITY.index(code) if code in _EXIT_SEVERITY else -1, default=0)
