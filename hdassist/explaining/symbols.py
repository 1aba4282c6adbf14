"""Symbols of the paper and of the docs, declared once: docs/theory.md and `hdassist explain` read them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Symbols:
    """Symbols with one meaning: as the paper writes them, where the code has them (Markdown), in words, with unit."""

    paper: tuple[str, ...]
    code: str
    words: str
    unit: str = ""


SYMBOLS = (
    Symbols(("z_g", "z_b"), "`gears.z_g`, `gears.z_b`", "teeth of the flexspline (g) and of the rigid wheel (b)"),
    Symbols(("m", "x_g", "x_b"), "`gears.m`, ...", "module, profile shifts", "mm, modules"),
    Symbols(("h_1", "h_3", "b_w", "l"), "`flexspline.*`", "rim and shell thickness, tooth width, length", "mm"),
    Symbols(("N",), "`bearing.N`", "balls of the flexible bearing"),
    Symbols(("W_0",), "`cam.W_0`", "radial deformation at the major axis", "mm"),
    Symbols(
        ("dT", "alpha_T"), "`operation.dT`, `material.alpha_T`",
        "flexspline and cam warmer than the rigid wheel; thermal expansion", "K, /K",
    ),
    Symbols(
        ("k'",), "`contact.k_face`", "stiffness of a tooth pair per width, of coned flanks", "N/(µm·mm)"
    ),
    Symbols(
        ("F'_i1", "F'_i2"), "`tolerances.F_i1`, `F_i2`",
        "tangential composite deviations of the wheels, peak to peak", "µm",
    ),
    Symbols(
        ("e_h^b", "e_h^h", "e_h^g"), "`e_hb`, `e_hh`, `e_hg`",
        "cam offset: fixed, turning with the cam, going with the flexspline", "µm",
    ),
    Symbols(("xi^g", "xi^b"), "`phases.xi_g`, `xi_b`", "phases of the tooth deviations", "deg"),
    Symbols(("phi_h", "phi_g"), "`States.phi_h`, `phi_g`", "angles of cam and flexspline", "rad"),
    Symbols(("M_g",), "`operation.M_g`",
            "torque on the flexspline, counter-clockwise positive, in either mounting", "N·m"),
    Symbols(("u_hg",), "`Kinematics.u`", "cam turns per turn of the output"),
    Symbols(("F_kpp",), "`KinematicError.error_arcsec`", "kinematic error", "arcsec"),
    Symbols(("F'_ior",), "`KinematicError.F_ior_arcsec`", "its range over the full cycle", "arcsec"),
    Symbols(
        ("D", "G", "C", "delta_p"), "`ContactSystem.D`, ...", "compliance, motion, supports, gaps without force",
        "mm/N, -, N/mm, mm",
    ),
    Symbols(("F", "delta", "a"), "forces, gaps, displacements", "the unknowns of (1)", "N, mm, mm and rad"),
)  # fmt: skip
