"""Kinematic error of harmonic drives and its reduction: the Python interface.

The modules of the names below are imported on first use, which keeps the import of hdassist fast. The types of the
names are in __init__.pyi.
"""

from importlib import import_module
from typing import Any

__version__ = "1.0.0rc1"
_HOMES = {
    "check": "features.design",
    "KinematicError": "drive.error.cycle",
    "kinematic_error": "drive.error.cycle",
    "MountingCurve": "features.mounting.positions",
    "mounting_curve": "features.mounting.positions",
    "SelfError": "drive.error.cycle",
    "self_error": "drive.error.cycle",
    "Stiffness": "drive.error.stiffness",
    "stiffness": "drive.error.stiffness",
    "Trace": "drive.error.waves",
    "trace": "drive.error.waves",
    "HdassistError": "run.errors",
    "ToothDeviations": "drive.model.deviations",
    "MeasuredTeeth": "drive.model.deviations",
    "MeasuredWheel": "drive.model.deviations",
    "PitchFile": "drive.model.deviations",
    "Drive": "drive.preset.fields",
    "load_preset": "drive.loading",
    "preset_names": "run.files",
    "read_pitch": "readers.pitch",
    "Run": "run.run",
}
__all__ = ["__version__", *_HOMES]  # noqa: PLE0604 (all of them are texts)


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"hdassist.{_HOMES[name]}"), name)
