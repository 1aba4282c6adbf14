"""Preset text to a validated `Drive`: everything that is wrong is found at once, with its place."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from typing import Any

from pydantic import ValidationError

from hdassist.errors import Finding, PresetError, UsageError
from hdassist.preset import overrides as sets
from hdassist.preset import yamltext
from hdassist.preset.convert import Converter, Values, field_table
from hdassist.preset.fields import (
    SCHEMA,
    Drive,
    Origin,
    Source,
    choices_of,
    plain,
    range_of,
    sections,
    unit_of,
)
from hdassist.preset.findings import OVERRIDE, Findings, in_order, near
from hdassist.preset.rules import conflicts
from hdassist.preset.yamltext import Document, Path


def load_text(text: bytes | str, file: str, overrides: Sequence[str] = ()) -> Drive:
    """Read and validate a preset.

    Arguments: text of the preset; file, its name in messages; overrides, such as "tolerances.F_i2=60".
    Result: the drive; its origin carries the SHA-256 of the text, the overrides and the warnings.
    Raises PresetError with every finding; UsageError if the text is in order and only the overrides are not.
    """
    parsed = [sets.parse(override, index) for index, override in enumerate(overrides, 1)]
    own = yamltext.read(text, file)
    drive, findings = _drive(sets.apply(own, parsed) if own.complete else own, file)
    if findings.items or drive is None:
        found = findings.sorted()
        only_overrides = all(finding.file == OVERRIDE for finding in found)
        if only_overrides or (overrides and not _drive(own, file)[1].items):
            raise UsageError("\n".join(map(str, found)))
        raise PresetError(found)
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    drive._origin = Origin(
        file=file,
        sha256=hashlib.sha256(data).hexdigest(),
        overrides=tuple(overrides),
        warnings=tuple(str(warning) for warning in _warnings(drive, findings)),
    )
    return drive


def _drive(document: Document, file: str) -> tuple[Drive | None, Findings]:
    findings = Findings(document, file)
    if not document.complete:
        return None, findings
    if not isinstance(document.data, dict):
        if document.data is None:
            findings.add((), "the preset is empty", "hdassist presets new NAME prints one to start from", "")
        elif document.data is not yamltext.BROKEN:
            findings.add((), "a preset must be a table of keys", "hdassist presets new NAME prints one to start from")
        return None, findings
    _check_schema(findings, document.data)
    values = Converter(findings).drive(document.data)
    drive = _validate(values, findings)
    for conflict, involved in conflicts(_valid(values, findings)):
        paths = [tuple(path.split(".")) for path in (conflict.path, *involved)]
        path = next((p for p in paths if findings.where(p)[0] == OVERRIDE), paths[0])
        findings.add(path, conflict.message, conflict.hint, conflict.got)
    if drive is not None:
        _check_alternatives(findings, drive)
    return drive, findings


def _check_alternatives(findings: Findings, drive: Drive) -> None:
    for index, values in enumerate(drive.alternatives):
        for path, value in values.items():
            if not drive.allows(path, value):
                info = field_table()[path]
                findings.add(("alternatives", index, path), f"out of range: {range_of(info, unit_of(info))}")


def _check_schema(findings: Findings, data: dict[str, Any]) -> None:
    if "schema" not in data:
        findings.add(("schema",), "missing key", f"write schema: {SCHEMA}")
    elif data["schema"] is not yamltext.BROKEN and data["schema"] != SCHEMA:
        findings.add(("schema",), f"must be {SCHEMA}")


def _validate(values: Values, findings: Findings) -> Drive | None:
    try:
        return Drive.model_validate(values)
    except ValidationError as error:
        for problem in error.errors(include_url=False):
            _translate(dict(problem), findings)
        return None


def _translate(problem: dict[str, Any], findings: Findings) -> None:
    """Add what pydantic found, in the words of somebody who writes presets."""
    path: Path = problem["loc"]
    if findings.is_bad(path) or path[:2] == ("mounting", "allowed"):
        return  # found and said before
    kind = str(problem["type"])
    if kind != "missing" and path not in findings.places:
        path = path[:2]  # the only item of a list, or the limit for all torques, written as one value
    info = field_table().get(".".join(map(str, path[:2]))) or Drive.model_fields.get(str(path[0]))
    if path[0] == "source" and len(path) > 2:
        info = Source.model_fields.get(str(path[2]))
    if kind == "missing":
        findings.add(path, *_missing(path), got="")
    elif kind == "extra_forbidden":
        findings.add(path, "unknown key", near(str(path[-1]), Source.model_fields) or "known: kind, ref", "", key=True)
    elif kind == "literal_error" and info is not None:
        choices = choices_of(info)
        findings.add(path, f"must be one of {', '.join(choices)}", near(str(problem["input"]), choices))
    elif kind == "string_type":
        quotes = "put it in quotes" if isinstance(problem["input"], int | float) else ""
        findings.add(path, "must be text", quotes)
    elif kind in ("greater_than_equal", "less_than_equal", "greater_than") and info is not None:
        unit = unit_of(field_table().get(str(path[1]), info) if path[0] == "uncertainty" else info)
        hint = _converted(problem["input"], findings.written(path), unit)
        findings.add(path, f"out of range: {range_of(info, unit)}", hint)
    elif kind.startswith("string_too"):
        findings.add(path, "must have 1 to 200 characters")
    else:
        findings.add(path, str(problem["msg"]).removeprefix("Value error, "))


def _missing(path: Path) -> tuple[str, str]:
    tables = dict(sections())
    if len(path) == 1 and path[0] in tables:
        needed = [name for name, info in tables[str(path[0])].model_fields.items() if info.is_required()]
        return "missing section", f"it needs {', '.join(needed)}"
    info = field_table().get(".".join(map(str, path)))
    unit = unit_of(info) if info is not None else ""
    if info is None:
        info = (Source if path[0] == "source" else Drive).model_fields.get(str(path[-1]))
    meaning = str(info.description) if info is not None else ""
    return "missing key", f"{meaning}, in {unit}" if unit else meaning


def _converted(value: float, written: str, unit: str) -> str:
    """The number in the unit of the field, where it was written in another one."""
    return f"that is {value:g} {unit}" if isinstance(yamltext.resolve(written), str) else ""


def _valid(values: Values, findings: Findings) -> dict[str, Any]:
    """Fields without a finding, by path: as given, or their default."""
    valid: dict[str, Any] = {}
    for path, info in field_table().items():
        section, name = path.split(".")
        if findings.is_bad((section, name)) or any(bad[:2] == (section, name) for bad in findings.bad):
            continue
        given = values.get(section, {})
        if name in given:
            valid[path] = given[name]
        elif not info.is_required():
            valid[path] = info.default
    return valid


def _warnings(drive: Drive, findings: Findings) -> Iterator[Finding]:
    found: list[Finding] = []

    def warn(path: Path, message: str, hint: str = "") -> None:
        file, mark = findings.where(path, key=True)
        found.append(Finding(file, *mark, yamltext.path_text(path), message, hint=hint))

    used = set(drive.operation.M_g)
    narrowed = findings.where(("operation", "M_g"))[0] == OVERRIDE  # this run's torques: the file's limits may be more
    torques = yamltext.shown(", ".join(map(plain, drive.operation.M_g[:20])))
    for path in sets.PER_TORQUE:
        for key in drive.value(".".join(path)):
            if key == "all" or float(key) in used:
                continue
            if not narrowed or findings.where((*path, key))[0] == OVERRIDE:
                warn(
                    (*path, key),
                    "a limit for a torque that is not in operation.M_g: accept looks at it, check does not",
                    f"M_g: {torques}",
                )
    yield from in_order(found)
