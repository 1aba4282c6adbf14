"""What a drive's catalogue says, beside what the model says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from hdassist.error.stiffness import Segment, Stiffness, catalogue_torques
from hdassist.preset.catalogue import Catalogue
from hdassist.preset.fields import Drive

if TYPE_CHECKING:  # the page of the stiffness needs no samples
    from hdassist.design.check import OperatingPoint

Off = float | None  # per cent that the model is off a catalogue's figure; None where there is nothing to compare


def off(ours: float, theirs: float | None) -> Off:
    """How far a value is off that of a catalogue, in per cent of the catalogue's."""
    return None if theirs is None else 100 * (ours / theirs - 1)


def segments_off(catalogue: Catalogue, side: Sequence[Segment]) -> list[Off]:
    """How far K1, K2, K3 of one side are off the catalogue's; nothing of segments that end at other torques."""
    theirs = (catalogue.K_1, catalogue.K_2, catalogue.K_3)
    if _other_ends(catalogue, side):
        return [None] * len(side)
    return [off(segment.stiffness, K) for segment, K in zip(side, theirs, strict=False)]


def _other_ends(catalogue: Catalogue, side: Sequence[Segment]) -> bool:
    given = zip(side, (catalogue.T_1, catalogue.T_2), strict=False)
    return any(T is not None and abs(segment.end) != T for segment, T in given)


def ends_words(drive: Drive, result: Stiffness) -> str:
    """Where T1 and T2 of the segments come from; empty where the catalogue's figures of them are not known."""
    said = drive.catalogue
    if not any((said.K_1, said.K_2, said.K_3, said.T_1, said.T_2)):
        return ""
    ends: dict[str, list[str]] = {}
    usual = zip(("T1", "T2"), (said.T_1, said.T_2), catalogue_torques(drive), result.positive, strict=False)
    for name, given, default, segment in usual:
        by_rule = "in proportion to the other" if said.T_1 or said.T_2 else "by the size, as in catalogues"
        how = "as asked for" if segment.end != default else "by the catalogue" if given else by_rule
        ends.setdefault(how, []).append(name)
    words = ", ".join(f"{' and '.join(names)} {how}" for how, names in ends.items())
    return words + "; not the catalogue's, so K is not compared" * _other_ends(said, result.positive)


def stiffness_object(catalogue: Catalogue, result: Stiffness) -> dict[str, Any] | None:
    """What a catalogue says of the stiffness and how far the model is off, for JSON; None where it says nothing."""
    units = {"K_1": "Nm_per_rad", "K_2": "Nm_per_rad", "K_3": "Nm_per_rad", "T_1": "Nm", "T_2": "Nm"}
    said = {f"{name}_{unit}": getattr(catalogue, name) for name, unit in (units | {"lost_motion": "arcsec"}).items()}
    if not any(said.values()):
        return None
    found = dict.fromkeys(("K_1", "K_2", "K_3")) | {
        f"K_{k}": percent for k, percent in enumerate(segments_off(catalogue, result.positive), 1)
    }
    return {**said, "off_percent": {**found, "lost_motion": off(result.lost_motion_arcsec, catalogue.lost_motion)}}


def accuracy_words(accuracy: float | None, points: Sequence[OperatingPoint]) -> str:
    """How F'_ior at the least load compares with an accuracy [arcsec], measured without any; empty where none is."""
    if accuracy is None:
        return ""
    point = min(points, key=lambda each: abs(each.M_g))
    told = dict.fromkeys(f"{100 * share:.0f}" for share in _shares(accuracy, point) or ())
    compared = f"F'_ior at {point.M_g:g} N·m is {' to '.join(told)} % of it" if told else "F'_ior is not known"
    return f"accuracy {accuracy:g} arcsec (no load); {compared}"


def accuracy_object(accuracy: float | None, points: Sequence[OperatingPoint]) -> dict[str, Any] | None:
    """The accuracy of a catalogue and F'_ior of each point as shares of it, for JSON; None where there is none."""
    if accuracy is None:
        return None
    keys = ("M_g_Nm", "low", "high")
    rows = [(point.M_g, *(_shares(accuracy, point) or (None, None))) for point in points]
    return {"accuracy_arcsec": accuracy, "F_ior_share": [dict(zip(keys, row, strict=True)) for row in rows]}


def _shares(accuracy: float, point: OperatingPoint) -> tuple[float, float] | None:
    """F'_ior as shares of an accuracy [arcsec]: what 5 and 95 % of the drives that it may be stay below.

    Both the same where all is known; None where what is not known was not drawn.
    """
    if point.belief:
        return point.belief.p5 / accuracy, point.belief.p95 / accuracy
    share = point.error.F_ior_arcsec / accuracy
    return None if point.open_ else (share, share)
