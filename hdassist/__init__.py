"""Kinematic error of harmonic drives, and how to make it less: the Python interface.

The names below load their parts when first used, so that importing hdassist costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from hdassist.version import __version__

if TYPE_CHECKING:
    from hdassist.analysis.check import check
    from hdassist.analysis.kinematic_error import KinematicError, kinematic_error
    from hdassist.analysis.mounting import MountingCurve
    from hdassist.analysis.mounting_curve import mounting_curve
    from hdassist.analysis.self_error import SelfError, self_error
    from hdassist.analysis.stiffness import Stiffness, stiffness
    from hdassist.analysis.trace import Trace, trace
    from hdassist.errors import HdassistError
    from hdassist.model.deviations import ToothDeviations
    from hdassist.model.measured import MeasuredTeeth, MeasuredWheel
    from hdassist.preset.drive import Drive
    from hdassist.preset.library import load_preset, preset_names
    from hdassist.preset.pitch import PitchFile, read_pitch

_HOMES = {
    "check": "hdassist.analysis.check",
    "KinematicError": "hdassist.analysis.kinematic_error",
    "kinematic_error": "hdassist.analysis.kinematic_error",
    "MountingCurve": "hdassist.analysis.mounting",
    "mounting_curve": "hdassist.analysis.mounting_curve",
    "SelfError": "hdassist.analysis.self_error",
    "self_error": "hdassist.analysis.self_error",
    "Stiffness": "hdassist.analysis.stiffness",
    "stiffness": "hdassist.analysis.stiffness",
    "Trace": "hdassist.analysis.trace",
    "trace": "hdassist.analysis.trace",
    "HdassistError": "hdassist.errors",
    "ToothDeviations": "hdassist.model.deviations",
    "MeasuredTeeth": "hdassist.model.measured",
    "MeasuredWheel": "hdassist.model.measured",
    "Drive": "hdassist.preset.drive",
    "load_preset": "hdassist.preset.library",
    "preset_names": "hdassist.preset.library",
    "PitchFile": "hdassist.preset.pitch",
    "read_pitch": "hdassist.preset.pitch",
}

__all__ = [
    "Drive",
    "HdassistError",
    "KinematicError",
    "MeasuredTeeth",
    "MeasuredWheel",
    "MountingCurve",
    "PitchFile",
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
