"""Limits and stated values as the command line writes them: F_ior@80=30, order_2=5, K_1=1e5, F_ior@80=28.1±1.2."""

from __future__ import annotations

from collections.abc import Sequence

from hdassist.acceptance.accept import Stated
from hdassist.acceptance.checks import CHECKS, ORDER, PER_TORQUE
from hdassist.acceptance.decision import Asked
from hdassist.acceptance.limits import limits_of
from hdassist.errors import UsageError
from hdassist.measuring.uncertainty import COVERAGE_FACTOR
from hdassist.preset.fields import Drive
from hdassist.preset.units import UnitError, is_spread, read_spread

ORDER_PREFIX = "order_"
NAMES = [check.field for check in CHECKS if check != ORDER]
HINT = f"NAME[@TORQUE]=VALUE, NAME one of {', '.join(NAMES)}, or order_2 and so on"


def limit_overrides(texts: Sequence[str]) -> list[str]:
    """Limits of the command line as overrides of the preset: the same checks, the same errors.

    Raises UsageError: a text that is no limit.
    """
    overrides = []
    for text in texts:
        name, order, torque, value = _parts(text, "--limit")
        path = f"acceptance.order_amplitude.{order}" if order else f"acceptance.{name}"
        overrides.append(f"{path}.{torque}={value}" if torque else f"{path}={value}")
    return overrides


def is_named(text: str, option: str) -> bool:
    """Whether a text such as F_ior@80 names a limit, as --limit or --value would have it before the equals sign.

    Raises UsageError: it names one, with a torque or order that cannot be.
    """
    name, _, torque = text.strip().partition("@")
    if name not in NAMES and not name.startswith(ORDER_PREFIX):
        return False
    _parts(f"{text}=1", option)
    if torque:
        _number(torque, text)
    return True


def stated_values(texts: Sequence[str], drive: Drive) -> dict[Asked, Stated]:
    """Values of the command line, by the limit of the drive that they are for.

    What stands after ± is the expanded uncertainty, k = 2. Raises UsageError: a text that is no value, one without
    its uncertainty, or one that no limit of the drive is for.
    """
    found: dict[Asked, Stated] = {}
    for text in texts:
        name, order, torque, value = _parts(text, "--value")
        fitting = [
            asked
            for asked in limits_of(drive)
            if asked.check.field == name
            and (not order or asked.order == float(order))
            and (not torque or asked.M_g == _number(torque, text))
        ]
        if not fitting:
            raise UsageError(f"--value {text}: the drive has no such limit", f"--limit {text.partition('=')[0]}=...")
        if len(fitting) > 1:
            torques = ", ".join(f"@{asked.M_g:g}" for asked in fitting)
            raise UsageError(f"--value {text}: at which torque?", f"one of {torques}")
        if fitting[0] in found:
            raise UsageError(f"--value {text}: given twice")
        found[fitting[0]] = _stated(value, fitting[0], text)
    return found


def _parts(text: str, option: str) -> tuple[str, str, str, str]:
    """Field, order, torque and value of a text; order and torque may be empty."""
    where, equals, value = text.partition("=")
    name, at, torque = where.strip().partition("@")
    order = name.removeprefix(ORDER_PREFIX) if name.startswith(ORDER_PREFIX) else ""
    field = ORDER.field if order else name
    per_torque = field in {check.field for check in PER_TORQUE} or (bool(order) and option == "--value")
    if not equals or not value.strip() or (not order and name not in NAMES) or (at and not (torque and per_torque)):
        raise UsageError(f"{option} {text}: not understood", HINT)
    if order:
        _number(order, text)
    return field, order, torque, value.strip()


def _number(text: str, whole: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{whole}: {text} is no number", HINT) from None


def _stated(text: str, asked: Asked, whole: str) -> Stated:
    if not is_spread(text):
        raise UsageError(f"--value {whole}: without its uncertainty", f"like {text}±1.2: expanded, k = 2; ±0 for none")
    try:
        value, expanded = read_spread(text, asked.check.unit.replace("·", "*"))
    except UnitError as error:
        raise UsageError(f"--value {whole}: {error.message}", error.hint) from None
    if value < 0:
        raise UsageError(f"--value {whole}: {asked.label} cannot be below zero", "its size, without a sign")
    return Stated(value, expanded / COVERAGE_FACTOR)
