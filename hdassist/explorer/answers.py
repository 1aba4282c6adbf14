"""What processes tell the screen: plain numbers and words, each with how sure it is; nothing here computes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Sure(StrEnum):
    """How sure an F'_ior is: from a few states of the cycle, its extremes searched, every state solved and proven.

    FITTED: what trials make likely, with a band; it is no better or worse than the trials. AT_ZERO: searched or solved
    with 0 for deviations that are not known, so that nothing is proven of the drive.
    """

    COARSE = "COARSE"
    REFINED = "REFINED"
    AT_ZERO = "UNKNOWN AS 0"
    FITTED = "FITTED"
    PROVEN = "PROVEN"


RANK = {sure: rank for rank, sure in enumerate(Sure)}


@dataclass(frozen=True)
class Value:
    """An F'_ior [arcsec] at one torque in one position, how sure it is, and between what it lies with 90 %, if told."""

    F_ior_arcsec: float
    sure: Sure
    band: tuple[float, float] | None = None


@dataclass(frozen=True)
class Place:
    """The fixed wheel turned by rotation_deg from where it stands: its hole, and values in the order of the torques.

    hole: None where that turn is no whole number of holes; usable: whether the wheel may be mounted so.
    """

    rotation_deg: float
    hole: int | None
    values: tuple[Value, ...]
    usable: bool = True

    @property
    def sure(self) -> Sure:
        """How sure the least sure of the values is."""
        return min((value.sure for value in self.values), key=lambda sure: RANK[sure])


@dataclass(frozen=True)
class Curve:
    """F'_ior over positions of the fixed wheel by growing rotation, as far as it is known; torques [N*m]."""

    torques: tuple[float, ...]
    places: tuple[Place, ...]
    holes: int = 0

    @property
    def sure(self) -> Sure:
        """How sure the least sure of the places is."""
        return min((place.sure for place in self.places), key=lambda sure: RANK[sure], default=Sure.COARSE)

    def at(self, rotation_deg: float) -> Place | None:
        """The place at a rotation [deg]; None where nothing is known of it."""
        near = (place for place in self.places if abs((place.rotation_deg - rotation_deg + 180) % 360 - 180) < 1e-6)
        return next(near, None)

    def merit(self, place: Place) -> float:
        """Greatest over the torques of F'_ior against that of where the wheel stands."""
        now = self.places[0].values
        return max(
            here.F_ior_arcsec / max(there.F_ior_arcsec, 1e-9) for here, there in zip(place.values, now, strict=True)
        )

    @property
    def best(self) -> Place:
        """The usable place that is best for the torque served worst, as far as is known now."""
        return min(self._usable, key=self.merit)

    @property
    def worst(self) -> Place:
        """The usable place that is worst for some torque."""
        return max(self._usable, key=self.merit)

    @property
    def _usable(self) -> list[Place]:
        return [place for place in self.places if place.usable] or list(self.places)

    def with_place(self, place: Place) -> Curve:
        """The curve with a place in place of another, where it is as sure or surer."""
        places = {each.rotation_deg: each for each in self.places}
        old = places.get(place.rotation_deg)
        if old is None or RANK[place.sure] >= RANK[old.sure]:
            places[place.rotation_deg] = place
        return Curve(self.torques, tuple(sorted(places.values(), key=lambda each: each.rotation_deg)), self.holes)


@dataclass(frozen=True)
class Facts:
    """What is not known of a drive: deviations by path, how many fields have an assumed range or are open in all."""

    unknown: tuple[str, ...]
    any_hole: bool
    assumed: int = 0
    open_: int = 0


@dataclass(frozen=True)
class TorqueBelief:
    """F'_ior at a torque M_g [N*m] over all that is not known exactly, with the wheel as it stands.

    p5, p50, p95: percentiles [arcsec]; limit_arcsec, None without one; probability that F'_ior with the self error
    keeps it; verdict, by the rule of `hdassist check`.
    """

    M_g: float
    p5: float
    p50: float
    p95: float
    limit_arcsec: float | None = None
    probability: float | None = None
    verdict: str = ""


@dataclass(frozen=True)
class Believed:
    """F'_ior over all that is not known exactly, a row a torque; rows: none where all is known, or nothing is drawn.

    samples: effective ones so far; whole: whether there are as many as are needed; failed: why there are none.
    """

    rows: tuple[TorqueBelief, ...]
    samples: float = 0.0
    whole: bool = True
    failed: str = ""


@dataclass(frozen=True)
class Slopes:
    """What a step of each field does to F'_ior where the wheel is looked at, from a few states: coarse.

    rotation_deg; by path, the change [arcsec] at each torque.
    """

    rotation_deg: float
    changes: dict[str, tuple[float, ...]]


@dataclass(frozen=True)
class Advised:
    """The advice of a command in words.

    command: mount or trials, whose answer this is; words: the instruction; best_deg, where the wheel would be best;
    reasons: what it rests on, chances, proof; warnings; settled: whether there is a card; why_not: why there is none;
    next_deg: where to measure next, None without trials; sealed: the advice itself, for process that renders it.
    """

    command: str
    words: str
    best_deg: float
    reasons: tuple[str, ...]
    warnings: tuple[str, ...]
    settled: bool
    why_not: str
    next_deg: float | None
    curve: Curve
    sealed: bytes


@dataclass(frozen=True)
class Turned:
    """The error over one cam turn at one torque and one angle of the moving wheel, and the forces on the teeth there.

    phi_h_deg and error_arcsec, one each state; range_arcsec; orders as (per cam turn, amplitude arcsec, cause); zones:
    for each of the two mesh zones the angle [deg] of each flank from its middle and its side (1 or -1), and force_N by
    state and flank; shares: of the torque on each zone, by state; warnings: what was taken as 0.
    """

    M_g: float
    start_deg: float
    phi_h_deg: tuple[float, ...]
    error_arcsec: tuple[float, ...]
    range_arcsec: float
    orders: tuple[tuple[float, float, str], ...]
    theta_deg: tuple[tuple[float, ...], ...]
    force_N: tuple[tuple[tuple[float, ...], ...], ...]
    shares: tuple[tuple[float, float], ...]
    proof: str
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Compared:
    """A measured trace over the prediction: both at cam angles [turns], and the page of the comparison."""

    file: str
    turns: tuple[float, ...]
    measured_arcsec: tuple[float, ...]
    predicted_arcsec: tuple[float, ...]
    page: str


@dataclass(frozen=True)
class Rendered:
    """A text that was asked for: a card, JSON or a page."""

    text: str


@dataclass(frozen=True)
class Underway:
    """An answer is being computed: the share of its states that is solved by now, about."""

    share: float


@dataclass(frozen=True)
class Failed:
    """There is no answer: what is wrong, and what to do about it."""

    message: str
    hint: str = ""


Answer = Facts | Curve | Believed | Slopes | Advised | Turned | Compared | Rendered | Underway | Failed
