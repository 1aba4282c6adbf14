"""Fields of the components of a drive: sizes, material, and stiffness of supports and contacts."""

from __future__ import annotations

from typing import Literal

from hdassist.preset.kinds import Section, field


class Gears(Section):
    """Teeth of the two wheels."""

    z_g: int = field("teeth of the flexspline", ge=20, le=1000)
    z_b: int = field("teeth of the rigid wheel", ge=22, le=1002)
    m: float = field("module", "mm", ge=0.05, le=5)
    alpha: float = field("pressure angle", "deg", 20.0, ge=14, le=30)
    x_g: float = field("profile shift of the flexspline", ge=-1, le=12)
    x_b: float = field("profile shift of the rigid wheel", ge=-1, le=12)
    h_a: float = field("addendum of both wheels, in modules", default=0.6, ge=0.2, le=1.5)
    h_f: float = field("dedendum of the flexspline, in modules", default=1.35, ge=0.3, le=2)
    j_n: float = field("clearance per flank (tooth thinning)", "um", 0.0, ge=0, le=200)

    @property
    def pitch_diameter(self) -> float:
        """Pitch diameter of the flexspline [mm]."""
        return self.m * self.z_g

    @property
    def root_radius(self) -> float:
        """Radius of the root of the flexspline's teeth [mm]."""
        return self.m * (self.z_g + 2 * self.x_g - 2 * self.h_f) / 2


class Material(Section):
    """Material of the flexspline, of the cam and of its bearing."""

    E: float = field("Young's modulus", "MPa", 2.06e5, ge=1e3, le=1e6)
    nu: float = field("Poisson's ratio", default=0.3, ge=0, le=0.49)
    alpha_T: float = field("coefficient of thermal expansion", "/K", 11.5e-6, ge=0, le=1e-4)


class Flexspline(Section):
    """Rim under the teeth and the shell behind it."""

    h_1: float = field("thickness of the rim under the teeth", "mm", ge=0.05, le=20)
    h_3: float = field("thickness of the shell", "mm", ge=0.05, le=20)
    b_w: float = field("width of the tooth ring", "mm", ge=1, le=500)
    l: float = field("length of the shell with the tooth ring", "mm", ge=2, le=2000)
    k_t: float = field("stiffening of the rim by its teeth", default=1.4, ge=1, le=5)


class Bearing(Section):
    """Flexible bearing between flexspline and cam."""

    N: int = field("number of balls", ge=5, le=200)
    ring_b: float = field("width of the outer ring", "mm", ge=0.5, le=500)
    ring_h: float = field("thickness of the outer ring", "mm", ge=0.05, le=50)
    d_ball: float | None = field("ball diameter (needed for rolling balls)", "mm", None, ge=0.2, le=100)
    g_b: float = field("clearance between outer ring and balls", "um", 0.0, ge=0, le=200)
    ball_motion: Literal["locked", "rolling"] = field("balls held in the cam frame, or rolling", default="locked")
    beta: float = field("ball phase, in ball pitches from the major axis", default=0.0, ge=0, le=1)


class Cam(Section):
    """Wave generator."""

    W_0: float = field("radial deformation of the flexspline at the major axis", "mm", ge=0.01, le=10)
    coupling: Literal["solid", "oldham", "overhung", "unknown"] = field(
        "how it sits on its shaft: solid hub, Oldham coupling (aligns itself), overhung; gives C_3 if that is left out",
        default="unknown",
    )
    shaft_d: float | None = field("diameter of the shaft it is overhung on", "mm", None, ge=0.5, le=500)
    overhang: float | None = field("length of that shaft from its bearing to mid-cam", "mm", None, ge=0.5, le=2000)


class Supports(Section):
    """Radial stiffness of the supports of the bodies; 0 leaves the body free, anything else is 1 N/mm or more."""

    C_1: float = field("support of the rigid wheel, radial", "N/mm", ge=0, le=1e9)
    C_2: float = field("support of the flexspline, radial", "N/mm", ge=0, le=1e9)
    C_3: float | None = field("support of the cam, radial", "N/mm", None, ge=0, le=1e9)


class Contact(Section):
    """Local compliance of the contacts."""

    c_t: float = field(
        "compliance of a tooth pair along its normal, where flanks bear as a whole (numerics.stations: 1)",
        "mm/N", 2.0e-5, ge=1e-8, le=1e-2,
    )  # fmt: skip
    k_face: float = field(
        "stiffness of a tooth pair per width of its coned face; c_t in its place with numerics.stations: 1",
        "N/um/mm", 8.4, ge=0.01, le=1000,
    )  # fmt: skip
    c_ball: float = field("compliance of a ball between its raceways", "mm/N", 2.5e-5, ge=1e-8, le=1e-2)
    c_bore: float = field("compliance of the bore on the outer ring, per node", "mm/N", 1.0e-7, ge=1e-9, le=1e-2)
