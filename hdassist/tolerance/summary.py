"""What random drives come to: F'_ior as built and in the best position of the wheel, yields, what turning brings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from hdassist.tolerance.production import RandomDrive
from hdassist.tolerance.tally import Share, Tally
from hdassist.verdict import Verdict


@dataclass
class AtTorque:
    """Random drives at a torque M_g [N*m]: F'_ior [arcsec] as built and in the best position, and how many pass.

    limit [arcsec] of F'_ior with the self error, if any; self_error [arcsec] of the drive without deviations; ratio, of
    F'_ior in the best position to that as built.
    """

    M_g: float
    limit: float | None
    self_error: float
    as_built: Tally = field(default_factory=Tally)
    best: Tally = field(default_factory=Tally)
    ratio: Tally = field(default_factory=Tally)
    passed_as_built: int = 0
    passed_best: int = 0

    def gain(self, share: float) -> float:
        """How much less F'_ior is in the best position, as a share of it, that a share of the drives stays below."""
        return 1 - self.ratio.quantile(1 - share)

    def passes(self, F_ior: float) -> bool:
        """Whether F'_ior [arcsec] with the self error is within the limit; so it is without one."""
        return self.limit is None or F_ior + self.self_error <= self.limit


@dataclass
class Summary:
    """What random drives come to, added one by one.

    positions: how many the wheel was tried in, 1 where it is not turned; wanted: the yield that is asked for, as a
    share; refused: drives without an answer; reason, of the first of them.
    """

    points: tuple[AtTorque, ...]
    positions: int
    wanted: float | None = None
    count: int = 0
    passed_as_built: int = 0
    passed_best: int = 0
    refused: int = 0
    reason: str = ""
    states: int = 0
    max_residual: float = 0.0

    @classmethod
    def of(
        cls,
        torques: Sequence[float],
        limits: Sequence[float | None],
        self_errors: Sequence[float],
        *,
        positions: int,
        wanted: float | None = None,
    ) -> Summary:
        """Nothing yet, at torques [N*m] with limits and self errors [arcsec]."""
        return cls(tuple(map(AtTorque, torques, limits, self_errors)), positions, wanted)

    def add(self, records: Iterable[RandomDrive]) -> None:
        """Count drives."""
        for record in records:
            if record.refused is not None:
                self.refused += 1
                self.reason = self.reason or record.refused
                continue
            self.count += 1
            self.states += record.states
            self.max_residual = max(self.max_residual, record.max_residual)
            both = record.F_ior_arcsec, record.best_F_ior_arcsec
            passed = [True, True]
            for point, now, best in zip(self.points, *both, strict=True):
                point.as_built.add(now)
                point.best.add(best)
                point.ratio.add(best / now if now else 1.0)  # without any error nothing is gained
                ok = point.passes(now), point.passes(best)
                point.passed_as_built += ok[0]
                point.passed_best += ok[1]
                passed = [passed[0] and ok[0], passed[1] and ok[1]]
            self.passed_as_built += passed[0]
            self.passed_best += passed[1]

    @property
    def has_limit(self) -> bool:
        """Whether there is a limit at any torque."""
        return any(point.limit is not None for point in self.points)

    @property
    def yield_as_built(self) -> Share:
        """Drives that pass at every torque as they were put together."""
        return Share(self.passed_as_built, self.count, self.refused)

    @property
    def yield_best(self) -> Share:
        """Drives that pass at every torque in their best position."""
        return Share(self.passed_best, self.count, self.refused)

    @property
    def verdict(self) -> Verdict:
        """Whether the yield that is asked for is reached: certainly, certainly not, or not to be told.

        It is that of the best position where the wheel is turned, else that as built.
        """
        if self.wanted is None or not self.has_limit:
            return Verdict.NO_LIMIT
        low, high = self.yield_best.bounds
        if low >= self.wanted:
            return Verdict.PASS
        return Verdict.FAIL if high < self.wanted else Verdict.INCONCLUSIVE


def rooms(limits: Sequence[float | None], self_errors: Sequence[float]) -> list[float] | None:
    """What limits [arcsec] leave for F'_ior at each torque; None where one is missing, or leaves nothing."""
    left = [limit - own for limit, own in zip(limits, self_errors, strict=True) if limit is not None]
    return left if len(left) == len(limits) and min(left) > 0 else None
