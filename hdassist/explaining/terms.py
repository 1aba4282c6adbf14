"""Words of the trade and quantities of answers: English, Russian, meaning, and other names."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Term:
    """A word: in Russian, its meaning, other names (symbols, keys of JSON), and the unit of a quantity."""

    word: str
    russian: str
    meaning: str
    others: tuple[str, ...] = ()
    unit: str = ""


PART_TERMS = (
    Term(
        "strain wave gear",
        "волновая зубчатая передача",
        "A gear whose flexible wheel is bent into two mesh zones that run round with the cam.",
        ("harmonic drive", "ВЗП"),
    ),
    Term(
        "wave generator",
        "генератор волн",
        "The cam with its flexible bearing: it bends the flexspline.",
        ("generator",),
    ),
    Term(
        "cam",
        "кулачок",
        "The rigid body of the wave generator, longer along its major axis.",
        ("plug",),
    ),
    Term(
        "flexspline",
        "гибкое колесо",
        "The flexible wheel with outer teeth; its torque is M_g.",
        ("ГК",),
    ),
    Term(
        "circular spline",
        "жёсткое колесо",
        "The rigid wheel with inner teeth, two more than the flexspline.",
        ("rigid wheel", "ЖК"),
    ),
    Term(
        "flexible bearing",
        "гибкий подшипник",
        "The bearing between cam and flexspline, bent with it.",
        ("ГП",),
    ),
    Term(
        "outer ring",
        "наружное кольцо",
        "The ring of the flexible bearing on which the flexspline sits.",
    ),
    Term(
        "seat",
        "посадочное место",
        "Where the fixed wheel is bolted; its holes say at which angles it can stand.",
    ),
    Term(
        "major axis",
        "большая ось",
        "Where the cam is longest: the two mesh zones lie there. phi_h counts to the minor axis.",
    ),
    Term(
        "mesh zone",
        "зона зацепления",
        "One of the two places, half a turn apart, where teeth carry load.",
    ),
    Term(
        "flank",
        "боковая поверхность зуба",
        "A side of a tooth; each tooth near a mesh zone may touch with both.",
    ),
)
DEVIATION_TERMS = (
    Term(
        "tangential composite deviation",
        "кинематическая погрешность колеса",
        "How far a wheel's teeth run ahead and behind over a turn, peak to peak.",
        ("F'_i", "F_i"),
        "um",
    ),
    Term(
        "cumulative pitch deviation",
        "накопленная погрешность шага",
        "Of each tooth, how far it stands from where equal pitches put it; F_p is its range.",
        ("F_p", "pitch deviation"),
        "um",
    ),
    Term(
        "run-out",
        "радиальное биение",
        "How far a tooth ring stands out and in over a turn; half of it is the shift of its centre.",
        ("runout", "radial run-out"),
        "um",
    ),
    Term(
        "ovality",
        "овальность",
        "A wheel out of round: a deviation that comes twice a turn.",
        ("second harmonic",),
        "um",
    ),
    Term(
        "cam offset",
        "эксцентриситет кулачка",
        "The shift of the cam from the axis: part of it stands still with the fixed wheel, part turns with "
        "the cam, part goes with the flexspline.",
        ("eccentricity", "эксцентриситет"),
        "um",
    ),
    Term(
        "phase",
        "фаза",
        "The direction of a deviation at phi_h = phi_g = 0, counter-clockwise seen from the cam side.",
        (),
        "deg",
    ),
    Term(
        "mark",
        "метка",
        "What the bench sees of a phase: where the run-out or the cumulative pitch deviation is greatest "
        "(mounting.mark_kind).",
    ),
    Term(
        "clearance",
        "зазор",
        "Room between parts: of flanks j_n, of the flexible bearing g_b.",
        ("backlash", "боковой зазор"),
        "um",
    ),
)
QUANTITIES = (
    Term(
        "kinematic error",
        "кинематическая погрешность",
        "How far the output stands from where the cam says: phi_h/u - (phi_g - phi_g0), up to a constant.",
        ("F_kpp", "error_arcsec", "КП", "transmission error"),
        "arcsec",
    ),
    Term(
        "F'_ior",
        "наибольшая кинематическая погрешность",
        "The greatest minus the least kinematic error over the full cycle, at constant torque, turning one way.",
        ("F_ior_arcsec", "angular transmission accuracy", "no-load accuracy", "accuracy", "range_arcsec"),
        "arcsec",
    ),
    Term(
        "F'_ior + self error",
        "",
        "F'_ior with the self error on top: what a limit is held against where all is known of the drive.",
        ("F_ior_upper_arcsec", "upper value"),
        "arcsec",
    ),
    Term(
        "F'_ior, numbers of the preset",
        "",
        "F'_ior by the preset's own numbers, with what is not known as 0: no answer where anything is open.",
        ("F_ior_nominal_arcsec",),
        "arcsec",
    ),
    Term(
        "F'_ior, self-aligning cam",
        "",
        "F'_ior where the cam aligned itself (an Oldham coupling: no support, C_3 = 0): what its support adds goes.",
        ("F_ior_floating_arcsec",),
        "arcsec",
    ),
    Term(
        "held",
        "",
        "What is held against a limit: F'_ior with the self error that 5 and 95 % of what the drive may be stay below; "
        "both the same where all is known.",
        ("held_arcsec",),
        "arcsec",
    ),
    Term(
        "loss",
        "потеря",
        "By how much F'_ior of a position lies above that of the best one, as a share of that.",
        ("expected_loss", "good"),
    ),
    Term(
        "full cycle",
        "полный цикл",
        "All states until every pair of teeth has met: 100 cam turns for 200/202 teeth.",
        ("cycle_states", "cycle_cam_revolutions", "states"),
    ),
    Term(
        "self error",
        "собственная погрешность",
        "The error of a drive without deviations, over tooth and ball phase.",
        ("self_error_arcsec",),
        "arcsec",
    ),
    Term(
        "tooth phase",
        "",
        "Where in a pitch a tooth stands to its space, 0 to 1; 0 in the states of the cycle.",
        ("tau", "tooth_phase_arcsec"),
    ),
    Term(
        "ball phase",
        "",
        "Where in a pitch the balls stand to the major axis, 0 to 1.",
        ("beta", "ball_phase_arcsec"),
    ),
    Term(
        "one-wave meshing",
        "одноволновое зацепление",
        "A state in which one of the two zones carries less than 1 % of the torque.",
        ("one-wave share", "one_wave_share"),
    ),
    Term(
        "greatest tooth force",
        "наибольшая сила на зубе",
        "The greatest force of a tooth pair in the cycle.",
        ("max_tooth_force_N",),
        "N",
    ),
    Term(
        "wind-up",
        "закрутка",
        "The mean twist of the output under the torque; the shell's tube is not in it.",
        ("wind_up_arcsec", "mean wind-up"),
        "arcsec",
    ),
    Term(
        "lost motion",
        "мёртвый ход",
        "The twist between plus and minus 4 % of the rated torque, the cam held.",
        ("lost_motion_arcsec",),
        "arcsec",
    ),
    Term(
        "play",
        "люфт",
        "What the output turns freely by, without torque.",
        ("play_arcsec",),
        "arcsec",
    ),
    Term(
        "torsional stiffness",
        "крутильная жёсткость",
        "Torque over twist of a segment: K1 from 0 to T_1, K2 to T_2, K3 beyond.",
        ("K", "stiffness", "stiffness_Nm_per_rad"),
        "N*m/rad",
    ),
    Term(
        "tangent stiffness",
        "касательная жёсткость",
        "The slope dT/dphi of the twist curve at one torque: what counts for small moves about it.",
        ("dT/dphi",),
        "N*m/rad",
    ),
    Term(
        "rated torque",
        "номинальный момент",
        "The torque that the maker allows for; operation.rated.",
        ("rated_Nm",),
        "N*m",
    ),
    Term(
        "ratio",
        "передаточное отношение",
        "Cam turns per turn of the output; negative: they turn against each other.",
        ("u", "u_hb", "передаточное число"),
    ),
    Term(
        "order",
        "порядок, гармоника",
        "A part of the error that comes so many times a turn of the cam.",
        ("per_cam_rev", "amplitude_arcsec", "phase_deg", "cause", "harmonic"),
    ),
    Term(
        "unknown",
        "неизвестно",
        "A deviation that a preset does not give: no known zero, but anything up to what its part may have.",
        ("not known", "draws"),
    ),
    Term(
        "rests on",
        "на чём держится",
        "Values that are assumed, with a plausible range, and move the answer most.",
        ("assumed_range", "assumed"),
    ),
    Term(
        "belief",
        "представление о неизвестном",
        "F'_ior over all that is not known exactly of a drive, from weighted samples: percentiles, and how probably a "
        "limit is kept.",
        ("p5_arcsec", "p50_arcsec", "p95_arcsec", "probability", "samples"),
    ),
    Term(
        "influence",
        "влияние",
        "Share of the variance of ln F'_ior that comes from a field, the largest first.",
        ("to_measure",),
    ),
    Term(
        "limit",
        "допуск",
        "What a value is held against; acceptance in the preset.",
        ("limit_arcsec",),
    ),
    Term(
        "verdict",
        "заключение",
        "PASS, FAIL, INCONCLUSIVE, or NO_LIMIT where none is set.",
        ("PASS", "FAIL", "INCONCLUSIVE", "NO_LIMIT"),
    ),
    Term(
        "positions",
        "точки измерения",
        "Evenly spaced angles of the output at which a test reads the error (12 by makers): it sees a share of F'_ior.",
        ("seen", "readings", "step_output_deg", "over_positions"),
    ),
    Term(
        "aliasing",
        "наложение частот",
        "A line that comes f times an output turn looks like f mod N at N positions of a turn; it is not seen at all "
        "where N divides f.",
        ("alias", "blind", "seen_as", "per_output_turn"),
    ),
    Term(
        "false PASS",
        "ошибочная приёмка",
        "A drive beyond its limit that passes a test; false FAIL: one within it that fails. Shares are of all that are "
        "tested.",
        ("false_pass", "false FAIL", "false_fail", "beyond_limit"),
    ),
    Term(
        "lever",
        "",
        "What changes the answer most: of a micrometre of clearance or wave, the one that moves the greatest "
        "share of F'_ior.",
        ("sensitivity", "arcsec_per_um"),
    ),
    Term(
        "certificate",
        "подтверждение решения",
        "The proof of an answer: every state's residuals of the equations, as shares of their scale, at most "
        "1e-8; some states solved again by another solver.",
        ("proof", "residual", "max_residual", "cross_check", "fallbacks"),
    ),
)
GROUPS = {"Parts": PART_TERMS, "Deviations": DEVIATION_TERMS, "Quantities": QUANTITIES}
TERMS = tuple(term for group in GROUPS.values() for term in group)
