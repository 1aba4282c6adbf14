"""Preset text, with overrides on top, to a validated `Drive`: all findings at once, each with line and column."""

import hashlib
import re
from collections.abc import Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import replace
from functools import lru_cache
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from hdassist.errors import Finding, PresetError, UsageError
from hdassist.model.rules import conflicts
from hdassist.preset.fields import (
    BY_PATH,
    IDENTIFIED_WITH,
    PATH_TABLES,
    PRESET_SCHEMA,
    REMOVED,
    Drive,
    Origin,
    Section,
    deviation_sizes,
    field_table,
    measures,
    path_of,
    plain,
    sections,
)
from hdassist.preset.knowledge import COUPLING_FIELDS, SUPPORT_FIELD, implausible, with_cam_support
from hdassist.preset.library import read_preset
from hdassist.preset.text import (
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
    shown,
)

OVERRIDE_PLACE = re.compile(rf"^{OVERRIDE}:\d+:\d+: ", re.MULTILINE)  # in a message, of an override that nobody typed
_PER_TORQUE = [tuple(path.split(".")) for path, field in field_table().items() if field.kind == "limits"]
Asked = tuple[tuple[str, str], ...]  # options by name, which the next command on a drive is to have too


def load_preset(name_or_path: str, overrides: Sequence[str] = (), asked: Asked = ()) -> Drive:
    """Load a drive.

    Arguments: a name from the library, a path, or "-" for standard input; overrides like "cam.W_0=0.95"; asked, options
    that go into its origin.
    Raises DataError: no such preset, or a file that cannot be read; PresetError: an invalid preset;
    UsageError: a bad override.
    """
    text, file = read_preset(name_or_path)
    return load_text(text, file, overrides, asked)


def load_text(text: bytes | str, file: str, overrides: Sequence[str] = (), asked: Asked = ()) -> Drive:
    """Read and validate a preset.

    Arguments: text of the preset; file, its name in messages; overrides, such as "cam.W_0=0.95"; asked, options that go
    into its origin. Result: the drive; its origin carries the SHA-256 of the text, the overrides and the warnings.
    Raises PresetError with every finding; UsageError if the text is in order and only the overrides are not.
    """
    document = _document(text, file)
    for index, override in enumerate(overrides, 1):
        set_override(document, override, index)
    drive = _drive(document)
    if document.findings or drive is None:
        findings = ordered_findings(document.findings)
        if not all(finding.file == OVERRIDE for finding in findings):
            own = _document(text, file)
            if not overrides or not _drive(own) or own.findings:
                raise PresetError(findings)
        raise UsageError("\n".join(map(str, findings)))
    _warn_of_limits(drive, document)
    _warn_of_model(drive, document)
    for path, message, usual in implausible(drive):
        document.warn(tuple(path.split(".")), message, usual)
    data = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    drive._origin = Origin(
        file=file,
        sha256=hashlib.sha256(data).hexdigest(),
        overrides=tuple(overrides),
        warnings=tuple(map(str, ordered_findings(document.warnings))),
        asked=asked,
    )
    return drive


_parsed = lru_cache(maxsize=4)(read_yaml)  # a sweep, a lot and the explorer load one text again and again


def _document(text: bytes | str, file: str) -> Document:
    """The document of a preset's text, which overrides and findings may change."""
    read = _parsed(text, file)
    return replace(
        read, data=deepcopy(read.data), places={**read.places}, findings=[*read.findings], bad={*read.bad}, warnings=[]
    )


def set_override(document: Document, text: str, index: int) -> None:
    """Put an override "section.key=VALUE" on top of a document.

    Arguments: text; index, its number from 1, which findings bear as their line.
    Raises UsageError: no "=", a key that is empty or has hidden characters, or a value that is no YAML.
    """
    key, equals, value = text.partition("=")
    whole = path_of(key)
    if not equals or not all(whole) or not key.strip().isprintable():  # YAML has no such keys either
        raise UsageError(
            f"{OVERRIDE}:{index}:1: not of the form section.key=VALUE (got {shown(text) or 'nothing'})",
            f"like {OVERRIDE} gears.j_n=6",
        )
    at_key, start = Mark(index, 1), len(key) + 1
    read = read_yaml(value, OVERRIDE, whole, lambda line, column: Mark(index, (column if line == 1 else 1) + start))
    if read.findings:
        raise UsageError("\n".join(map(str, read.findings)))
    if not isinstance(table := document.data, dict):
        return
    own = replace(read.places.get(whole, SourceSpan(OVERRIDE, at_key, Mark(index, start + 1))), key=at_key)
    for end, part in enumerate(whole[:-1], 1):
        path, inner = whole[:end], table.get(part)
        if inner is not None and not isinstance(inner, dict):
            if path not in _PER_TORQUE:
                message = f"{path_text(path)} is no table of keys"
                document.findings.append(Finding(OVERRIDE, *at_key, path_text(whole), message))
                return
            inner = {"all": inner}  # one entry on top of a bare number, which is the limit for all torques
            document.places[(*path, "all")] = document.places[path]
        document.places.setdefault(path, own)
        table[part] = table = inner or {}
    table[whole[-1]] = read.data
    kept = {path: place for path, place in document.places.items() if path[: len(whole)] != whole}
    document.places = kept | read.places | {whole: own}
    document.bad = {path for path in document.bad if path[: len(whole)] != whole}


def _drive(document: Document) -> Drive | None:
    """The drive of a document, None where there is none; faults are added to its findings."""
    if () in document.bad:
        return None
    if not isinstance(document.data, dict):
        message = "the preset is empty" if document.data is None else "a preset must be a table of keys"
        got = "" if document.data is None else None
        document.add((), message, "hdassist presets new NAME prints one to start from", got)
        return None
    data = {key: value for key, value in document.data.items() if value is not None or (key,) in document.bad}
    if "schema" not in data:
        document.add(("schema",), "missing key", f"write schema: {PRESET_SCHEMA}")
    elif data.pop("schema") != PRESET_SCHEMA and ("schema",) not in document.bad:
        document.add(("schema",), f"must be {PRESET_SCHEMA}")
    _settle_spreads(document, data)
    data |= {name: _known_paths(document, name, data[name]) for name in PATH_TABLES if isinstance(data.get(name), dict)}
    values, drive = dict[str, Any](), None  # values that hold, by path
    try:
        drive = Drive.model_validate(data, context=values)
    except ValidationError as error:
        for fault in error.errors(include_url=False):
            _add_fault(document, fault)
    bad = {path_text(path[:2]) for path in document.bad}
    for path, field in field_table().items():
        if not field.is_required and bad.isdisjoint((path, path.split(".")[0])):
            values.setdefault(path, field.default)
    if drive:  # the cam's support is that of its coupling: not given, or the coupling alone is on the command line
        fields = [tuple(path.split(".")) for path in (SUPPORT_FIELD, *COUPLING_FIELDS)]
        own, *tried = (path in document.places and document.is_override(path) for path in fields)
        if drive.supports.C_3 is None or (any(tried) and not own):
            drive = with_cam_support(drive)
            values |= {SUPPORT_FIELD: drive.supports.C_3, "drive.source": drive.source}
    for conflict, involved in conflicts({path: values[path] for path in field_table() if path in values}):
        paths = [tuple(path.split(".", 2)) for path in (conflict.path, *involved)]
        place = next((p for p in paths if document.is_override(p)), paths[0])
        document.add(place, conflict.message, conflict.hint, conflict.got)
    _check_tables(values, document)
    return drive


def _settle_spreads(document: Document, data: dict[str, Any]) -> None:
    """Put uncertainties beside values ("260 ± 10") into their table; of two the one on the command line counts."""
    table = data.get("uncertainty", {})
    for path, field in measures().items() if isinstance(table, dict) else ():
        own, beside = ("uncertainty", path), tuple(path.split("."))
        with suppress(KeyError, InvalidValueError):  # not given, none beside the value, or refused with it
            spread = read_spread(document.places[beside].text, field.unit)[1]
            own_wins, beside_wins = document.is_override(own), document.is_override(beside)
            if path in table and beside_wins == own_wins:
                document.add(own, "given twice", f"the value has an uncertainty of {spread:g} beside it")
            elif path not in table or beside_wins:
                data["uncertainty"] = table = table | {path: spread}


def _check_tables(values: dict[str, Any], document: Document) -> None:
    """An uncertainty needs a value, and a value lies in its plausible range; one on the command line is tried.

    All fields of a fit have equally many draws, of which the first is the value.
    """
    draws: dict[str, Any] = values.get("drive.fit", {})
    first = next(iter(draws), "")
    for path, each in draws.items():
        own, value = tuple(path.split(".")), values.get(path)
        if len(each) != len(draws[first]):
            words = f"has {len(each)} draws, {first} has {len(draws[first])}"
            document.add(("fit", path), words, "draw k of all fields is one drive")
        elif value is not None and value != each[0] and not document.is_override(own):
            document.warn(
                own, f"{plain(value)} is not the first draw of its fit", "it is taken as it is, without a range"
            )
    for path in values.get("drive.uncertainty", ()):
        if path in values and values[path] is None:
            document.add(("uncertainty", path), "an uncertainty of a value that is not given", f"give {path} as well")
    for path, source in values.get("drive.source", {}).items():
        bounds, value = source.range, values.get(path)
        if not bounds or value is None or document.is_override(tuple(path.split("."))):
            continue
        if not bounds[0] <= value <= bounds[1]:
            words, ends = f"the value {plain(value)} lies outside its range", " to ".join(map(plain, bounds))
            document.add(("source", path, "range"), words, "correct one of them", ends)


def _known_paths(document: Document, name: str, table: dict[str, Any]) -> dict[str, Any]:
    """Entries of a table by paths of fields whose path it takes; the others are findings."""
    known, words = {
        "cost": (tuple(deviation_sizes()), "names no size of a deviation"),
        "source": (tuple(field_table()), "names no field"),
    }.get(name, (tuple(measures()), "names no field of a single number"))
    for path in table.keys() - {*known}:
        hint = f"like {known[0]}" if path in field_table() else "write section.key, like gears.z_g"
        if path not in field_table() and len(document.findings) <= MAX_FINDINGS:
            same = (each for each in known if each.split(".")[1] == path.split(".")[-1])
            hint = near_miss(next(same, path), known) or hint
        document.add((name, path), words, hint, shown(path) or "nothing", key=True)
    return {path: entry for path, entry in table.items() if path in known}


def _add_fault(document: Document, fault: ErrorDetails) -> None:
    """Add the finding on a fault of validation; none on a value that has one already."""
    path, error = fault["loc"], fault.get("ctx", {}).get("error")
    if path in document.bad:
        return
    own, is_short = {**dict(sections()), **BY_PATH}.get(str(path[0])), len(document.findings) <= MAX_FINDINGS
    model = own if own and len(path) > 1 else Drive
    if isinstance(error, InvalidValueError):
        document.refuse(path, error)
    elif fault["type"] == "extra_forbidden":
        document.add(path, "unknown key", _unknown_hint(path, fault["input"], model) if is_short else "", "", key=True)
    elif fault["type"] != "missing":
        document.add(path, "must be a table of keys", f"its keys: {', '.join(own.model_fields)}" if own else "")
    elif own and model is Drive:
        needed = [name for name, field in own.declared().items() if field.is_required]
        document.add(path, "missing section", f"it needs {', '.join(needed)}", "")
    else:
        field = model.declared()[str(path[-1])]
        document.add(path, "missing key", f"{field.meaning}{field.unit and f', in {field.unit}'}", "")


def _unknown_hint(path: Path, value: Any, model: type[Section]) -> str:
    """A hint for an unknown key of a table, whose keys are the fields of a model."""
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
    options = ["schema"] * (model is Drive) + list(model.model_fields)
    return near_miss(key, options) or f"known: {', '.join(options)}"


def _warn_of_limits(drive: Drive, document: Document) -> None:
    """Warn of limits at torques that are not computed; those of a file may be more than the torques of one run."""
    narrowed = document.is_override(("operation", "M_g"))
    torques = shown(", ".join(map(plain, drive.operation.M_g[:20])))
    message = "a limit for a torque that is not in operation.M_g: accept looks at it, check does not"
    for section, name in _PER_TORQUE:
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
