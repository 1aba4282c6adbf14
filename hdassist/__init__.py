"""Kinematic error of harmonic drives and its reduction: the Python interface.

The modules of the names below are imported on first use, which keeps the import of hdassist fast. The types of the
names are in __init__.pyi.
"""

from importlib import import_module
from typing import Any

__version__ = "1.0.0rc1"
_HOMES = {
    "check": "design",
    "KinematicError": "error.cycle",
    "kinematic_error": "error.cycle",
    "MountingCurve": "mounting.positions",
    "mounting_curve": "mounting.positions",
    "SelfError": "error.cycle",
    "self_error": "error.cycle",
    "Stiffness": "error.stiffness",
    "stiffness": "error.stiffness",
    "Trace": "error.waves",
    "trace": "error.waves",
    "HdassistError": "errors",
    "ToothDeviations": "model.deviations",
    "MeasuredTeeth": "model.deviations",
    "MeasuredWheel": "model.deviations",
    "PitchFile": "model.deviations",
    "Drive": "preset.fields",
    "load_preset": "loading",
    "preset_names": "files",
    "read_pitch": "readers.pitch",
    "Run": "run.run",
}
__all__ = ["__version__", *_HOMES]  # noqa: PLE0604 (all of them are texts)


def __getattr__(name: str) -> Any:
    """Load a public name on first use."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"hdassist.{_HOMES[name]}"), name)
