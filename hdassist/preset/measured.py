"""Positions at which F'_ior was measured: holes of the seat, or turns of the fixed wheel."""

from math import nan

from hdassist.numerals import number_of

FARTHEST_TURN = 3600.0  # deg that a wheel can be meant to be turned by


def turn_of(where: str, holes: int) -> float:
    """Turn [deg] of the fixed wheel to a hole of its seat ("h4"), or by an angle ("120"); NaN for any other text."""
    number = number_of(where.removeprefix("h"))
    turn = number * 360 / holes if where.startswith("h") and holes else number
    return turn if where.startswith("h") or abs(turn) <= FARTHEST_TURN else nan


def position_fault(where: str, holes: int) -> tuple[str, str] | None:
    """Why a position ("h4", "120") is none of a seat with so many holes, 0 for a free angle, and a hint."""
    number = number_of(where.removeprefix("h"))
    if where.startswith("h"):
        if not holes:
            return "names a hole of a seat that has none", "mounting.holes says how many"
        return None if number in range(holes) else (f"the seat's holes are h0 to h{holes - 1}", "")
    turned = number * holes / 360
    if not holes or abs(turned - round(turned)) < 1e-9:
        return None
    return (
        f"{number:g} deg is no hole of the seat, whose holes are {360 / holes:g} deg apart",
        f"was hole {round(number) % holes} meant? h{round(number) % holes}",
    )
