"""Preset text to a validated `Drive`, with all findings at once, each with line and column."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from pydantic import ValidationError

from hdassist.errors import PresetError, UsageError
from hdassist.model.rules import conflicts
from hdassist.preset import coupling, library, yamltext
from hdassist.preset import overrides as sets
from hdassist.preset.fields import (
    BY_PATH,
    IDENTIFIED_WITH,
    PRESET_SCHEMA,
    REMOVED,
    Drive,
    Origin,
    field_table,
    measures,
    read_range,
    sections,
)
from hdassist.preset.kinds import choices_of, plain, range_of, read_value, unit_of
from hdassist.preset.knowledge import implausible
from hdassist.preset.units import UnitError, is_spread, read_spread
from hdassist.preset.yamltext import OVERRIDE, Document, InvalidValue, Path, near_miss, ordered_findings, shown


def load_preset(name_or_path: str, overrides: Sequence[str] = ()) -> Drive:
    """Load a drive.

    Arguments: a name from the library, a path, or "-" for standard input; overrides like "cam.W_0=0.95".
    Raises DataError: no such preset, or a file that cannot be read; PresetError: an invalid preset;
    UsageError: a bad override.
    """
    text, file = library.read_preset(name_or_path)
    return load_text(text, file, overrides)


def load_text(text: bytes | str, file: str, overrides: Sequence[str] = ()) -> Drive:
    """Read and validate a preset.

    Arguments: text of the preset; file, its name in messages; overrides, such as "cam.W_0=0.95".
    Result: the drive; its origin carries the SHA-256 of the text, the overrides and the warnings.
    Raises PresetError with every finding; UsageError if the text is in order and only the overrides are not.
    """
    parsed = [sets.parse(override, index) for index, override in enumerate(overrides, 1)]
    document = yamltext.read_yaml(text, file)
    if document.complete:
        sets.apply(document, parsed)
    drive = _drive(document)
    if document.findings or drive is None:
        findings = ordered_findings(document.findings)
        if not all(finding.file == OVERRIDE for finding in findings):
            own = yamltext.read_yaml(text, file)
            if not overrides or not _drive(own) or own.findings:
                raise PresetError(findings)
        raise UsageError("\n".join(map(str, findings)))
    _warn(drive, document)
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    drive._origin = Origin(
        file=file,
        sha256=hashlib.sha256(data).hexdigest(),
        overrides=tuple(overrides),
        warnings=tuple(map(str, ordered_findings(document.warnings))),
    )
    return drive


def _drive(document: Document) -> Drive | None:
    """The drive of a document, None where there is none; faults are added to its findings."""
    if not document.complete:
        return None
    if not isinstance(document.data, dict):
        if not isinstance(document.data, InvalidValue):
            message, got = (
                ("the preset is empty", "") if document.data is None else ("a preset must be a table of keys", None)
            )
            document.add((), message, "hdassist presets new NAME prints one to start from", got)
        return None
    data = dict(document.data)
    _check_schema(document, data)
    _settle_spreads(document, data)
    drive = None
    try:
        drive = Drive.model_validate(data)
    except ValidationError as error:
        problems = error.errors(include_url=False, include_context=False)
        for problem in sorted(problems, key=lambda problem: problem["type"] != "extra_forbidden"):
            _translate(problem["loc"], problem["type"], problem["input"], document)
    if drive and _follows_coupling(drive, document):
        drive = coupling.with_cam_support(drive)
        data["source"] = {path: e for path, e in (data.get("source") or {}).items() if path != "supports.C_3"}
    valid = _valid(drive, data, document)
    _check_ranges(valid, data, document)
    for conflict, involved in conflicts(valid):
        paths = [tuple(path.split(".", 2)) for path in (conflict.path, *involved)]
        path = next((p for p in paths if document.is_override(p)), paths[0])
        document.add(path, conflict.message, conflict.hint, conflict.got)
    for field in drive.uncertainty if drive else ():
        if drive and drive.value(field) is None:
            document.add(("uncertainty", field), "an uncertainty of a value that is not given", f"give {field} as well")
    return drive


def _follows_coupling(drive: Drive, document: Document) -> bool:
    """Whether the cam's support is that of its coupling: not given, or the coupling alone is on the command line."""
    places = {path: document.places.get(tuple(path.split("."))) for path in ("supports.C_3", *coupling.COUPLING_FIELDS)}
    tried = {path for path, place in places.items() if place and place.file == OVERRIDE}
    return drive.supports.C_3 is None or (bool(tried) and "supports.C_3" not in tried)


def _check_schema(document: Document, data: dict[str, Any]) -> None:
    if "schema" not in data:
        document.add(("schema",), "missing key", f"write schema: {PRESET_SCHEMA}")
    elif not isinstance(given := data.pop("schema"), InvalidValue) and given != PRESET_SCHEMA:
        document.add(("schema",), f"must be {PRESET_SCHEMA}")


def _settle_spreads(document: Document, data: dict[str, Any]) -> None:
    """Put uncertainties beside values ("260 ± 10") into their table; of two the one on the command line counts."""
    table = data.get("uncertainty") or {}
    beside = [
        (section, name, value)
        for section, values in data.items()
        for name, value in (values.items() if isinstance(values, dict) else ())
    ]
    for section, name, value in beside if isinstance(table, dict) else ():
        path = f"{section}.{name}"
        if path not in measures() or not isinstance(value, str) or not is_spread(value):
            continue
        with suppress(UnitError):  # the value itself is refused
            spread = read_spread(value, unit_of(measures()[path]))[1]
            own_wins, beside_wins = (document.is_override(p) for p in (("uncertainty", path), (section, name)))
            if path in table and beside_wins == own_wins:
                words = f"the value has an uncertainty of {spread:g} beside it"
                document.add(("uncertainty", path), "given twice", words)
            elif path not in table or beside_wins:
                data["uncertainty"] = table = table | {path: spread}


def _check_ranges(valid: dict[str, Any], data: dict[str, Any], document: Document) -> None:
    """A value lies in the range that its source calls plausible; one on the command line is tried, and need not."""
    table = data.get("source")
    for path, entry in table.items() if isinstance(table, dict) else ():
        place = ("source", path, "range")
        bounds = read_range(path, entry.get("range")) if isinstance(entry, dict) and path in measures() else None
        tried = document.is_override(tuple(path.split(".")))
        value = None if tried or document.is_bad(place) else valid.get(path)
        if isinstance(bounds, tuple) and value is not None and not bounds[0] <= value <= bounds[1]:
            got = f"{plain(bounds[0])} to {plain(bounds[1])}"
            document.add(place, f"the value {plain(value)} lies outside its range", "correct one of them", got)


def _translate(path: Path, kind: str, value: Any, document: Document) -> None:
    """Add a finding for a fault that pydantic reports, in words for an author of presets."""
    if document.is_bad(path):
        return  # it has a finding
    if kind == "missing":
        document.add(path, *_missing(path), got="")
        return
    if path not in document.places:
        path = path[:2]  # the only item of a list, or the limit for all torques, written as one value
    info = field_table().get(".".join(map(str, path[:2]))) or Drive.model_fields.get(str(path[0]))
    if path[0] in BY_PATH and len(path) > 2:
        info = BY_PATH[str(path[0])].model_fields.get(str(path[2]))
    if kind == "extra_forbidden":
        hint = "" if len(document.findings) > yamltext.MAX_FINDINGS else _unknown_hint(path, value)
        document.add(path, "unknown key", hint, "", key=True)
    elif isinstance(value, InvalidValue):
        document.refuse(path, value)
    elif kind in ("model_type", "dict_type"):
        document.add(path, "must be a table of keys")
    elif kind == "literal_error" and info is not None:
        choices = choices_of(info)
        document.add(path, f"must be one of {', '.join(choices)}", near_miss(str(value), choices))
    elif kind == "string_type":
        document.add(path, "must be text", "put it in quotes" if isinstance(value, int | float) else "")
    elif path == ("name",) and kind == "value_error":
        document.add(path, "must be one line", "what is longer stands in description")
    elif kind.startswith("string_too"):
        document.add(path, "must have 1 to 200 characters")
    elif info is not None:
        unit = unit_of(field_table().get(str(path[1]), info) if path[0] == "uncertainty" else info)
        converted = isinstance(yamltext.scalar_value(document.written(path)), str)  # written in another unit
        hint = f"that is {value:g} {unit}" if converted else ""
        document.add(path, f"out of range: {range_of(info, unit)}", hint)


def _unknown_hint(path: Path, value: Any) -> str:
    """A hint for an unknown key."""
    if removed := REMOVED.get(".".join(map(str, path))):
        return removed
    key, table = str(path[-1]), str(path[0])
    if value is None and ":" in key:
        return "a space is missing behind the colon"
    if value is None and key.replace(".", "").isdigit():
        return "a comma in a number? write a decimal point"
    home = next((section for section, model in sections() if key in model.model_fields), "")
    if home and table not in BY_PATH:
        return f"{key} belongs to {home}"
    options = ["schema", *Drive.model_fields]
    if len(path) > 1:
        options = list((BY_PATH[table] if table in BY_PATH else dict(sections())[table]).model_fields)
    return near_miss(key, options) or f"known: {', '.join(options)}"


def _missing(path: Path) -> tuple[str, str]:
    tables = dict(sections())
    if len(path) == 1 and path[0] in tables:
        needed = [name for name, info in tables[str(path[0])].model_fields.items() if info.is_required()]
        return "missing section", f"it needs {', '.join(needed)}"
    info = field_table().get(".".join(map(str, path)))
    unit = unit_of(info) if info is not None else ""
    if info is None:
        info = BY_PATH.get(str(path[0]), Drive).model_fields.get(str(path[-1]))
    meaning = str(info.description) if info is not None else ""
    return "missing key", f"{meaning}, in {unit}" if unit else meaning


def _valid(drive: Drive | None, data: dict[str, Any], document: Document) -> dict[str, Any]:
    """Fields without a finding, by path: as given, or their default."""
    if drive is not None:
        return {path: drive.value(path) for path in field_table()}
    valid: dict[str, Any] = {}
    bad = {path[:2] for path in document.bad}
    for path, info in field_table().items():
        section, name = path.split(".")
        given = data.get(section) or {}
        if (section,) in bad or (section, name) in bad:
            continue
        if name in given:
            valid[path] = read_value(info, given[name])
        elif not info.is_required():
            valid[path] = info.default
    return valid


def _warn(drive: Drive, document: Document) -> None:
    """Warn of valid values that are far from usual or have no effect."""
    _warn_of_limits(drive, document)
    _warn_of_model(drive, document)
    for path, message, usual in implausible(drive):
        document.warn(tuple(path.split(".")), message, usual)


def _warn_of_limits(drive: Drive, document: Document) -> None:
    """Warn of limits at torques that are not computed; those of a file may be more than the torques of one run."""
    narrowed = document.is_override(("operation", "M_g"))
    torques = shown(", ".join(map(plain, drive.operation.M_g[:20])))
    message = "a limit for a torque that is not in operation.M_g: accept looks at it, check does not"
    for section, name in sets.PER_TORQUE:
        for key in drive.value(f"{section}.{name}"):
            path = (section, name, key)
            counts = not narrowed or document.is_override(path)
            if key != "all" and float(key) not in drive.operation.M_g and counts:
                document.warn(path, message, f"M_g: {torques}")


def _warn_of_model(drive: Drive, document: Document) -> None:
    """Warn where values were identified with another shape of rim or flanks than is used, or may have been."""
    if all(source.kind != "identified" for source in drive.source.values()):
        return
    for name, before in IDENTIFIED_WITH.items():
        path, here = ("numerics", name), drive.value(f"numerics.{name}")
        if document.is_override(path):
            document.warn(
                path, f"{here}: values of this preset were identified with the numerics.{name} that it names, if any",
                "they fit no other; calibrate anew with this one",
            )  # fmt: skip
        elif path not in document.places:
            document.warn(
                ("source",), f"values were identified, but not said with which numerics.{name}; {here} is used",
                f"older values are of {before}: write numerics.{name}: {before}, or calibrate anew",
            )  # fmt: skip
