"""Edits of a preset that may reduce F'_ior, as a user would make them, with all that follows from an edited field.

A tighter wheel has a tighter pitch and smaller harmonics too, since these are bounded by its composite deviation.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from hdassist.belief.prior import DrivePrior, prior_of
from hdassist.preset.fields import DEVIATIONS, Source
from hdassist.preset.knowledge import ACCURACY_GRADES, SUPPORT_FIELD, with_cam_support

COUPLING = "cam.coupling"
ASKED_COUPLINGS = ("oldham", "solid")
SOURCE_REF = "option of hdassist check"
_THIRD_LESS = 2 / 3  # of a tolerance: a third less


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
    fields = {each.path: each for each in prior.fields}
    for path in dict.fromkeys(each.size for each in DEVIATIONS if each.size.startswith("tolerances.")):
        size = fields.get(path)
        value, source, uncertainty = drive.value(path), dict(drive.source), dict(drive.uncertainty)
        high = size.high if size else float(value or 0)
        if not high > 0:
            continue
        if size is None or size.distribution == "drawn":
            less = _rounded(float(value))
            texts = [f"{path}={less:g}"]
        elif size.distribution == "normal":
            less, spread = _rounded(float(value)), _rounded(uncertainty[path])
            uncertainty[path] = spread
            texts = [f"{path}={less:g} ± {spread:g}"]
        else:
            low, high = _rounded(size.low), _rounded(size.high)
            less = _rounded(float(value)) if value is not None else high / 2
            source[path] = Source(kind="assumed", range=(low, high), ref=SOURCE_REF)
            text = f"source.{path}={{kind: assumed, range: [{low:g}, {high:g}], ref: {SOURCE_REF}}}"
            texts = [f"{path}={less:g}", text]
        edited = drive.with_values({path: less}).model_copy(update={"source": source, "uncertainty": uncertainty})
        # a range on the command line counts beside a value there
        edited._origin = replace(drive.origin, overrides=(*drive.origin.overrides, *texts))
        yield Edit(f"tolerance:{path}", tuple(texts), prior_of(edited))


def _rounded(value: float) -> float:
    """Return a third less of a value, as a drawing states it."""
    return float(f"{_THIRD_LESS * value:.4g}")


def coupled(prior: DrivePrior) -> Iterator[Edit]:
    """Yield an edit for each coupling that the drive could have: a solid hub only where the coupling is open."""
    drive = prior.drive
    is_open = drive.cam.coupling == "unknown" and any(each.path == SUPPORT_FIELD for each in prior.fields)
    if drive.cam.coupling == "oldham" or not drive.number(SUPPORT_FIELD):
        return
    for coupling in ASKED_COUPLINGS if is_open else ASKED_COUPLINGS[:1]:
        edited = with_cam_support(drive.with_values({COUPLING: coupling}))
        yield Edit(f"coupling:{coupling}", (f"{COUPLING}={coupling}",), prior_of(edited), has_own_system=True)


def graded(prior: DrivePrior, drawn: bool) -> Iterator[Edit]:
    """Yield the edit that buys the next better accuracy of the catalogue, if the drive is one of a catalogue."""
    drive = prior.drive
    given = drive.catalogue.accuracy
    if not drawn or (given is None and drive.catalogue.K_3 is None):
        return
    better = next((grade for grade in ACCURACY_GRADES if given is None or grade < given), None)
    if better is not None:
        values = drive.catalogue.model_copy(update={"accuracy": better})
        edited = drive.model_copy(update={"catalogue": values})
        yield Edit(f"accuracy:{better:g}", (f"catalogue.accuracy={better:g}",), replace(prior, drive=edited))
