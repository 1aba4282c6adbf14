"""Kinematic error of harmonic drives, and how to make it less: the Python interface.

The names below load their parts when first used, so that importing hdassist costs no time.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from hdassist.version import __version__

if TYPE_CHECKING:
    from hdassist.design.check import check
    from hdassist.error.cycle import KinematicError, kinematic_error
    from hdassist.error.self_error import SelfError, self_error
    from hdassist.error.stiffness import Stiffness, stiffness
    from hdassist.error.trace import Trace, trace
    from hdassist.errors import HdassistError
    from hdassist.loading.load import load_preset
    from hdassist.model.deviations import ToothDeviations
    from hdassist.model.wheels import MeasuredTeeth, MeasuredWheel, PitchFile
    from hdassist.mounting.curve import mounting_curve
    from hdassist.mounting.positions import MountingCurve
    from hdassist.preset.fields import Drive
    from hdassist.preset.library import preset_names
    from hdassist.readers.pitch import read_pitch
    from hdassist.run.run import Run

_HOMES = {
    "check": "hdassist.design.check",
    "KinematicError": "hdassist.error.cycle",
    "kinematic_error": "hdassist.error.cycle",
    "MountingCurve": "hdassist.mounting.positions",
    "mounting_curve": "hdassist.mounting.curve",
    "SelfError": "hdassist.error.self_error",
    "self_error": "hdassist.error.self_error",
    "Stiffness": "hdassist.error.stiffness",
    "stiffness": "hdassist.error.stiffness",
    "Trace": "hdassist.error.trace",
    "trace": "hdassist.error.trace",
    "HdassistError": "hdassist.errors",
    "ToothDeviations": "hdassist.model.deviations",
    "MeasuredTeeth": "hdassist.model.wheels",
    "MeasuredWheel": "hdassist.model.wheels",
    "PitchFile": "hdassist.model.wheels",
    "Drive": "hdassist.preset.fields",
    "load_preset": "hdassist.loading.load",
    "preset_names": "hdassist.preset.library",
    "read_pitch": "hdassist.readers.pitch",
    "Run": "hdassist.run.run",
}

__all__ = [
    "Drive",
    "HdassistError",
    "KinematicError",
    "MeasuredTeeth",
    "MeasuredWheel",
    "MountingCurve",
    "PitchFile",
    "Run",
    "SelfError",
    "Stiffness",
    "ToothDeviations",
    "Trace",
    "__version__",
    "check",
    "kinematic_error",
    "load_preset",
    "mounting_curve",
    "preset_names",
    "read_pitch",
    "self_error",
    "stiffness",
    "trace",
]


def __getattr__(name: str) -> Any:
    """Load a public name when it is first asked for."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)
