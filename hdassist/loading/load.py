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
from hdassist.preset.kinds import Section, choices_of, plain, read_value, unit_of
from hdassist.preset.knowledge import implausible
from hdassist.preset.units import UnitError, is_spread, read_spread
from hdassist.preset.yamltext import OVERRIDE, Document, InvalidValue, Path, near_miss, ordered_findings, shown

Asked = tuple[tuple[str, str], ...]  # options by name, which the next command on a drive is to have too


def load_preset(name_or_path: str, overrides: Sequence[str] = (), asked: Asked = ()) -> Drive:
    """Load a drive.

    Arguments: a name from the library, a path, or "-" for standard input; overrides like "cam.W_0=0.95"; asked, options
    that go into its origin.
    Raises DataError: no such preset, or a file that cannot be read; PresetError: an invalid preset;
    UsageError: a bad override.
    """
    text, file = library.read_preset(name_or_path)
    return load_text(text, file, overrides, asked)


def load_text(text: bytes | str, file: str, overrides: Sequence[str] = (), asked: Asked = ()) -> Drive:
    """Read and validate a preset.

    Arguments: text of the preset; file, its name in messages; overrides, such as "cam.W_0=0.95"; asked, options that go
    into its origin. Result: the drive; its origin carries the SHA-256 of the text, the overrides and the warnings.
    Raises PresetError with every finding; UsageError if the text is in order and only the overrides are not.
    """
    parsed = [sets.parse(override, index) for index, override in enumerate(overrides, 1)]
    document = yamltext.read_yaml(text, file)
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
        asked=asked,
    )
    return drive


def _drive(document: Document) -> Drive | None:
    """The drive of a document, None where there is none; faults are added to its findings."""
    if isinstance(document.data, InvalidValue):
        return None
    if not isinstance(document.data, dict):
        message = "the preset is empty" if document.data is None else "a preset must be a table of keys"
        got = "" if document.data is None else None
        document.add((), message, "hdassist presets new NAME prints one to start from", got)
        return None
    data = {key: value for key, value in document.data.items() if value is not None}
    _check_schema(document, data)
    _settle_spreads(document, data)
    drive = None
    try:
        drive = Drive.model_validate(data)
    except ValidationError as error:
        problems = error.errors(include_url=False, include_context=False)
        for problem in sorted(problems, key=lambda problem: problem["type"] != "extra_forbidden"):
            _translate(problem["loc"], problem["type"], problem["input"], document)
    if drive:  # the cam's support is that of its coupling: not given, or the coupling alone is on the command line
        fields = [tuple(path.split(".")) for path in (coupling.SUPPORT_FIELD, *coupling.COUPLING_FIELDS)]
        given, *tried = (path in document.places and document.is_override(path) for path in fields)
        if drive.supports.C_3 is None or (any(tried) and not given):
            drive = coupling.with_cam_support(drive)
    valid = _valid(drive, data, document)
    for conflict, involved in conflicts(valid):
        paths = [tuple(path.split(".", 2)) for path in (conflict.path, *involved)]
        path = next((p for p in paths if document.is_override(p)), paths[0])
        document.add(path, conflict.message, conflict.hint, conflict.got)
    _check_tables(drive.model_dump() if drive else data, valid, document)
    return drive


def _check_schema(document: Document, data: dict[str, Any]) -> None:
    if "schema" not in data:
        document.add(("schema",), "missing key", f"write schema: {PRESET_SCHEMA}")
    elif not isinstance(given := data.pop("schema"), InvalidValue) and given != PRESET_SCHEMA:
        document.add(("schema",), f"must be {PRESET_SCHEMA}")


def _settle_spreads(document: Document, data: dict[str, Any]) -> None:
    """Put uncertainties beside values ("260 ± 10") into their table; of two the one on the command line counts."""
    table = data.get("uncertainty", {})
    for path, info in measures().items() if isinstance(table, dict) else ():
        section, name = path.split(".")
        values = data.get(section)
        value = values.get(name) if isinstance(values, dict) else None
        if not isinstance(value, str) or not is_spread(value):
            continue
        with suppress(UnitError):  # the value itself is refused
            spread = read_spread(value, unit_of(info))[1]
            own_wins, beside_wins = (document.is_override(p) for p in (("uncertainty", path), (section, name)))
            if path in table and beside_wins == own_wins:
                words = f"the value has an uncertainty of {spread:g} beside it"
                document.add(("uncertainty", path), "given twice", words)
            elif path not in table or beside_wins:
                data["uncertainty"] = table = table | {path: spread}


def _check_tables(tables: dict[str, Any], valid: dict[str, Any], document: Document) -> None:
    """An uncertainty needs a value, and a value lies in its plausible range; one on the command line is tried."""
    uncertain, sources = (
        {} if document.is_bad((name,)) else tables.get(name, {}) for name in ("uncertainty", "source")
    )
    for path in uncertain:
        if path in valid and valid[path] is None:
            document.add(("uncertainty", path), "an uncertainty of a value that is not given", f"give {path} as well")
    for path, source in sources.items():
        place, value = ("source", path, "range"), valid.get(path)
        if value is None or document.is_bad(place) or document.is_override(tuple(path.split("."))):
            continue
        bounds = read_range(path, source.get("range"))
        if bounds and not bounds[0] <= value <= bounds[1]:
            words = f"the value {plain(value)} lies outside its range"
            document.add(place, words, "correct one of them", f"{plain(bounds[0])} to {plain(bounds[1])}")


def _translate(path: Path, kind: str, value: Any, document: Document) -> None:
    """Add a finding for a fault that pydantic reports, in words for an author of presets."""
    if document.is_bad(path):
        return  # it has a finding
    if kind != "missing" and path not in document.places:
        path = path[:2]  # the only item of a list, or the limit for all torques, written as one value
    section, field = str(path[0]), ".".join(map(str, path[:2]))
    model = BY_PATH.get(section) or dict(sections()).get(section)  # whose keys the table has
    info = field_table().get(field) or Drive.model_fields.get(section)
    if section in BY_PATH and len(path) > 2:
        info = BY_PATH[section].model_fields.get(str(path[2]))
    if isinstance(value, InvalidValue):
        document.refuse(path, value)
    elif kind == "extra_forbidden":
        hint = "" if len(document.findings) > yamltext.MAX_FINDINGS else _unknown_hint(path, value, model)
        document.add(path, "unknown key", hint, "", key=True)
    elif kind == "missing" and model and len(path) == 1:
        needed = [name for name, each in model.model_fields.items() if each.is_required()]
        document.add(path, "missing section", f"it needs {', '.join(needed)}", "")
    elif kind in ("model_type", "dict_type"):
        document.add(path, "must be a table of keys", f"its keys: {', '.join(model.model_fields)}" if model else "")
    elif info is None:
        document.add(path, "invalid value")
    elif kind == "missing":
        unit = unit_of(info)
        document.add(path, "missing key", f"{info.description}, in {unit}" if unit else str(info.description), "")
    elif kind == "literal_error":
        choices = choices_of(info)
        document.add(path, f"must be one of {', '.join(choices)}", near_miss(str(value), choices))
    elif kind == "string_type":
        document.add(path, "must be text", "put it in quotes" if isinstance(value, int | float) else "")
    else:
        words = "must be one line of 1 to 200 characters"  # the name
        document.add(path, words, "what is longer stands in description" * bool(value))


def _unknown_hint(path: Path, value: Any, model: type[Section] | None) -> str:
    """A hint for an unknown key of a table, whose keys are those of a model; of the whole preset without one."""
    if removed := REMOVED.get(".".join(map(str, path))):
        return removed
    key = str(path[-1])
    if value is None and ":" in key:
        return "a space is missing behind the colon"
    if value is None and key.replace(".", "").isdigit():
        return "a comma in a number? write a decimal point"
    home = next((section for section, each in sections() if key in each.model_fields), "")
    if home and path[0] not in BY_PATH:
        return f"{key} belongs to {home}"
    options = list(model.model_fields) if model else ["schema", *Drive.model_fields]
    return near_miss(key, options) or f"known: {', '.join(options)}"


def _valid(drive: Drive | None, data: dict[str, Any], document: Document) -> dict[str, Any]:
    """Fields without a finding, by path: as given, or their default."""
    if drive is not None:
        return {path: drive.value(path) for path in field_table()}
    valid: dict[str, Any] = {}
    bad = {path[:2] for path in document.bad}
    for path, info in field_table().items():
        section, name = path.split(".")
        given = data.get(section, {})
        if bad.isdisjoint({(section,), (section, name)}) and (name in given or not info.is_required()):
            valid[path] = read_value(info, given[name]) if name in given else info.default
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
