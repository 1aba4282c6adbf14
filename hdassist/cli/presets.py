"""`hdassist presets`: the library of drives, and the values of a preset."""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import typer

from hdassist.cli.help import Command, Commands
from hdassist.errors import HdassistError, PresetError, UsageError
from hdassist.terminal import options as o

if TYPE_CHECKING:
    from hdassist.json_parts import Json

presets_app = typer.Typer(
    name="presets",
    cls=Commands,
    help="Presets: list, show, check and start them.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
)

VALIDATE = "presets-validate"
PIPED_COLUMNS = 10_000  # whoever reads a pipe has the room that a table needs


@presets_app.command("list", cls=Command)
@dataclass(frozen=True, kw_only=True)
class PresetsListCommand(o.PageOptions):
    """Presets that come with hdassist.

    \b
    Examples:
      hdassist presets list
      hdassist presets list --json

    What each rests on: how many of its values are given, identified from measurements, or only assumed.
    """

    def report(self, _out: o.Output, _preset: str) -> o.Report:
        """The presets."""
        from hdassist.loading.load import load_preset
        from hdassist.model.kinematics import Kinematics
        from hdassist.preset.fields import origin_counts, plain
        from hdassist.preset.library import preset_names
        from hdassist.report import NO_VALUE, Report, Table
        from hdassist.terminal.answers import envelope

        rows, values = [], []
        for name in preset_names():
            drive = load_preset(name)
            gears, counts = drive.gears, origin_counts(drive)
            sizes = {
                "ratio": abs(Kinematics.of(drive).u),
                "pitch_diameter_mm": gears.pitch_diameter,
                "rated_Nm": drive.operation.rated,
            }
            about = {"z_g": gears.z_g, "z_b": gears.z_b, "m_mm": gears.m, **sizes, "values": counts}
            known = envelope("presets-list", drive)["preset"]
            values.append({"preset": known, **about, "description": drive.description})
            numbers = (NO_VALUE if each is None else plain(each) for each in sizes.values())
            rows.append((name, *numbers, ", ".join(map(str, counts.values()))))
        heads = ("preset", "ratio", "mm", "N·m", "values")
        title = "pitch diameter, rated torque; values given, identified, assumed"
        table = Table(title, heads, tuple(rows))
        return Report("presets-list", None, "presets of hdassist", blocks=(table,), values={"presets": values})


@presets_app.command("show", cls=Command)
@dataclass(frozen=True, kw_only=True)
class PresetsShowCommand(o.PageOptions, o.DriveOptions):
    """A preset as it is written, or every value that is really used.

    \b
    Examples:
      hdassist presets show vzp160 > my-drive.yaml
      hdassist presets show vzp160 --resolved
      hdassist presets show my-drive.yaml --set cam.W_0=0.95 --resolved

    Origins: given, assumed, identified (from the preset's `source`), default (left out), override (--set).
    --json and --set imply --resolved.
    """

    preset: str
    resolved: bool = False

    def open(self) -> o.Output:
        """As of other commands, with the room for a table in a pipe."""
        out = super().open()
        return out if sys.stdout.isatty() else replace(out, style=replace(out.style, width=PIPED_COLUMNS))

    def run(self) -> int:
        """Show the preset; returns the exit code."""
        from hdassist.preset.library import read_preset
        from hdassist.terminal.files import give_stdout

        if self.resolved or self.json or self.overrides:
            return super().run()
        out, text = self.open(), read_preset(self.preset)[0]
        if sys.stdout.isatty() or self.output != "-":
            out.text(text.decode("utf-8", "backslashreplace"))
        else:
            give_stdout(text)
        return 0

    def report(self, _out: o.Output, preset: str) -> o.Report:
        """All values of the preset."""
        from hdassist.preset.fields import resolved_fields, value_text
        from hdassist.report import Report, Table

        drive = self.load(preset)
        rows = resolved_fields(drive)
        cells = tuple((row.path, value_text(row.value), row.unit, row.kind, row.reference) for row in rows)
        heads = ("field", "value", "unit", "origin", "reference")
        return Report(
            "presets-show", drive, drive.name, blocks=(Table("", heads, cells, words=range(len(heads))),),
            values={"description": drive.description, "fields": list(map(asdict, rows))},
            warnings=drive.origin.warnings,
        )  # fmt: skip


@presets_app.command("validate", cls=Command)
@dataclass(frozen=True, kw_only=True)
class PresetsValidateCommand(o.AnswerOptions, o.DriveOptions):
    """Check presets: everything that is wrong with each, at once, and how much of it is still assumed.

    \b
    Examples:
      hdassist presets validate my-drive.yaml
      hdassist presets validate *.yaml --json

    Exit codes: 0 all are valid, 4 one is not, 2 only a --set is bad.
    """

    presets: list[str]

    def run(self) -> int:
        """Validate the presets; returns the exit code."""
        from hdassist.terminal.runs import give, run_each

        out = self.open()
        reports = run_each(VALIDATE, self.presets, self._report, self, failed=_invalid, keep_failures=True)
        return give(VALIDATE, reports, replace(self, quiet=True), out)

    def _report(self, name: str) -> o.Report:
        """The verdict on a preset, which a bad --set has too. Raises all other errors of loading it."""
        from hdassist.preset.fields import origin_counts
        from hdassist.report import Report
        from hdassist.terminal.output import complain

        try:
            drive = self.load(name)
        except UsageError as error:
            complain(error, name)
            return Report(VALIDATE, None, "", values=_invalid(name, error), exit_code=error.exit_code)
        values = origin_counts(drive)
        verdict = f"OK, {values['assumed']} values still assumed" if values["assumed"] else "OK"
        found = {"file": name, "valid": True, "values": values, "findings": []}
        line, warnings = f"{name}: {verdict}", drive.origin.warnings
        return Report(VALIDATE, drive, name, verdict, values=found, line=line, about=name, warnings=warnings)


def _invalid(name: str, error: HdassistError) -> Json:
    """The answer about a preset that is not valid."""
    from hdassist.terminal.answers import failure

    findings = [asdict(finding) for finding in error.findings] if isinstance(error, PresetError) else []
    return failure(VALIDATE, error, preset=name) | {"file": name, "valid": False, "findings": findings}


@dataclass(frozen=True, kw_only=True)
class WishOptions(o.OptionGroup):
    """Known data of a new drive."""

    like: str = "vzp160"
    coupling: str | None = None
    shaft: str | None = None
    pitch_diameter: str | None = None
    teeth: str | None = None
    ratio: float | None = None
    torque: str | None = None
    stiffness: str | None = None
    lost_motion: str | None = None
    accuracy: str | None = None


@presets_app.command("schema", cls=Command)
@dataclass(frozen=True, kw_only=True)
class PresetsSchemaCommand(o.OptionGroup):
    """JSON Schema of presets, for editors that complete and check YAML.

    \b
    Examples:
      hdassist presets schema -o hdassist-preset.schema.json

    The second line of a preset by presets new names that file, for editors with a YAML language server. Units within
    texts, and rules between fields, are checked by presets validate alone.
    """

    output: str = "-"
    force: bool = False
    debug: bool = False

    def run(self) -> int:
        """Write the schema; returns the exit code."""
        from hdassist.loading.write import preset_schema
        from hdassist.terminal.answers import json_text
        from hdassist.terminal.files import write_text

        write_text(self.output, json_text(preset_schema()), self.force)
        return 0


@presets_app.command("new", cls=Command)
@dataclass(frozen=True, kw_only=True)
class PresetsNewCommand(WishOptions):
    """A whole preset of a drive like another one; without options, that of vzp160 with every value to be replaced.

    \b
    Examples:
      hdassist presets new own --coupling oldham --ratio 100 --torque 67
      hdassist presets new own --coupling overhung --shaft 14x30 --ratio 100
      hdassist presets new own --like vzp160 --pitch-diameter 63 --teeth 160/162
      hdassist presets new own --ratio 100 --stiffness 3.1e4,5e4,5.7e4
      hdassist presets new own --ratio 100 --torque 67 --lost-motion '1 arcmin'
      hdassist presets new my-drive -o my-drive.yaml

    --coupling first: it says how far offsets of the cam are felt, and so how much turning the wheel can bring. oldham:
    the wave generator floats on an Oldham coupling; solid: it is one piece with its hub; overhung: it sits on the end
    of a motor's shaft.
    A value that is not given grows with the size of the other drive, is marked as assumed, and has its plausible range.
    The size is --pitch-diameter, else that of K3 by the cube law of catalogues, else that of --torque by the cube law.
    --stiffness, --lost-motion and --accuracy stand in the preset's table catalogue as they are given: evidence by which
    check weighs assumed values.
    """

    output: str = "-"
    force: bool = False
    debug: bool = False
    name: str

    def run(self) -> int:
        """Write the preset; returns the exit code."""
        from hdassist.loading.load import load_preset
        from hdassist.loading.write import similar_preset
        from hdassist.preset.similarity import read_requirements
        from hdassist.terminal.files import write_text

        wish = asdict(self.only(WishOptions))
        other = load_preset(wish.pop("like"))
        given = read_requirements(other, **wish)
        write_text(self.output, similar_preset(self.name, other, given), self.force)
        return 0
