"""Preset text, with overrides on top, to a validated `Drive`: all findings at once, each with line and column."""

import hashlib
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from math import isfinite
from typing import Any

from hdassist.errors import Finding, PresetError, UsageError
from hdassist.model.rules import conflicts
from hdassist.plaintext import number_of
from hdassist.preset.fields import (
    BY_PATH,
    IDENTIFIED_WITH,
    KEYED_TABLES,
    PATH_TABLES,
    PRESET_SCHEMA,
    REMOVED,
    Drive,
    Origin,
    PresetField,
    Section,
    UncertainReading,
    deviation_sizes,
    field_table,
    measures,
    path_of,
    plain,
    sections,
)
from hdassist.preset.knowledge import COUPLING_FIELDS, SUPPORT_FIELD, implausible, with_cam_support
from hdassist.preset.library import read_preset
from hdassist.preset.units import is_spread, read_number, read_spread
from hdassist.preset.yamltext import (
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
    read_yaml,
    shown,
)

OVERRIDE_PLACE = re.compile(rf"^{OVERRIDE}:\d+:\d+: ", re.MULTILINE)  # in a message, of an override that nobody typed
PER_TORQUE = [tuple(path.split(".")) for path, field in field_table().items() if field.kind == "limits"]
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
    document = read_yaml(text, file)
    for index, override in enumerate(overrides, 1):
        set_override(document, override, index)
    drive = _drive(document)
    if document.findings or drive is None:
        findings = ordered_findings(document.findings)
        if not all(finding.file == OVERRIDE for finding in findings):
            own = read_yaml(text, file)
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
    own = replace(read.places.get(whole, SourceSpan(OVERRIDE, at_key, Mark(index, start + 1))), key=at_key)
    table, path = document.data, tuple[str | int, ...]()
    for part in whole[:-1] if isinstance(table, dict) else ():
        path, inner = (*path, part), table.get(part)
        if inner is not None and not isinstance(inner, dict):
            if path not in PER_TORQUE:
                message = f"{path_text(path)} is no table of keys"
                document.findings.append(Finding(OVERRIDE, *at_key, path_text(whole), message))
                return
            inner = {"all": inner}  # one entry on top of a bare number, which is the limit for all torques
            document.places[(*path, "all")] = document.places[path]
        document.places.setdefault(path, own)
        table[part] = table = {} if inner is None else inner
    if isinstance(table, dict):
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
    tables = _read_table(document, (), data, Drive)
    drive = Drive.model_validate(tables) if document.bad <= {("schema",)} else None
    if drive:  # the cam's support is that of its coupling: not given, or the coupling alone is on the command line
        fields = [tuple(path.split(".")) for path in (SUPPORT_FIELD, *COUPLING_FIELDS)]
        own, *tried = (path in document.places and document.is_override(path) for path in fields)
        if drive.supports.C_3 is None or (any(tried) and not own):
            drive = with_cam_support(drive)
    bad, valid = {path[:2] for path in document.bad}, dict[str, Any]()  # fields without a finding, by path
    for path, field in field_table().items():
        section, name = path.split(".")
        values = tables.get(section, {})
        if drive:
            valid[path] = drive.value(path)
        elif bad.isdisjoint({(section,), (section, name)}) and (name in values or not field.is_required):
            valid[path] = values.get(name, field.default)
    for conflict, involved in conflicts(valid):
        paths = [tuple(path.split(".", 2)) for path in (conflict.path, *involved)]
        place = next((p for p in paths if document.is_override(p)), paths[0])
        document.add(place, conflict.message, conflict.hint, conflict.got)
    _check_tables(drive.model_dump() if drive else tables, valid, document)
    return drive


def _settle_spreads(document: Document, data: dict[str, Any]) -> None:
    """Put uncertainties beside values ("260 ± 10") into their table; of two the one on the command line counts."""
    table = data.get("uncertainty", {})
    for path, field in measures().items() if isinstance(table, dict) else ():
        section, name = path.split(".")
        values = data.get(section)
        value = values.get(name) if isinstance(values, dict) else None
        if not isinstance(value, str) or not is_spread(value):
            continue
        with suppress(InvalidValueError):  # the value itself is refused
            spread = read_spread(value, field.unit)[1]
            own_wins, beside_wins = (document.is_override(p) for p in (("uncertainty", path), (section, name)))
            if path in table and beside_wins == own_wins:
                words = f"the value has an uncertainty of {spread:g} beside it"
                document.add(("uncertainty", path), "given twice", words)
            elif path not in table or beside_wins:
                data["uncertainty"] = table = table | {path: spread}


def _check_tables(tables: dict[str, Any], valid: dict[str, Any], document: Document) -> None:
    """An uncertainty needs a value, and a value lies in its plausible range; one on the command line is tried.

    All fields of a fit have equally many draws, of which the first is the value.
    """
    draws = tables.get("fit", {})
    counts = {path: len(values) for path, values in draws.items() if values}
    for path, count in counts.items():
        own, first, value = tuple(path.split(".")), next(iter(counts)), valid.get(path)
        if count != counts[first]:
            words = f"has {count} draws, {first} has {counts[first]}"
            document.add(("fit", path), words, "draw k of all fields is one drive")
        elif value is not None and value != draws[path][0] and not document.is_override(own):
            document.warn(
                own, f"{plain(value)} is not the first draw of its fit", "it is taken as it is, without a range"
            )
    for path in tables.get("uncertainty", ()):
        if path in valid and valid[path] is None:
            document.add(("uncertainty", path), "an uncertainty of a value that is not given", f"give {path} as well")
    for path, source in tables.get("source", {}).items():
        bounds, value = source.get("range"), valid.get(path)
        if not bounds or value is None or document.is_override(tuple(path.split("."))):
            continue
        if not bounds[0] <= value <= bounds[1]:
            words, ends = f"the value {plain(value)} lies outside its range", " to ".join(map(plain, bounds))
            document.add(("source", path, "range"), words, "correct one of them", ends)


def _read_table(document: Document, path: Path, table: Any, model: type[Section]) -> dict[str, Any]:
    """Values of the fields of a model that a table gives, each as the field holds it; faults are findings."""
    if not _is_table(document, path, table, model):
        return {}
    for key, value in table.items():
        if key not in model.model_fields and (*path, key) not in document.bad:
            hint = "" if len(document.findings) > MAX_FINDINGS else _unknown_hint((*path, key), value, model)
            document.add((*path, key), "unknown key", hint, "", key=True)
    read, classes = dict[str, Any](), dict(sections())
    for name, field in model.declared().items():
        place, section = (*path, name), classes.get(name)
        if name not in table:
            if field.is_required and section:
                needed = [name for name, each in section.declared().items() if each.is_required]
                document.add(place, "missing section", f"it needs {', '.join(needed)}", "")
            elif field.is_required:
                document.add(place, "missing key", f"{field.meaning}{field.unit and f', in {field.unit}'}", "")
        elif section:
            read[name] = _read_table(document, place, table[name], section)
        elif name in PATH_TABLES:
            read[name] = _read_by_path(document, name, table[name])
        elif field.kind == "range":
            read[name] = document.read(place, _read_range, str(path[1]), table[name])
        else:
            read[name] = _read_value(document, place, field, table[name])
    return read


def _is_table(document: Document, path: Path, table: Any, model: type[Section] | None) -> bool:
    """Whether a value is a table of keys, those of a model if any; a finding where it is not."""
    if path in document.bad:
        return False
    if not isinstance(table, dict):
        document.add(path, "must be a table of keys", f"its keys: {', '.join(model.model_fields)}" if model else "")
    return isinstance(table, dict)


def _read_by_path(document: Document, name: str, table: Any) -> dict[str, Any]:
    """Entries of the table "uncertainty", "fit", "cost" or "source"; faults are findings."""
    model, read = BY_PATH.get(name), dict[str, Any]()
    if not _is_table(document, (name,), table, model):
        return read
    known, words = {
        "uncertainty": (tuple(measures()), "names no field of a single number"),
        "fit": (tuple(measures()), "names no field of a single number"),
        "cost": (deviation_sizes(), "names no size of a deviation"),
        "source": (tuple(field_table()), "names no field"),
    }[name]
    for path, entry in table.items():
        place = (name, path)
        if path not in known:
            same = (each for each in known if each.split(".")[1] == path.split(".")[-1])
            hint = near_miss(next(same, path), known) or "write section.key, like gears.z_g"
            hint = f"like {known[0]}" if path in field_table() else hint * (len(table) <= MAX_FINDINGS)
            document.add(place, words, hint, shown(path) or "nothing", key=True)
        elif model:
            read[path] = _read_table(document, place, entry, model)
        elif name == "fit":
            read[path] = document.read(place, _read_draws, path, entry)
        else:
            read[path] = document.read(place, Drive.declared()[name].number, entry, measures()[path].unit)
    return read


def _read_range(path: str, bounds: Any) -> tuple[float, float] | None:
    """A plausible range of a field, by path, in its unit. Raises InvalidValueError: it is none."""
    field = field_table()[path]
    if bounds is None:
        return None
    if path not in measures():
        raise InvalidValueError("only single measures have a range")
    if not isinstance(bounds, list) or len(bounds) != 2:
        raise InvalidValueError("must be two numbers, the lower one first", "like [0, 20]")
    low, high = (read_number(bound, field.unit) for bound in bounds)
    if not (field.holds(low) and field.holds(high)):
        raise InvalidValueError(f"reaches beyond what the field takes: {field.range_words(field.unit)}")
    if low >= high:
        raise InvalidValueError("the lower one must stand first")
    return low, high


def _read_draws(path: str, draws: Any) -> tuple[float, ...]:
    """Equally likely values of a field, by path, in its unit. Raises InvalidValueError: they are none."""
    field = field_table()[path]
    if not isinstance(draws, list) or len(draws) < 2:
        raise InvalidValueError("must be two numbers or more, the preset's own value first", "like [8950, 9020]")
    found = tuple(read_number(draw, field.unit) for draw in draws)
    if beyond := [value for value in found if not field.holds(value)]:
        raise InvalidValueError(f"{plain(beyond[0])} is out of range: {field.range_words(field.unit)}")
    return found


def _read_value(document: Document, path: Path, field: PresetField, value: Any) -> Any:
    """The value of a field as the field holds it, None where it cannot be read; faults are findings."""
    found, kind = document.read(path, field.read, value), field.kind
    if isinstance(found, list):
        return tuple(document.read((*path, index), field.number, item) for index, item in enumerate(found))
    if not isinstance(found, dict):
        return found
    pattern, expected, like_key, _ = KEYED_TABLES[kind]
    known = set[tuple[object, ...]]()

    def read(key: str, item: Any) -> float | UncertainReading:
        numbers = [number_of(part.removeprefix("h")) for part in key.split("@")]
        meant = (key[:1] if kind == "readings" and key[:1] == "h" else "", *numbers)
        fits = re.fullmatch(pattern, key) and all(map(isfinite, numbers))
        if not (fits and all(numbers[kind == "readings" :])) and (kind, key) != ("limits", "all"):
            raise InvalidValueError(f"must be {expected}", like_key, at_key=True)
        if meant in known:
            raise InvalidValueError("given twice", at_key=True)
        known.add(meant)
        return field.reading(item) if kind == "readings" else field.number(item)

    return {key: document.read((*path, key), read, key, item) for key, item in found.items()}


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
    for section, name in PER_TORQUE:
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
