"""`hdassist presets`: the library of drives, and what a preset really says."""

from __future__ import annotations

import json as json_text
import re
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hdassist.errors import HdassistError, PresetError
from hdassist.terminal import options as o
from hdassist.version import __version__

if TYPE_CHECKING:
    from rich.table import Table

    from hdassist.preset.fields import Drive
    from hdassist.terminal.output import Output

app = typer.Typer(help="Presets: list, show, check and start them.", no_args_is_help=True, rich_markup_mode=None)

LAST_COLUMN = 16  # least width of a column of text

Resolved = Annotated[bool, typer.Option("--resolved", help="Every value that is really used, and where it comes from.")]


@app.command("list")
def list_(
    json: o.Json = False,
    ascii: o.Ascii = False,
    no_color: o.NoColor = False,
    debug: o.Debug = False,  # noqa: ARG001
) -> None:
    """Presets that come with hdassist.

    \b
    Examples:
      hdassist presets list
      hdassist presets list --json
    """
    from hdassist.preset.library import load_preset, preset_names

    drives = [(name, load_preset(name)) for name in preset_names()]
    if json:
        presets = [
            {
                "preset": _preset(drive),
                "z_g": drive.gears.z_g,
                "z_b": drive.gears.z_b,
                "m_mm": drive.gears.m,
                "description": drive.description,
            }
            for _, drive in drives
        ]
        _print_json(_envelope("presets-list", 0) | {"presets": presets})
        return
    rows = [
        (name, f"{d.gears.z_g}/{d.gears.z_b}", f"{d.gears.m!r} mm", _first_sentence(d.description))
        for name, d in drives
    ]
    _print_table(("name", "teeth", "module", "description"), rows, ascii, no_color)


@app.command()
def show(
    preset: o.Preset,
    resolved: Resolved = False,
    overrides: o.Overrides = [],  # noqa: B006 (typer copies it)
    json: o.Json = False,
    ascii: o.Ascii = False,
    no_color: o.NoColor = False,
    debug: o.Debug = False,  # noqa: ARG001 (main reads it)
) -> None:
    """A preset as it is written, or every value that is really used.

    \b
    Examples:
      hdassist presets show vzp160 > my-drive.yaml
      hdassist presets show vzp160 --resolved
      hdassist presets show my-drive.yaml --set cam.W_0=0.95 --resolved

    Origins: given, assumed, identified (from the preset's `source`), default (left out), override (--set).
    --json and --set imply --resolved.
    """
    from hdassist.preset.library import load_preset, read_preset
    from hdassist.terminal.output import warn

    if not (resolved or json or overrides):
        sys.stdout.buffer.write(read_preset(preset)[0])
        sys.stdout.buffer.flush()
        return
    from hdassist.preset.resolved import resolved as rows_of

    drive = load_preset(preset, overrides)
    rows = rows_of(drive)
    if json:
        fields = [asdict(row) for row in rows]
        answer = _envelope("presets-show", 0, drive) | {"description": drive.description, "fields": fields}
        _print_json(answer)
    else:
        cells = [(row.path, _value(row.value), row.unit, row.kind, row.ref) for row in rows]
        _print_table(("field", "value", "unit", "origin", "reference"), cells, ascii, no_color)
    for warning in drive.origin.warnings:
        warn(warning)


@app.command()
def validate(
    presets: o.Presets,
    overrides: o.Overrides = [],  # noqa: B006 (typer copies it)
    json: o.Json = False,
    debug: o.Debug = False,  # noqa: ARG001 (main reads it)
) -> None:
    """Check presets: everything that is wrong with each, at once.

    \b
    Examples:
      hdassist presets validate my-drive.yaml
      hdassist presets validate *.yaml --json

    Exit codes: 0 all are valid, 4 one is not, 2 a bad --set.
    """
    from hdassist.preset.library import load_preset
    from hdassist.terminal.output import complain, warn

    answers = []
    for name in presets:
        try:
            drive = load_preset(name, overrides)
        except HdassistError as error:
            answers.append(_invalid(name, error))
            if not json:
                complain(error)
                _print(f"{name}: invalid\n")
            continue
        answers.append(_envelope("presets-validate", 0, drive) | {"file": name, "valid": True, "findings": []})
        if not json:
            _print(f"{name}: OK\n")
            for warning in drive.origin.warnings:
                warn(warning)
    exit_code = max(answer["exit_code"] for answer in answers)  # of 0, 2 and 4 the greatest is the worst
    if json:
        several = _envelope("presets-validate", exit_code) | {"results": answers}
        _print_json(answers[0] if len(answers) == 1 else several)
    raise typer.Exit(exit_code)


@app.command()
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the drive.")],
    output: o.Target = "-",
    force: o.Force = False,
    debug: o.Debug = False,  # noqa: ARG001 (main reads it)
) -> None:
    """A commented preset to start from; its numbers are examples.

    \b
    Examples:
      hdassist presets new my-drive -o my-drive.yaml
    """
    from hdassist.preset.write import new_preset
    from hdassist.terminal.files import write_text

    write_text("-" if output is None else output, new_preset(name), force)


@app.command()
def schema(
    output: o.Target = "-",
    force: o.Force = False,
    debug: o.Debug = False,  # noqa: ARG001 (main reads it)
) -> None:
    """JSON Schema of presets, for editors that complete and check YAML.

    \b
    Examples:
      hdassist presets schema -o preset.schema.json
    """
    from hdassist.preset.schema import preset_schema
    from hdassist.terminal.files import write_text

    write_text("-" if output is None else output, _json(preset_schema()), force)


def _preset(drive: Drive) -> dict[str, Any]:
    origin = drive.origin
    return {"name": drive.name, "sha256": origin.sha256, "overrides": list(origin.overrides)}


def _envelope(command: str, exit_code: int, drive: Drive | None = None) -> dict[str, Any]:
    return {
        "schema": f"hdassist.{command}/1",
        "version": __version__,
        **({} if drive is None else {"preset": _preset(drive)}),
        "exit_code": exit_code,
        "warnings": [] if drive is None else list(drive.origin.warnings),
    }


def _invalid(name: str, error: HdassistError) -> dict[str, Any]:
    findings = [asdict(finding) for finding in error.findings] if isinstance(error, PresetError) else []
    return _envelope("presets-validate", error.exit_code) | {
        "preset": {"name": name, "sha256": None},
        "file": name,
        "valid": False,
        "findings": findings,
        "error": {"message": error.message, "hint": error.hint},
    }


def _json(answer: dict[str, Any]) -> str:
    return json_text.dumps(answer, indent=2, allow_nan=False) + "\n"


def _print(text: str) -> None:
    from hdassist.terminal.console import Style

    sys.stdout.write(Style.of(sys.stdout).text(text))
    sys.stdout.flush()  # before anything on standard error that belongs behind it


def _print_json(answer: dict[str, Any]) -> None:
    sys.stdout.write(_json(answer))


def _print_table(head: Sequence[str], rows: Sequence[Sequence[str]], ascii: bool, no_color: bool) -> None:
    """Print a table whose last column may wrap; nothing else is ever cut.

    In a pipe it takes the width it needs; on a terminal too narrow for its last column it does without.
    """
    from rich.measure import Measurement

    from hdassist.terminal.console import console
    from hdassist.terminal.output import Output, note

    out = Output.open(ascii=ascii, no_color=no_color)
    grid = _table(out, head, rows)
    wide = console(sys.stdout, replace(out.style, width=10_000))
    need = Measurement.get(wide, wide.options, grid)
    if not sys.stdout.isatty():
        out = replace(out, style=replace(out.style, width=need.maximum))
    elif need.minimum > out.style.width:
        grid = _table(out, head[:-1], [row[:-1] for row in rows])
        note(f"the column {head[-1]!r} needs a wider terminal, or a pipe")
    out.human(grid)


def _table(out: Output, head: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    from rich.text import Text

    from hdassist.terminal.console import table

    grid = table(out.style)
    for column, title in enumerate(head):
        words = [len(word) for row in rows for word in row[column].split()]
        last = title in ("description", "reference")
        wraps = last or title == "value"  # a list of numbers wraps between its numbers
        grid.add_column(title, no_wrap=not wraps, overflow="fold", min_width=LAST_COLUMN if last else max([0, *words]))
    for row in rows:
        grid.add_row(*(Text(out.style.text(cell)) for cell in row))
    return grid


def _value(value: Any) -> str:
    """A value with every digit it has."""
    if value is None:
        return "-"
    if isinstance(value, tuple):
        return ", ".join(map(_value, value))
    if isinstance(value, dict):
        return ", ".join(f"{key}: {_value(item)}" for key, item in value.items()) or "-"
    return repr(value).removesuffix(".0") if isinstance(value, float) else str(value)


def _first_sentence(text: str) -> str:
    found = re.match(r"(.*?[.!?])(\s|$)", text, re.DOTALL)
    return " ".join((found[1] if found else text).split())
