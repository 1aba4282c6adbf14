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


SURE = 0.95  # probability of keeping a limit from which on a verdict is PASS; FAIL up to 1 less it


def verdict_by_probability(low: float, high: float, sure: float = SURE) -> Verdict:
    """Verdict where the probability of keeping a limit is between two bounds (its Monte Carlo interval).

    PASS where all of the interval is at least sure, FAIL where all of it is at most 1 - sure, else INCONCLUSIVE.
    """
    if low >= sure:
        return Verdict.PASS
    return Verdict.FAIL if high <= 1 - sure else Verdict.INCONCLUSIVE


def percent_text(value: float, low: float, high: float, needed: float | None = None) -> str:
    """A probability in per cent with its Monte Carlo interval, the ends rounded outwards: 89 % (81 to 94).

    So the text never shows an interval clear of a threshold (needed, named where it is given) that it reaches over.
    """
    ends = f" ({floor(round(100 * low, 6))} to {ceil(round(100 * high, 6))})" if low < high else ""
    more = "" if needed is None else f", {100 * needed:g} % needed" + " by all of it" * bool(ends)
    return f"{100 * value:.0f} %{ends}{more}"


def is_settled(low: float, high: float, sure: float = SURE) -> bool:
    """Whether no threshold of a verdict lies within the Monte Carlo interval of a probability."""
    return not any(low < threshold < high for threshold in (sure, 1 - sure))


SEVERITY = (Verdict.FAIL, Verdict.INCONCLUSIVE, Verdict.PASS, Verdict.NO_LIMIT)
EXIT_SEVERITY = (1, 5, 4, 2, 3, 6, 0)  # the worst of several drives, first


def worst(verdicts: Iterable[Verdict]) -> Verdict:
    """The most severe of some verdicts; NO_LIMIT where there is none."""
    return min(verdicts, key=SEVERITY.index, default=Verdict.NO_LIMIT)


def worst_exit_code(codes: Iterable[int]) -> int:
    """The most severe of some exit codes; 0 where there is none."""
    return min(codes, key=lambda code: EXIT_SEVERITY.index(code) if code in EXIT_SEVERITY else -1, default=0)
