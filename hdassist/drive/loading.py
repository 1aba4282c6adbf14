"""Conversion of preset text to a `Drive`, and of values back to text.

Text and overrides give a validated `Drive`, or all findings at once with line and column. New texts are made for a
drive that is similar to another one, or from a text with changed values. Presets have a JSON Schema.
"""

from __future__ import annotations

import hashlib
import json
import re
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from functools import lru_cache
from io import StringIO
from math import isfinite
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from hdassist.drive.model.rules import conflicts
from hdassist.drive.preset.fields import (
    BY_PATH,
    IDENTIFIED_WITH,
    KEYED_TABLES,
    MAX_NAME,
    PATH_TABLES,
    PRESET_SCHEMA,
    REMOVED,
    UNKNOWN,
    AskedOption,
    CostLaw,
    Drive,
    Origin,
    PresetField,
    Section,
    Source,
    deviation_sizes,
    field_table,
    is_overridden,
    measures,
    origin_counts,
    path_of,
    plain,
    sections,
    text_of,
)
from hdassist.drive.preset.knowledge import (
    COUPLING_FIELDS,
    SUPPORT_FIELD,
    Requirements,
    SimilarValue,
    implausible,
    similar,
    with_cam_support,
)
from hdassist.drive.preset.text import (
    MAX_FINDINGS,
    OVERRIDE,
    Document,
    InvalidValueError,
    Mark,
    Path,
    SourceSpan,
    near_miss,
    ordered_findings,
    path_text,
    read_spread,
    read_yaml,
    scalar_value,
    shown,
)
from hdassist.run.errors import DataError, Finding, PresetError, UsageError
from hdassist.run.files import NUMBER, read_preset

if TYPE_CHECKING:
    from ruamel.yaml import YAML


# position of an override in a message, which is removed if the override is not from --set
OVERRIDE_PLACE = re.compile(rf"^{OVERRIDE}:\d+:\d+: ", re.MULTILINE)
_PER_TORQUE = [tuple(path.split(".")) for path, field in field_table().items() if field.kind == "limits"]
Asked = tuple[AskedOption, ...]


def load_preset(
    name_or_path: str,
    overrides: Sequence[str] = (),
    asked: Asked = (),
) -> Drive:
    """Load a drive.

    name_or_path: a name from the library, a path, or "-" for standard input.
    overrides: overrides such as "cam.W_0=0.95".
    asked: options that are stored in the drive's origin.
    Raises DataError if there is no such preset or its file cannot be read, PresetError for an invalid preset, and
    UsageError for an invalid override.
    """
    text, file = read_preset(name_or_path)
    return load_text(text, file, overrides, asked)


def with_warning(drive: Drive, text: str) -> Drive:
    """Return the drive with a further warning in its origin."""
    changed = drive.model_copy()
    changed._origin = replace(drive.origin, warnings=(*drive.origin.warnings, text))
    return changed


def with_asked(drive: Drive, asked: Asked) -> Drive:
    """Return the drive with other options in its origin, for use by the next command."""
    changed = drive.model_copy()
    changed._origin = replace(drive.origin, asked=asked)
    return changed


def load_text(
    text: bytes | str,
    file: str,
    overrides: Sequence[str] = (),
    asked: Asked = (),
) -> Drive:
    """Read and validate a preset, and return its drive.

    The origin of the drive contains the SHA-256 of the text, the overrides and the warnings.

    text: text of the preset.
    file: name of the file in messages.
    overrides: overrides such as "cam.W_0=0.95".
    asked: options that are stored in the origin.
    Raises PresetError with all findings, or UsageError if only the overrides are invalid.
    """
    document = _document(text, file)
    # overrides change the document before validation, so all rules apply to them
    for index, override in enumerate(overrides, 1):
        set_override(document, override, index)
    drive = _drive(document)
    if document.findings or drive is None:
        findings = ordered_findings(document.findings)
        # faults of the command line are wrong usage, faults of the file an invalid preset
        if not all(finding.file == OVERRIDE for finding in findings):
            # validation without overrides shows whether the file or the command line is at fault
            document_of_preset = _document(text, file)
            if not overrides or not _drive(document_of_preset) or document_of_preset.findings:
                raise PresetError(findings)
        raise UsageError("\n".join(map(str, findings)))
    _warn_of_limits(drive, document)
    _warn_of_model(drive, document)
    # warn of values that are valid but far from usual
    for path, message, usual in implausible(drive):
        document.warn(tuple(path.split(".")), message, usual)
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    drive._origin = Origin(
        file=file,
        sha256=hashlib.sha256(data).hexdigest(),
        overrides=tuple(overrides),
        warnings=tuple(OVERRIDE_PLACE.sub("", str(finding)) for finding in ordered_findings(document.warnings)),
        asked=asked,
        M_g=_replaced_torques(drive, text, file, overrides),
    )
    return drive


def _replaced_torques(
    drive: Drive,
    text: bytes | str,
    file: str,
    overrides: Sequence[str],
) -> tuple[float, ...]:
    """Return the torques in the file that an override of operation.M_g replaces [N*m].

    The result is empty if it is not needed: without such an override, with a rated torque, or if the file is not a
    valid drive without its overrides.

    drive: the drive with the overrides.
    text, file, overrides: as in `load_text`.
    """
    # without a rated torque, the largest torque of the file counts as the rated torque
    if drive.operation.rated is not None or not is_overridden("operation.M_g", overrides):
        return ()
    in_file = _drive(_document(text, file))
    return in_file.operation.M_g if in_file else ()


_parsed = lru_cache(maxsize=4)(read_yaml)  # a sweep, a lot and the explorer load the same text repeatedly


def _document(text: bytes | str, file: str) -> Document:
    """Return a copy of the parsed document of a preset's text, which overrides and findings may change."""
    read = _parsed(text, file)
    return replace(
        read, data=deepcopy(read.data), places={**read.places}, findings=[*read.findings], bad={*read.bad}, warnings=[]
    )


def set_override(
    document: Document,
    text: str,
    index: int,
) -> None:
    """Apply an override "section.key=VALUE" to a document.

    text: the override.
    index: number of the override from 1, which is the line number of its findings.
    Raises UsageError if "=" is missing, the key is empty or contains hidden characters, or the value is not valid YAML.
    """
    key, equals, value = text.partition("=")
    # the path has a section, a name and, for an entry of a table, a further key
    full_path = path_of(key)
    if not equals or not all(full_path) or not key.strip().isprintable():  # YAML does not have such keys either
        raise UsageError(
            f"{OVERRIDE}:{index}:1: expected section.key=VALUE (got {shown(text) or 'nothing'})",
            f"use, for example, {OVERRIDE} gears.j_n=6",
        )
    at_key = Mark(index, 1)
    start = len(key) + 1
    read = read_yaml(value, OVERRIDE, full_path, lambda line, column: Mark(index, (column if line == 1 else 1) + start))
    if read.findings:
        raise UsageError("\n".join(map(str, read.findings)))
    if not isinstance(document.data, dict):
        return
    default_span = SourceSpan(
        file=OVERRIDE,
        key=at_key,
        value=Mark(index, start + 1),
    )
    span = replace(read.places.get(full_path, default_span), key=at_key)
    table = _inner_table(document, full_path, span)
    if table is None:
        return
    table[full_path[-1]] = read.data
    # positions below the path belonged to the replaced value
    kept_places = {path: place for path, place in document.places.items() if path[: len(full_path)] != full_path}
    document.places = kept_places | read.places | {full_path: span}
    document.bad = {path for path in document.bad if path[: len(full_path)] != full_path}


def _inner_table(
    document: Document,
    whole: Path,
    span: SourceSpan,
) -> dict[Any, Any] | None:
    """Return the table for the value of an override, created if necessary.

    If an entry on the way is not a table, the fault is added to the findings and the result is None.

    document: the preset.
    whole: path of the override.
    span: position of the override.
    """
    table: dict[Any, Any] = document.data
    # descend to the table that contains the last key
    for end, part in enumerate(whole[:-1], 1):
        path = whole[:end]
        inner = table.get(part)
        if inner is not None and not isinstance(inner, dict):
            # a number in place of a table is allowed only for values per torque
            if path not in _PER_TORQUE:
                message = f"{path_text(path)} is not a table of keys"
                document.findings.append(Finding(OVERRIDE, *span.key, path_text(whole), message))
                return None
            inner = {"all": inner}  # a bare number is the limit for all torques, to which the override adds an entry
            document.places[(*path, "all")] = document.places[path]
        document.places.setdefault(path, span)
        inner = inner or {}
        table[part] = inner
        table = inner
    return table


def _drive(document: Document) -> Drive | None:
    """Return the drive of a document; None if it is invalid, with the faults added to its findings."""
    data = _table_of_drive(document)
    if data is None:
        return None
    # uncertainties are moved before validation, which accepts them only in their table
    _settle_spreads(document, data)
    data |= {name: _known_paths(document, name, data[name]) for name in PATH_TABLES if isinstance(data.get(name), dict)}
    # the validators fill these values even if the drive as a whole is rejected
    values = dict[str, Any]()  # valid values by path
    drive = None
    try:
        drive = Drive.model_validate(data, context=values)
    except ValidationError as error:
        for fault in error.errors(include_url=False):
            _add_fault(document, fault)
    # conflicts are detected among all values, including defaults
    _add_defaults(document, values)
    if drive:
        drive = _with_support_of_coupling(document, drive, values)
    _add_conflicts(document, values)
    _check_tables(values, document)
    return drive


def _table_of_drive(document: Document) -> dict[str, Any] | None:
    """Return the table of a document without schema and empty keys; None, with a finding, if it is not a table."""
    if () in document.bad:
        return None
    if not isinstance(document.data, dict):
        message = "the preset is empty" if document.data is None else "a preset must be a table of keys"
        got = "" if document.data is None else None
        document.add((), message, "create one with hdassist presets new NAME", got)
        return None
    data = {key: value for key, value in document.data.items() if value is not None or (key,) in document.bad}
    if "schema" not in data:
        document.add(("schema",), "missing key", f"write schema: {PRESET_SCHEMA}")
    elif data.pop("schema") != PRESET_SCHEMA and ("schema",) not in document.bad:
        document.add(("schema",), f"must be {PRESET_SCHEMA}")
    return data


def _add_conflicts(document: Document, values: dict[str, Any]) -> None:
    """Add a finding for each conflict between valid values, at an overridden value if one is involved."""
    for conflict, involved in conflicts({path: values[path] for path in field_table() if path in values}):
        paths = [tuple(path.split(".", 2)) for path in (conflict.path, *involved)]
        # a finding at the override shows the user the conflicting value
        override_paths = [path for path in paths if document.is_override(path)]
        place = override_paths[0] if override_paths else paths[0]
        document.add(place, conflict.message, conflict.hint, conflict.got)


def _add_defaults(document: Document, values: dict[str, Any]) -> None:
    """Add the defaults of optional fields without a fault to the valid values."""
    faulty_paths = {path_text(path[:2]) for path in document.bad}
    for path, field in field_table().items():
        section = path.partition(".")[0]
        if not field.is_required and faulty_paths.isdisjoint((path, section)):
            values.setdefault(path, field.default)


def _with_support_of_coupling(
    document: Document,
    drive: Drive,
    values: dict[str, Any],
) -> Drive:
    """Return the drive with the wave generator's support from its coupling, if the support is not given.

    It also counts as not given if the command line sets a field of the coupling but not the support.
    """
    support_path = tuple(SUPPORT_FIELD.split("."))
    is_support_set = support_path in document.places and document.is_override(support_path)
    coupling_paths = [tuple(path.split(".")) for path in COUPLING_FIELDS]
    is_coupling_set = any(path in document.places and document.is_override(path) for path in coupling_paths)
    # a support that is stated, or set after the coupling, is not changed
    if drive.supports.C_3 is not None and (is_support_set or not is_coupling_set):
        return drive
    drive = with_cam_support(drive)
    values |= {SUPPORT_FIELD: drive.supports.C_3, "drive.source": drive.source}
    return drive


def _settle_spreads(document: Document, data: dict[str, Any]) -> None:
    """Move uncertainties written beside values ("260 ± 10") to their table; the command line overrides the file."""
    table = data.get("uncertainty", {})
    for path, field in measures().items() if isinstance(table, dict) else ():
        spread_path = ("uncertainty", path)
        field_path = tuple(path.split("."))
        with suppress(KeyError, InvalidValueError):  # no value, no uncertainty beside it, or an invalid value
            spread = read_spread(document.places[field_path].text, field.unit)[1]
            # the command line overrides the file; two uncertainties from the same source are a fault
            own_wins = document.is_override(spread_path)
            beside_wins = document.is_override(field_path)
            if path in table and beside_wins == own_wins:
                document.add(
                    spread_path,
                    "the uncertainty is given twice",
                    f"the value itself states an uncertainty of {spread:g}; leave out one of the two",
                )
            elif path not in table or beside_wins:
                data["uncertainty"] = table = table | {path: spread}


def _check_tables(values: dict[str, Any], document: Document) -> None:
    """Check the number of draws of a fit, uncertainties without a value, and the ranges of values.

    All fields of a fit must have the same number of draws, the first of which is the value. A value from the command
    line is not compared with a range.
    """
    draws: dict[str, Any] = values.get("drive.fit", {})
    # all fields of a fit must have as many draws as the first field
    first = next(iter(draws), "")
    for path, table_values in draws.items():
        field_path = tuple(path.split("."))
        value = values.get(path)
        if len(table_values) != len(draws[first]):
            message = f"has {len(table_values)} values, but {first} has {len(draws[first])}"
            document.add(
                ("fit", path),
                message,
                "give each field the same number of values; values in the same place belong to one drive",
            )
        elif value is not None and value != table_values[0] and not document.is_override(field_path):
            document.warn(
                field_path,
                f"{plain(value)} differs from the fitted value {plain(table_values[0])}",
                "the values of the fit section are not used for this field",
            )
    for path in values.get("drive.uncertainty", ()):
        if path in values and values[path] is None:
            document.add(
                ("uncertainty", path), "an uncertainty is given without a value", f"give the value of {path} too"
            )
    _check_ranges(values, document)


def _check_ranges(values: dict[str, Any], document: Document) -> None:
    """Check that ranges contain the values, and that given values have no range, because it would have no effect."""
    for path, source in values.get("drive.source", {}).items():
        bounds = source.range
        value = values.get(path)
        if bounds and source.kind == "given":
            hint = "delete the range, or write kind: assumed to sample it"
            document.add(("source", path, "range"), "a given value has no range", hint)
            continue
        # a value set by the user need not be within the range in the preset
        if not bounds or value is None or document.is_override(tuple(path.split("."))):
            continue
        if not bounds[0] <= value <= bounds[1]:
            message = f"the value {plain(value)} lies outside its range"
            ends = " to ".join(map(plain, bounds))
            document.add(("source", path, "range"), message, "correct one of them", ends)


def _known_paths(
    document: Document,
    name: str,
    table: dict[str, Any],
) -> dict[str, Any]:
    """Return the entries of a table whose paths are allowed; other entries become findings."""
    paths, message = {
        "cost": (tuple(deviation_sizes()), "is not the size of a deviation"),
        "source": (tuple(field_table()), "is not a field"),
    }.get(name, (tuple(measures()), "is not a field with a single number"))
    for path in table.keys() - {*paths}:
        hint = f"for example {paths[0]}" if path in field_table() else "write section.key, for example gears.z_g"
        if path not in field_table() and len(document.findings) <= MAX_FINDINGS:
            same = (known_path for known_path in paths if known_path.split(".")[1] == path.split(".")[-1])
            hint = near_miss(next(same, path), paths) or hint
        document.add(
            (name, path),
            message,
            hint,
            shown(path) or "nothing",
            key=True,
        )
    return {path: entry for path, entry in table.items() if path in paths}


def _add_fault(document: Document, fault: ErrorDetails) -> None:
    """Add a finding for a validation fault, unless the value already has one."""
    path = fault["loc"]
    error = fault.get("ctx", {}).get("error")
    # each value has at most one finding
    if path in document.bad:
        return
    schema_model = {**dict(sections()), **BY_PATH}.get(str(path[0]))
    is_short = len(document.findings) <= MAX_FINDINGS
    model = schema_model if schema_model and len(path) > 1 else Drive
    if isinstance(error, InvalidValueError):
        document.refuse(path, error)
    elif fault["type"] == "extra_forbidden":
        document.add(
            path,
            "unknown key",
            _unknown_hint(path, fault["input"], model) if is_short else "",
            "",
            key=True,
        )
    elif fault["type"] != "missing":
        document.add(
            path, "must be a table of keys", f"its keys: {', '.join(schema_model.model_fields)}" if schema_model else ""
        )
    elif schema_model and model is Drive:
        needed = [name for name, field in schema_model.declared().items() if field.is_required]
        document.add(path, "missing section", f"it needs {', '.join(needed)}", "")
    else:
        field = model.declared()[str(path[-1])]
        document.add(path, "missing key", f"{field.meaning}{field.unit and f', in {field.unit}'}", "")


def _unknown_hint(
    path: Path,
    value: Any,
    model: type[Section],
) -> str:
    """Return a hint for an unknown key of a table whose keys are the fields of a model."""
    # the hint for a field of an earlier version names its successor
    if removed := REMOVED.get(".".join(map(str, path))):
        return removed
    key = str(path[-1])
    # "name:value" is one word in YAML
    if value is None and ":" in key:
        return "a space is missing after the colon"
    # "1,5" in a list is two entries
    if value is None and key.replace(".", "").isdigit():
        return "write a decimal point, not a comma"
    home = next((section for section, model in sections() if key in model.model_fields), "")
    if home and path[0] not in BY_PATH:
        return f"{key} belongs to {home}"
    options = list(model.model_fields)
    if model is Drive:
        options.insert(0, "schema")
    return near_miss(key, options) or f"known: {', '.join(options)}"


def _warn_of_limits(drive: Drive, document: Document) -> None:
    """Warn of limits at torques that are not computed."""
    narrowed = document.is_override(("operation", "M_g"))
    torques = shown(", ".join(map(plain, drive.operation.M_g[:20])))
    message = "the torque of this limit is not in operation.M_g; accept uses the limit, but check does not"
    for section, name in _PER_TORQUE:
        for key in drive.value(f"{section}.{name}"):
            path = (section, name, key)
            # with overridden torques, limits in the file at other torques are expected
            counts = not narrowed or document.is_override(path)
            if key != "all" and float(key) not in drive.operation.M_g and counts:
                document.warn(path, message, f"M_g: {torques}")


def _warn_of_model(drive: Drive, document: Document) -> None:
    """Warn if values were, or may have been, identified with other `numerics` settings than those in use."""
    # only identified values depend on the settings
    if all(source.kind != "identified" for source in drive.source.values()):
        return
    for name, before in IDENTIFIED_WITH.items():
        path = ("numerics", name)
        value = drive.value(f"numerics.{name}")
        if document.is_override(path):
            document.warn(
                path,
                f"{value} differs from the setting with which values of this preset were identified",
                f"calibrate again, because identified values are valid only with the numerics.{name} used in their fit",
            )
        elif path not in document.places:
            document.warn(
                ("source",),
                f"the preset has identified values but does not state their numerics.{name}; {value} is used",
                f"write numerics.{name}: {before} if an older version identified the values, or calibrate again",
            )


# --- writing of values into text

_WIDTH = 110  # characters per line of a description


def _name(text: str) -> str:
    """Return a text in YAML, without quotes if this is safe."""
    word = re.fullmatch(r"[A-Za-z][A-Za-z0-9]*([-_][A-Za-z0-9]+)*", text)
    return text if word and isinstance(scalar_value(text), str) else _quoted(text)


def similar_preset(
    name: str,
    like: Drive,
    required: Requirements,
    description: str = "",
) -> str:
    """Return the text of a preset for a drive that is similar to another one.

    name: name of the new drive.
    like: the other drive.
    required: requirements for the new drive.
    description: description in place of the usual one.
    Raises UsageError for an invalid name, for requirements that contradict each other, or if no drive meshes.
    """
    if not 1 <= len(name) <= MAX_NAME or not name.isprintable():
        raise UsageError(f"invalid name of a drive: expected 1 to {MAX_NAME} printable characters", "use another name")
    entries = similar(like, required)
    text = "\n".join(_similar_lines(name, like, entries, description)) + "\n"
    try:
        # the text is read again to make sure that the new preset is valid
        counts = origin_counts(load_text(text, name))
    except PresetError as error:
        message = f"these values do not give a valid drive: {error.findings[0].message}"
        raise UsageError(message, "choose other tooth numbers or another size") from None
    like_name = like.name if like.name.isprintable() else "another drive"
    value_counts = f"values given: {counts['given']}, assumed: {counts['assumed']}"
    head = f"# Made by hdassist presets new, scaled from {like_name}; {value_counts}."
    return f"{head}\n# yaml-language-server: $schema={SCHEMA_FILE}\n{text}"


def _similar_lines(
    name: str,
    like: Drive,
    entries: Mapping[str, SimilarValue],
    description: str,
) -> Iterator[str]:
    z_g, z_b, m = (entries[f"gears.{field}"].value for field in ("z_g", "z_b", "m"))
    yield (
        "# `source` at the end of the file states how each value was chosen, and its range. Replace the values that you"
    )
    yield (
        "# know, and write kind: given there, without a range. Unknown values are not zero: results are ranges over "
        "these values."
    )
    yield "# Assumed design: a steel flexspline (material.*) in the shape of a cup that is supported at its closed end"
    yield "# (flexspline.l, flexspline.h_3, supports.C_2), a flexible ball bearing (bearing.*), and two mesh zones."
    yield f"schema: {PRESET_SCHEMA}"
    yield f"name: {_name(name)}"
    first_line = description or (
        f"Drive {z_g}/{z_b}, pitch diameter {m * z_g:.5g} mm, scaled from {like.name}. "
        "The absolute values are estimates; `source` states the origin of each value."
    )
    if first_line.isprintable():
        yield "description: >-"
        yield from textwrap.wrap(
            first_line, _WIDTH, initial_indent="  ", subsequent_indent="  ", break_long_words=False
        )
    else:
        yield f"description: {_quoted(first_line)}"
    for section, model in sections():
        fields = {f"{section}.{name}": field for name, field in model.declared().items()}
        if entries.keys() & fields.keys() or section in ("tolerances", "phases", "harmonics"):
            yield from ("", f"{section}:")
        for path, field in fields.items():
            # directions of harmonics need an amplitude
            is_open = field.unknown and not path.startswith("harmonics.xi_")
            if path in entries or is_open:
                value = text_of(entries[path].value) if path in entries else UNKNOWN
                line = f"  {path.split('.')[1]}: {value}"
                yield f"{line:<23} # {field.unit and f'{field.unit}, '}{field.meaning}"
    yield from ("", "source:")
    for path, entry in entries.items():
        bounds = f"range: {text_of(entry.range)}, " if entry.range else ""
        yield f"  {path}: {{kind: {entry.kind}, {bounds}ref: {_quoted(entry.ref)}}}"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=not text.isprintable())


def with_found_values(
    text: str,
    file: str,
    values: Mapping[str, float],
    ref: str,
    model: Mapping[str, str | int] | None = None,
) -> str:
    """Return the text of a preset with identified values; comments and sequence remain unchanged.

    A previous fit is removed.

    text: text of the preset.
    file: name of the file in messages.
    values: identified values by path; the text may lack their fields.
    ref: reference to the source of the values.
    model: fields of numerics used in the identification, which are written into the text.
    Raises the errors of `load_text`, and DataError if the text cannot be changed in place.
    """
    before = load_text(text, file)
    tables = _tables(text)
    tables.pop("fit", None)  # its draws belong to the previous values
    for path, value in values.items():
        _set_value(tables, path, value)
        _table(tables, "source")[path] = _source("identified", ref, before.source.get(path), value)
    for name, setting in (model or {}).items():
        _table(tables, "numerics").setdefault(name, setting)
    return _written(tables, file, before.with_values(values), model)


def with_changes(
    text: bytes,
    file: str,
    overrides: Sequence[str],
) -> str:
    """Return the text of a preset with overrides included; comments and sequence remain unchanged.

    A changed value whose source was assumed or identified becomes assumed. Its range is removed if the new value is
    outside.

    text: text of the preset.
    file: name of the file in messages.
    overrides: overrides such as "cam.W_0=0.95".
    Raises the errors of `load_text` with these overrides. Raises DataError if an override is not a single field, or if
    the text cannot be changed in place.
    """
    wanted = load_text(text, file, overrides)
    before = load_text(text, file)
    tables = _tables(text.decode("utf-8-sig"))
    changes = set()
    for override in overrides:
        key, _, written = override.partition("=")
        parts = path_of(key)
        # name and description of the preset are texts without a section
        if len(parts) == 1 and isinstance(tables.get(parts[0]), str):
            tables[parts[0]] = str(_tables(written))
            continue
        if len(parts) == 1:
            raise DataError(
                f"--set {override} cannot be saved", "edit the file instead; only values of single fields can be saved"
            )
        section, name, *entry = parts
        path = f"{section}.{name}"
        if path not in field_table():
            raise DataError(
                f"--set {override} cannot be saved", "edit the file instead; only values of single fields can be saved"
            )
        changes.add(path)
        _set_value(tables, path, _tables(written), *entry)
        source = before.source.get(path)
        value = wanted.value(path)
        if source is not None and value != before.value(path):
            # the origin of the old value does not apply to the new one
            ref = f"changed manually; was {source.kind}"
            _table(tables, "source")[path] = _source("assumed", ref, source, value)
    # a support that follows from a changed coupling is removed from the text, because it is computed again
    if "supports.C_3" not in changes and changes & {*COUPLING_FIELDS}:
        _table(tables, "source").pop("supports.C_3", None)
        _table(tables, "supports")["C_3"] = None
    return _written(tables, file, wanted)


def _editor() -> YAML:
    """Return a YAML reader and writer that preserves comments and sequence."""
    from ruamel.yaml import YAML  # the import takes 40 ms, so only commands that write a preset do it

    editor = YAML()
    editor.preserve_quotes = True
    editor.width = 2**20
    editor.indent(
        mapping=2,
        sequence=4,
        offset=2,
    )
    return editor


def _tables(text: str) -> Any:
    """Return YAML text as tables that preserve their comments."""
    return _editor().load(text)


def _table(tables: Any, name: str) -> Any:
    """Return a table of a preset, which is created if necessary."""
    if tables.get(name) is None:
        tables[name] = {}
    return tables[name]


def _set_value(
    tables: Any,
    path: str,
    value: Any,
    entry: str | int = "",
) -> None:
    """Set the value of a field, or one entry of it.

    An existing value for all torques is kept beside an entry for one torque.

    tables: tables of the preset.
    path: path of the field.
    value: value of the field or of the entry.
    entry: key of the entry; empty for the field itself.
    """
    section, name = path.split(".")
    table = _table(tables, section)
    if entry:
        if not isinstance(table.get(name), dict):
            table[name] = {} if table.get(name) is None else {"all": table[name]}
        table = table[name]
        name = str(entry)
    table[name] = value


def _source(
    kind: str,
    ref: str,
    before: Source | None,
    value: Any,
) -> Any:
    """Return a source in one line, with the range of the previous source if it contains the value."""
    bounds = before.range if before else None
    inside = bounds and isinstance(value, int | float) and bounds[0] <= value <= bounds[1]
    kept = f"range: {list(bounds)!r}, " if bounds and inside else ""
    return _tables(f"{{kind: {kind}, {kept}ref: {_quoted(ref)}}}")


def _written(
    tables: Any,
    file: str,
    wanted: Drive,
    model: Mapping[str, str | int] | None = None,
) -> str:
    """Return the text of tables, verified to give the wanted drive when it is read again.

    model: fields of numerics that are not verified, because the text may have other values already.
    """
    stream = StringIO()
    _editor().dump(tables, stream)
    text = stream.getvalue()
    loose = {f"numerics.{name}" for name in model or {}}
    with suppress(DataError):
        read = load_text(text, file)
        same = all(read.value(path) == wanted.value(path) for path in field_table() if path not in loose)
        if same and read.uncertainty == wanted.uncertainty:
            return text
    raise DataError(
        f"{file} cannot be changed automatically", "edit the file; hdassist presets new shows the usual layout"
    )


SCHEMA_FILE = "hdassist-preset.schema.json"  # schema file named in the first line of a new preset
_NUMBER_TEXT = {"type": "string", "pattern": rf"^\s*{NUMBER}"}  # text of a number with a unit or an uncertainty


def preset_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of presets: names, types, ranges, units and meanings of the fields.

    Only `hdassist presets validate` checks units within texts, keys of tables and rules between fields.
    """
    schema = _table_schema(Drive)
    fields = Drive.declared()
    properties = schema["properties"]
    for name, model in sections():  # an optional section may be empty
        schemas = [_table_schema(model)]
        if not fields[name].is_required:
            schemas.append({"type": "null"})
        properties[name] = {"anyOf": schemas}
    for name, paths, item in (
        ("uncertainty", measures(), _number_schema(fields["uncertainty"])),
        ("fit", measures(), {"type": "array", "items": _number_schema(fields["fit"])}),
        ("cost", deviation_sizes(), _table_schema(CostLaw)),
        ("source", field_table(), _table_schema(Source)),
    ):
        properties[name] = {"propertyNames": {"enum": [*paths]}, "type": "object", "additionalProperties": item}
    properties["schema"] = {"const": PRESET_SCHEMA, "description": "form of this file"}
    schema["required"].append("schema")
    return schema | {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "hdassist preset"}


def _table_schema(model: type[Section]) -> dict[str, Any]:
    """Return the schema of a table with the fields of a model."""
    fields = model.declared().items()
    return {
        "type": "object",
        "description": model.__doc__,
        "properties": {name: _field_schema(field) for name, field in fields},
        "required": [name for name, field in fields if field.is_required],
        "additionalProperties": False,
    }


def _field_schema(field: PresetField) -> dict[str, Any]:
    """Return the schema of a field with all accepted notations, such as text for a number or one item for a list."""
    number = _number_schema(field)
    text = {"type": "string"}
    table: Any = {"type": "object", "additionalProperties": _NUMBER_TEXT if field.kind == "readings" else number}
    several = table if field.kind in KEYED_TABLES else {"type": "array", "items": number}
    forms: Any = {
        "number": [number],
        "count": [number],
        "text": [text],
        "line": [text],
        "choice": [{"enum": [*field.choices]}],
        "range": [several | {"minItems": 2, "maxItems": 2}],
        "readings": [table],
        "holes": [{"const": "all"}, several, number],
    }.get(field.kind, [several, number])
    empty = []
    if field.is_optional:
        empty.append({"type": "null"})
    if field.unknown:
        empty.append({"const": UNKNOWN})
    default = {} if field.is_required else {"default": field.default}
    about = f"{field.meaning}{field.unit and f' [{field.unit}]'}"
    return {"description": about, "anyOf": [*forms, *empty]} | default


def _number_schema(field: PresetField) -> dict[str, Any]:
    """Return the schema of a single number of a field: its value, or one item of its list or table."""
    ends = {"minimum": field.ge, "exclusiveMinimum": field.gt, "maximum": field.le}
    limits = {name: end for name, end in ends.items() if isfinite(end)}
    return {"anyOf": [{"type": "integer" if field.kind in ("count", "holes") else "number"} | limits, _NUMBER_TEXT]}
