"""Edits of a preset that may reduce F'_ior, as a user would make them, with all dependent changes.

A wheel with a tighter tolerance also has smaller pitch deviations and harmonics, because its composite deviation bounds
them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from hdassist.belief.prior import DrivePrior, FieldPrior, prior_of
from hdassist.drive.preset.fields import DEVIATIONS, Drive, Source
from hdassist.drive.preset.knowledge import ACCURACY_GRADES, SUPPORT_FIELD, with_cam_support

COUPLING = "cam.coupling"
ASKED_COUPLINGS = ("oldham", "solid")
SOURCE_REF = "option of hdassist check"
_THIRD_LESS = 2 / 3  # factor of a tolerance that is tightened by a third


@dataclass(frozen=True, eq=False)
class Edit:
    """An edit of a preset: name of the step, texts for --set, and the prior of the edited drive.

    has_own_system: whether the edited drive has a different contact system, for example with another coupling.
    """

    name: str
    texts: tuple[str, ...]
    prior: DrivePrior
    has_own_system: bool = False

    @property
    def kind(self) -> str:
        """Kind of the step for the edit."""
        return self.name.partition(":")[0]

    @property
    def of(self) -> str:
        """Subject of the edit: path of a tolerance, coupling, or accuracy [arcsec]."""
        return self.name.partition(":")[2]


def tightened(prior: DrivePrior) -> Iterator[Edit]:
    """Yield an edit for each tolerance on a drawing, reduced by a third, with all dependent changes."""
    drive = prior.drive
    fields = {field.path: field for field in prior.fields}
    # orders of one wheel share their size, so it is edited only once
    for path in dict.fromkeys(deviation.size for deviation in DEVIATIONS):
        size = fields.get(path)
        largest = size.high if size else float(drive.value(path) or 0)
        # drawings contain tolerances, but not harmonics
        if not path.startswith("tolerances.") or largest <= 0:
            continue
        # an exact value, or one of a fit, is simply reduced
        if size is None or size.distribution == "drawn":
            edited, texts = _smaller_value(drive, path)
        elif size.distribution == "normal":
            edited, texts = _smaller_uncertain_value(drive, path)
        else:
            edited, texts = _smaller_range(drive, size)
        # a range on the command line takes precedence in the same way as a value
        edited._origin = replace(drive.origin, overrides=(*drive.origin.overrides, *texts))
        yield Edit(f"tolerance:{path}", texts, prior_of(edited))


def _smaller_value(drive: Drive, path: str) -> tuple[Drive, tuple[str, ...]]:
    """Return a copy of a drive with an exact tolerance reduced by a third, and the texts of the edit."""
    smaller = _rounded(drive.number(path))
    return drive.with_values({path: smaller}).model_copy(), (f"{path}={smaller:g}",)


def _smaller_uncertain_value(drive: Drive, path: str) -> tuple[Drive, tuple[str, ...]]:
    """Return a drive with a tolerance and its uncertainty reduced by a third, and the texts of the edit."""
    smaller = _rounded(drive.number(path))
    spread = _rounded(drive.uncertainty[path])
    uncertainty = {**drive.uncertainty, path: spread}
    edited = drive.with_values({path: smaller}).model_copy(update={"uncertainty": uncertainty})
    return edited, (f"{path}={smaller:g} ± {spread:g}",)


def _smaller_range(drive: Drive, size: FieldPrior) -> tuple[Drive, tuple[str, ...]]:
    """Return a drive with the range of a tolerance reduced by a third, and the texts of the edit."""
    low = _rounded(size.low)
    high = _rounded(size.high)
    value = drive.value(size.path)
    # an unknown size is set to the middle of its range
    smaller = high / 2 if value is None else _rounded(float(value))
    source = {**drive.source, size.path: Source(kind="assumed", range=(low, high), ref=SOURCE_REF)}
    edited = drive.with_values({size.path: smaller}).model_copy(update={"source": source})
    range_text = f"source.{size.path}={{kind: assumed, range: [{low:g}, {high:g}], ref: {SOURCE_REF}}}"
    return edited, (f"{size.path}={smaller:g}", range_text)


def _rounded(value: float) -> float:
    """Return a value reduced by a third, rounded as on a drawing."""
    return float(f"{_THIRD_LESS * value:.4g}")


def coupled(prior: DrivePrior) -> Iterator[Edit]:
    """Yield an edit for each coupling that the drive could have; a solid hub only if the coupling is unknown."""
    drive = prior.drive
    is_open = drive.cam.coupling == "unknown" and any(field.path == SUPPORT_FIELD for field in prior.fields)
    # an Oldham coupling already leaves the cam free, and a floating cam has no coupling to change
    if drive.cam.coupling == "oldham" or not drive.number(SUPPORT_FIELD):
        return
    for coupling in ASKED_COUPLINGS if is_open else ASKED_COUPLINGS[:1]:
        edited = with_cam_support(drive.with_values({COUPLING: coupling}))
        texts = (f"{COUPLING}={coupling}",)
        yield Edit(f"coupling:{coupling}", texts, prior_of(edited), has_own_system=True)


def graded(prior: DrivePrior) -> Iterator[Edit]:
    """Yield the edit to the next better accuracy grade, if the drive has catalogue values."""
    drive = prior.drive
    accuracy = drive.catalogue.accuracy
    if accuracy is None and drive.catalogue.K_3 is None:
        return
    # grades decrease, so the first smaller one is the next better one
    better = next((grade for grade in ACCURACY_GRADES if accuracy is None or grade < accuracy), None)
    if better is not None:
        values = drive.catalogue.model_copy(update={"accuracy": better})
        edited = drive.model_copy(update={"catalogue": values})
        yield Edit(f"accuracy:{better:g}", (f"catalogue.accuracy={better:g}",), replace(prior, drive=edited))
