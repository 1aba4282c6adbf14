"""Meanings of the kinds of errors, and remedies."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.errors import Fault


@dataclass(frozen=True)
class FaultWords:
    """Meaning of a kind of error, and its remedy."""

    meaning: str
    change: str


FAULTS: dict[Fault, FaultWords] = {
    Fault.USAGE: FaultWords(
        "Invalid arguments. Exit code 2.",
        "The message names the argument; hdassist COMMAND -h begins with examples.",
    ),
    Fault.FILE_EXISTS: FaultWords(
        "A file to write is there already; nothing is ever written over it unasked. Exit code 2.",
        "Another name, or --force.",
    ),
    Fault.DATA: FaultWords(
        "A file or a preset has invalid contents. Exit code 4.",
        "The message names it; hdassist presets validate lists every fault of a preset.",
    ),
    Fault.FILE_UNREADABLE: FaultWords(
        "A file is not there, is a folder, or may not be read. Exit code 4.",
        "Check the name and the rights; - is standard input.",
    ),
    Fault.FILE_UNWRITABLE: FaultWords(
        "A file cannot be written: no rights, no folder, no room. Exit code 4; nothing half written is left.",
        "Another place for it; df shows the room.",
    ),
    Fault.FILE_INVALID: FaultWords(
        "A preset or a table has faults; each stands with its file, line and column. Exit code 4.",
        "Mend the lines; hdassist presets validate looks at a preset again, hdassist explain gears.z_g at a field.",
    ),
    Fault.SYSTEM_LIMITS: FaultWords(
        "The system gives this process too little: memory, files or processes. Exit code 4.",
        "ulimit -a shows the limits.",
    ),
    Fault.UNTRUSTED: FaultWords(
        "There is an answer, but not one to be trusted, so it is not given. Exit code 5.",
        "The message gives the reason, its hint a remedy.",
    ),
    Fault.UNTRUSTED_STATE: FaultWords(
        "No solver has a solution of a state whose residuals prove it. Exit code 5.",
        "A torque and stiffnesses nearer to a real drive; --solver clarabel.",
    ),
    Fault.SOLVERS_DISAGREE: FaultWords(
        "A second solver found another rotation of the same state, more than 0.01 arcsec away. Exit code 5.",
        "--cross-check osqp; stiffnesses and compliances that are not a million times apart.",
    ),
    Fault.BEYOND_MODEL: FaultWords(
        "The wind-up is above a quarter of a tooth pitch: the linear model ends there. Exit code 5.",
        "Less torque, or a stiffer drive.",
    ),
    Fault.EDGE_OF_WINDOW: FaultWords(
        "The outermost tooth that the model looks at carries load, in the widest window there is. Exit code 5.",
        "Less torque, less wave cam.W_0; numerics.window is widened by itself before.",
    ),
    Fault.NO_MESH: FaultWords(
        "No tooth of the flexspline reaches the rigid wheel. Exit code 5.",
        "More wave (cam.W_0), higher teeth (gears.h_a), or other profile shifts.",
    ),
    Fault.ORDERS_UNTOLD: FaultWords(
        "A record does not resolve the declared orders, or its range is not clear of its noise. Exit code 5.",
        "A longer or quieter record with smaller steps, fewer --orders, --drift linear where it drifts.",
    ),
    Fault.FIT_UNSETTLED: FaultWords(
        "An identification found no set of values that it can stand for. Exit code 5.",
        "More --evaluations with the same --state, or narrower bounds.",
    ),
    Fault.WORKERS_LOST: FaultWords(
        "Processes that shared the work were ended from outside; usually out of memory. Exit code 5.",
        "Fewer --jobs.",
    ),
    Fault.MEMORY_SHORT: FaultWords("There is not memory enough for an answer. Exit code 5.", "Fewer --jobs."),
    Fault.BUG: FaultWords(
        "An error that hdassist did not foresee. Exit code 1.",
        "--debug shows where; please report it with the command and the preset.",
    ),
}
