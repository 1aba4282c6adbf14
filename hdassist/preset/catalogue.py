"""Figures of a drive's catalogue, which are compared with answers and are no limits."""

from __future__ import annotations

from hdassist.preset.kinds import Section, field


def of_catalogue(path: str) -> bool:
    """Whether a field, by path, is a figure of the catalogue, on which F'_ior does not depend."""
    return path.startswith("catalogue.")


class Catalogue(Section):
    """Catalogue values of the drive: shown beside the model's figures, and no limit."""

    K_1: float | None = field("torsional stiffness up to T_1", "N*m/rad", None, ge=1e-3, le=1e12)
    K_2: float | None = field("torsional stiffness from T_1 to T_2", "N*m/rad", None, ge=1e-3, le=1e12)
    K_3: float | None = field("torsional stiffness above T_2", "N*m/rad", None, ge=1e-3, le=1e12)
    T_1: float | None = field("end of the first segment", "N*m", None, gt=0, le=1e7)
    T_2: float | None = field("end of the second segment", "N*m", None, gt=0, le=1e7)
    lost_motion: float | None = field("lost motion between +-4 % of the rated torque", "arcsec", None, ge=1e-3, le=1e6)
    accuracy: float | None = field(
        "transmission accuracy: peak to peak over a turn of the output one way, without load",
        "arcsec", None, ge=1e-3, le=1e6,
    )  # fmt: skip
