"""Edits of a preset that may reduce F'_ior, as a user would make them, with all that follows from an edited field.

A tighter wheel has a tighter pitch and smaller harmonics too, since these are bounded by its composite deviation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from hdassist.belief.prior import DrivePrior, FieldPrior, prior_of
from hdassist.preset.fields import DEVIATIONS, Drive, Source
from hdassist.preset.knowledge import ACCURACY_GRADES, SUPPORT_FIELD, with_cam_support

COUPLING = "cam.coupling"
ASKED_COUPLINGS = ("oldham", "solid")
SOURCE_REF = "option of hdassist check"
_THIRD_LESS = 2 / 3  # factor of a tolerance that is tightened by a third


@dataclass(frozen=True, eq=False)
class Edit:
    """An edit of a preset: name of the step, texts for --set, and the prior of the edited drive.

    has_own_system: whether the edited drive has another contact system, as with another coupling.
    """

    name: str
    texts: tuple[str, ...]
    prior: DrivePrior
    has_own_system: bool = False

    @property
    def kind(self) -> str:
        """Kind of the step that the edit is."""
        return self.name.partition(":")[0]

    @property
    def of(self) -> str:
        """What the edit is of: path of a tolerance, coupling, or accuracy [arcsec]."""
        return self.name.partition(":")[2]


def tightened(prior: DrivePrior) -> Iterator[Edit]:
    """Yield an edit for each tolerance that a drawing can tighten: a third less of it, and all that follows from it."""
    drive = prior.drive
    fields = {field.path: field for field in prior.fields}
    # orders of one wheel share their size, which is edited once
    for path in dict.fromkeys(deviation.size for deviation in DEVIATIONS):
        size = fields.get(path)
        largest = size.high if size else float(drive.value(path) or 0)
        # only tolerances stand on a drawing; harmonics do not
        if not path.startswith("tolerances.") or largest <= 0:
            continue
        # an exact value, or one of a fit, is simply smaller
        if size is None or size.distribution == "drawn":
            edited, texts = _smaller_value(drive, path)
        elif size.distribution == "normal":
            edited, texts = _smaller_uncertain_value(drive, path)
        else:
            edited, texts = _smaller_range(drive, size)
        # a range on the command line counts beside a value there
        edited._origin = replace(drive.origin, overrides=(*drive.origin.overrides, *texts))
        yield Edit(f"tolerance:{path}", texts, prior_of(edited))


def _smaller_value(drive: Drive, path: str) -> tuple[Drive, tuple[str, ...]]:
    """Return a copy of a drive with a third less of a tolerance that is exact, and the texts of the edit."""
    smaller = _rounded(drive.number(path))
    return drive.with_values({path: smaller}).model_copy(), (f"{path}={smaller:g}",)


def _smaller_uncertain_value(drive: Drive, path: str) -> tuple[Drive, tuple[str, ...]]:
    """Return a drive with a third less of a tolerance and of its uncertainty, and the texts of the edit."""
    smaller = _rounded(drive.number(path))
    spread = _rounded(drive.uncertainty[path])
    uncertainty = {**drive.uncertainty, path: spread}
    edited = drive.with_values({path: smaller}).model_copy(update={"uncertainty": uncertainty})
    return edited, (f"{path}={smaller:g} ± {spread:g}",)


def _smaller_range(drive: Drive, size: FieldPrior) -> tuple[Drive, tuple[str, ...]]:
    """Return a drive with a third less of the range of a tolerance, and the texts of the edit."""
    low = _rounded(size.low)
    high = _rounded(size.high)
    value = drive.value(size.path)
    # an unknown size is taken at the middle of its range
    smaller = high / 2 if value is None else _rounded(float(value))
    source = {**drive.source, size.path: Source(kind="assumed", range=(low, high), ref=SOURCE_REF)}
    edited = drive.with_values({size.path: smaller}).model_copy(update={"source": source})
    range_text = f"source.{size.path}={{kind: assumed, range: [{low:g}, {high:g}], ref: {SOURCE_REF}}}"
    return edited, (f"{size.path}={smaller:g}", range_text)


def _rounded(value: float) -> float:
    """Return a third less of a value, as a drawing states it."""
    return float(f"{_THIRD_LESS * value:.4g}")


def coupled(prior: DrivePrior) -> Iterator[Edit]:
    """Yield an edit for each coupling that the drive could have: a solid hub only where the coupling is open."""
    drive = prior.drive
    is_open = drive.cam.coupling == "unknown" and any(field.path == SUPPORT_FIELD for field in prior.fields)
    # an Oldham coupling leaves the cam free already; a floating cam has no coupling to change
    if drive.cam.coupling == "oldham" or not drive.number(SUPPORT_FIELD):
        return
    for coupling in ASKED_COUPLINGS if is_open else ASKED_COUPLINGS[:1]:
        edited = with_cam_support(drive.with_values({COUPLING: coupling}))
        texts = (f"{COUPLING}={coupling}",)
        yield Edit(f"coupling:{coupling}", texts, prior_of(edited), has_own_system=True)


def graded(prior: DrivePrior) -> Iterator[Edit]:
    """Yield the edit that buys the next better accuracy of the catalogue, if the drive is one of a catalogue."""
    drive = prior.drive
    accuracy = drive.catalogue.accuracy
    if accuracy is None and drive.catalogue.K_3 is None:
        return
    # grades fall, so the first smaller one is the next better one
    better = next((grade for grade in ACCURACY_GRADES if accuracy is None or grade < accuracy), None)
    if better is not None:
        values = drive.catalogue.model_copy(update={"accuracy": better})
        edited = drive.model_copy(update={"catalogue": values})
        yield Edit(f"accuracy:{better:g}", (f"catalogue.accuracy={better:g}",), replace(prior, drive=edited))
