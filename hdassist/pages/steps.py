"""What it would take to keep a limit, or to lessen F'_ior: steps in words of the drawing and the catalogue."""

from __future__ import annotations

from collections.abc import Sequence

from hdassist.belief.steps import Outcome, Step
from hdassist.preset.fields import Drive
from hdassist.report import Fact, Table
from hdassist.terminal.words import field_unit, named

SHOWN_STEPS = 3  # on a short page
QUESTIONS = {  # to the maker, the drawing or the bench
    "cam.coupling": "how does the wave generator sit?",
    "cam.W_0": "how far does the cam deform the flexspline, on its drawing?",
    "supports.C_1": "how stiff is the rigid wheel's housing, radially?",
    "supports.C_2": "how stiff is the flexspline's output support, radially?",
    "supports.C_3": "how stiff is the wave generator on its shaft, radially?",
    "tolerances.F_i1": "how large is the composite deviation of the flexspline's teeth?",
    "tolerances.F_i2": "how large is the composite deviation of the rigid wheel's teeth?",
    "tolerances.e_hb": "how far is the wave generator's axis off that of the rigid wheel?",
    "tolerances.e_hg": "how far is the wave generator's axis off that of the flexspline?",
    "bearing.g_b": "how much radial play has the bearing on the cam?",
    "gears.j_n": "how thick are the teeth, over pins?",
    "operation.dT": "how much warmer than the rigid wheel do cam and flexspline run?",
}
COUPLING_ANSWERS = {"oldham": "Oldham coupling", "solid": "solid hub"}


def steps_table(steps: Sequence[Step], drive: Drive, M_g: float, limit_arcsec: float | None, now: str) -> Table:
    """Steps at a torque M_g [N*m] with F'_ior or the probability of keeping a limit then; now, the same before any."""
    heads = ("what would it take", "kept then" if limit_arcsec is not None else "F'_ior then")
    rows = tuple((step_words(each, drive), outcome_words(each)) for each in steps)
    return Table(f"at {M_g:g} N·m; now {now}", heads, rows, words=(0, 1))


def steps_fact(steps: Sequence[Step], drive: Drive, M_g: float, limit_arcsec: float | None, now: str) -> Fact:
    """The best steps in lines under a label, empty without any."""
    if not steps:
        return "steps", ""
    held = "F'_ior" if limit_arcsec is None else f"{limit_arcsec:g}″ kept"
    lines = [f"{step_words(each, drive).removesuffix(' (cam.coupling)')}: {outcome_words(each)}" for each in steps]
    lines = [line.replace("?:", "?") for line in lines[:SHOWN_STEPS]]
    return "steps", "\n".join([f"{held} at {M_g:g} N·m, now {now}; what it would take:", *lines])


def step_words(step: Step, drive: Drive) -> str:
    """A step in words, the field or the command behind it in brackets."""
    holes = drive.mounting.holes
    if step.kind == "question":
        return f"{QUESTIONS.get(step.of) or named(step.of).rpartition(' (')[0] + '?'} ({step.of})"
    if step.kind == "hole":
        place = f"hole {step.of}" if holes else f"{30 * int(step.of)}°"
        return f"mount in {place} (hdassist mount)"
    if step.kind == "trials":
        places = f"holes {step.of.replace(',', ', ')}" if holes else "four directions"
        return f"measure in {places}, keep the best"
    return {
        "correction": f"correct {step.of} phasors (hdassist compensate)",
        "tolerance": f"a third less of {named(step.of)}",
        "coupling": f"an Oldham coupling (cam.coupling={step.of})",
        "torque": f"load it with {step.of} N·m",
    }[step.kind]


def outcome_words(step: Step) -> str:
    """The outcome of a step, or with each answer to a question."""
    if step.kind != "question":
        return _value(step.outcomes[0])
    unit = "" if step.of == "cam.coupling" else f" {field_unit(step.of)}"
    return ", ".join(
        f"{COUPLING_ANSWERS.get(each.answer) or each.answer + unit} {_value(each)}" for each in step.outcomes
    )


def _value(found: Outcome) -> str:
    if found.probability is not None and found.p5 == found.p95:
        return f"{found.p50:.1f}″, {'kept' if found.probability else 'not kept'}"
    if found.probability is not None:
        return f"{100 * found.probability:.0f} %"
    return f"{found.p50:.1f}″" + (f" ({found.p5:.1f} to {found.p95:.1f})" if found.p5 < found.p95 else "")
