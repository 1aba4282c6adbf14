"""Commands for presets and for the tool itself: calibrate, presets, doctor, explain."""

from __future__ import annotations

import platform
import re
import sys
from collections.abc import Iterator
from dataclasses import asdict, astuple, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from hdassist import __version__
from hdassist.features.report import NO_VALUE, Report, Table
from hdassist.interface.terminal import options as o
from hdassist.interface.terminal.output import Output, complain, envelope, failure, give, json_text, run_each
from hdassist.interface.terminal.streams import Style, give_stdout, write_text
from hdassist.run.errors import HdassistError, PresetError, UntrustedError, UsageError
from hdassist.run.files import read_bytes
from hdassist.run.run import UNCHECKED, count

if TYPE_CHECKING:
    from hdassist.features.report import Json


class CalibrateCommand(o.AnswerOptions, o.DriveOptions):
    """Fit stiffnesses, clearances or other fields of a preset to measured values of the drive.

    \b
    Examples:
      hdassist calibrate own.yaml --targets rig.yaml --write found.yaml

    \b
    A targets file:
      schema: hdassist.targets/1
      name: acceptance rig, drive 17
      unknowns:
        gears.j_n: {low: 0, high: 20}
        supports.C_2:     # within its range in the preset's source
      targets:
        - {quantity: F_ior, M_g: 80, phase: 180, value: 20.1, tolerance: 0.5}
        - {quantity: K_1, value: 50e4, tolerance: 10 %}
        - {quantity: self_error, M_g: 80, low: 0.25, high: 2.0}

    Quantities: F_ior, F_ior_max and F_ior_min (over the mounting phase), self_error, K_1, K_2, K_3 and lost_motion (as
    in hdassist stiffness). The fit starts from drives spread evenly over the bounds and refines the best separate ones
    by least squares. Every set of values that meets the targets is kept. If no set meets them, the page names the
    missed targets and the bounds that limit the fit, and --write writes no file. Exit codes: 0 all targets are met, 3 a
    target is missed, 5 the fit did not converge.
    """

    preset: str
    targets: Path
    write: str | None = None
    evaluations: int = 128
    seed: int = 0
    jobs: int = 0
    details: bool = False
    beside = ("write",)

    def _require_writable(self, preset: str) -> None:
        """Raise UsageError if --write is given for a preset that is not a file, or that --set changes."""
        if self.write is not None and (preset == "-" or self.overrides):
            message = "--write changes a preset file, so it cannot be combined with standard input or --set"
            raise UsageError(message, "name the preset file, and leave out --set")

    def report(self, out: Output, preset: str) -> Report:
        """Return the report of a calibration, and write the preset with the fitted values if requested."""
        from hdassist.drive.loading import with_found_values
        from hdassist.drive.preset.fields import IDENTIFIED_WITH
        from hdassist.features.calibration import calibrate, estimate_drives, read_targets
        from hdassist.interface.pages.data import calibrate_report
        from hdassist.run.files import READ_AT_MOST, read_preset

        o.stdin_once(preset, str(self.targets))
        self._require_writable(preset)
        drive = self.load(preset)
        wanted = read_targets(read_bytes(self.targets, READ_AT_MOST)[0], str(self.targets), drive)
        preset_text = read_preset(preset)[0].decode("utf-8-sig") if self.write is not None else ""
        if self.write is not None:
            # a text that cannot be changed is refused before the search, which takes minutes
            lowest = {unknown.path: unknown.low for unknown in wanted.unknowns}
            with_found_values(preset_text, preset, lowest, "")
        with out.run(drive.name, estimate_drives(wanted, self.evaluations), self) as run:
            result = calibrate(
                drive,
                wanted,
                points=self.evaluations,
                run=run,
            )
        if self.write is not None and not result.shortfall:
            best = wanted.by_path(result.fits[0].values)
            ref = f"hdassist calibrate, {wanted.name or self.targets.name}"
            model = {field: drive.value(f"numerics.{field}") for field in IDENTIFIED_WITH}
            write_text(self.write, with_found_values(preset_text, preset, best, ref, model), self.force)
        return calibrate_report(result, self.write)


_VALIDATE = "presets-validate"
_PIPED_COLUMNS = 10_000  # width of a table in a pipe, where lines need not be broken


class PresetsListCommand(o.PageOptions):
    """Presets supplied with hdassist.

    \b
    Examples:
      hdassist presets list
      hdassist presets list --json

    The table gives the number of values of each preset that are given, identified from measurements, or assumed.
    """

    def report(self, _out: Output, _preset: str) -> Report:
        """Return the report that lists the presets."""
        from hdassist.drive.loading import load_preset
        from hdassist.drive.model.geometry import Kinematics
        from hdassist.drive.preset.fields import origin_counts, plain
        from hdassist.run.files import preset_names

        rows = []
        values = []
        for name in preset_names():
            drive = load_preset(name)
            gears = drive.gears
            counts = origin_counts(drive)
            sizes = {
                "ratio": abs(Kinematics.of(drive).u),
                "pitch_diameter_mm": gears.pitch_diameter,
                "rated_Nm": drive.operation.rated,
            }
            about = {"z_g": gears.z_g, "z_b": gears.z_b, "m_mm": gears.m, **sizes, "values": counts}
            preset_object = envelope("presets-list", drive)["preset"]
            values.append({"preset": preset_object, **about, "description": drive.description})
            numbers = (NO_VALUE if size is None else plain(size) for size in sizes.values())
            rows.append((name, *numbers, ", ".join(map(str, counts.values()))))
        heads = ("preset", "ratio", "diameter, mm", "rated, N·m", "given, identified, assumed")
        table = Table("", heads, tuple(rows))
        return Report(
            "presets-list",
            None,
            "presets of hdassist",
            blocks=(table,),
            values={"presets": values},
        )


class PresetsShowCommand(o.PageOptions, o.DriveOptions):
    """A preset as written, or every value used in the computation.

    \b
    Examples:
      hdassist presets show vzp160 > my-drive.yaml
      hdassist presets show vzp160 --resolved
      hdassist presets show my-drive.yaml --set cam.W_0=0.95 --resolved

    Origins: given, assumed, identified (from the preset's `source`), default (the preset omits the field), override
    (--set). --json and --set imply --resolved.
    """

    preset: str
    resolved: bool = False

    def open(self) -> Output:
        """Return the output of the command, wide enough for a table if it is a pipe."""
        out = super().open()
        return out if sys.stdout.isatty() else replace(out, style=replace(out.style, width=_PIPED_COLUMNS))

    def run(self) -> int:
        """Show the preset, and return the exit code."""
        from hdassist.run.files import read_preset

        if self.resolved or self.json or self.overrides:
            return super().run()
        out = self.open()
        text = read_preset(self.preset)[0]
        if sys.stdout.isatty() or self.output != "-":
            out.text(text.decode("utf-8", "backslashreplace"))
        else:
            give_stdout(text)
        return 0

    def report(self, _out: Output, preset: str) -> Report:
        """Return the report of all values of a preset."""
        from hdassist.drive.preset.fields import resolved_fields, value_text

        drive = self.load(preset)
        rows = resolved_fields(drive)
        cells = tuple((row.path, value_text(row.value), row.unit, row.kind, row.reference) for row in rows)
        heads = ("field", "value", "unit", "origin", "reference")
        return Report(
            "presets-show",
            drive,
            drive.name,
            blocks=(Table("", heads, cells),),
            values={"description": drive.description, "fields": list(map(asdict, rows))},
            warnings=drive.origin.warnings,
        )


class PresetsValidateCommand(o.AnswerOptions, o.DriveOptions):
    """All errors of presets at once, and the number of values that are still assumed.

    \b
    Examples:
      hdassist presets validate my-drive.yaml
      hdassist presets validate *.yaml --json

    Exit codes: 0 all presets are valid, 4 a preset is invalid, 2 only a --set is invalid.
    """

    presets: list[str]

    def run(self) -> int:
        """Validate the presets, and return the exit code."""
        out = self.open()
        reports = run_each(
            _VALIDATE,
            self.presets,
            self._report,
            out,
            failed=_invalid,
            keep_failures=True,
        )
        return give(_VALIDATE, reports, replace(out, quiet=True))

    def _report(self, name: str) -> Report:
        """Return the report on a preset, which an invalid --set makes invalid. Raises other errors of loading it."""
        from hdassist.drive.preset.fields import origin_counts

        try:
            drive = self.load(name)
        except UsageError as error:
            complain(error, name)
            return Report(
                _VALIDATE,
                None,
                "",
                values=_invalid(name, error),
                exit_code=error.exit_code,
            )
        values = origin_counts(drive)
        warnings = drive.origin.warnings
        verdict = f"valid; warnings: {len(warnings)}" if warnings else "OK"
        if values["assumed"]:
            verdict += f"; assumed values: {values['assumed']}"
        result = {"file": name, "valid": True, "values": values, "findings": []}
        line = verdict if len(self.presets) > 1 else f"{name}: {verdict}"  # several lines begin with names anyway
        return Report(
            command=_VALIDATE,
            drive=drive,
            head=name,
            verdict=verdict,
            values=result,
            line=line,
            about=name,
            warnings=warnings,
        )


def _invalid(name: str, error: HdassistError) -> Json:
    """Return the JSON result for an invalid preset."""
    findings = [asdict(finding) for finding in error.findings] if isinstance(error, PresetError) else []
    return failure(_VALIDATE, error, preset=name) | {"file": name, "valid": False, "findings": findings}


class WishOptions(o.OptionGroup):
    """Options for the known data of a new drive."""

    like: str = "vzp160"
    coupling: str | None = None
    shaft: str | None = None
    pitch_diameter: str | None = None
    teeth: str | None = None
    ratio: float | None = None
    torque: str | None = None
    stiffness: str | None = None
    T1: str | None = None
    T2: str | None = None
    lost_motion: str | None = None
    accuracy: str | None = None
    accuracy_test: str | None = None
    holes: str | None = None
    allowed_holes: str | None = None
    quality: str | None = None
    flexspline: str | None = None


class PresetsSchemaCommand(o.OptionGroup):
    """JSON Schema of presets, for editors that complete and check YAML.

    \b
    Examples:
      hdassist presets schema -o hdassist-preset.schema.json

    Store the schema as a file. The second line of a preset written by presets new names this file, for editors with a
    YAML language server. Only presets validate checks units in texts and rules between fields.
    """

    output: str = "-"
    force: bool = False
    debug: bool = False

    def run(self) -> int:
        """Write the schema, and return the exit code."""
        from hdassist.drive.loading import preset_schema

        write_text(self.output, json_text(preset_schema()), self.force)
        return 0


class PresetsNewCommand(WishOptions):
    """A new preset, scaled from another drive; without options, a copy of vzp160 with every value to be replaced.

    \b
    Examples:
      hdassist presets new own --coupling oldham --ratio 100 --torque 67
      hdassist presets new own --coupling overhung --shaft 14x30 --ratio 100
      hdassist presets new own --like vzp160 --pitch-diameter 63 --teeth 160/162
      hdassist presets new own --ratio 100 --stiffness 3.1e4,5e4,5.7e4
      hdassist presets new own --ratio 100 --torque 67 --lost-motion '1 arcmin'
      hdassist presets new own --ratio 100 --accuracy 30 --accuracy-test typical
      hdassist presets new own --ratio 100 --holes 8 --allowed-holes 0,2,4,6
      hdassist presets new own --ratio 100 --torque 26 --quality unknown
      hdassist presets new my-drive -o my-drive.yaml

    --coupling is the most important option. It determines the effect of a wave generator eccentricity, and therefore
    how much another hole of the fixed wheel can reduce F'_ior. oldham: the wave generator aligns itself on an Oldham
    coupling. solid: it is one piece with its hub. overhung: it sits on the free end of a motor shaft. Values without an
    option are scaled from the other drive by size. They are marked as assumed, with a plausible range. --pitch-diameter
    states the size. Without it, the size follows from K3, or otherwise from --torque, because in catalogues both
    increase with the cube of the diameter. --stiffness, --T1, --T2, --lost-motion, --accuracy and --accuracy-test are
    copied to the table catalogue of the preset. check compares the samples of assumed values with these reference data.
    If a data sheet gives only one stiffness, it counts as K3. The drive is assumed to have a cup-shaped steel
    flexspline on a flexible ball bearing, like the drive of --like. The first lines of the preset name the fields to
    change for another type of drive.
    """

    output: str = "-"
    force: bool = False
    debug: bool = False
    name: str

    def run(self) -> int:
        """Write the preset, and return the exit code."""
        from hdassist.drive.loading import load_preset, similar_preset
        from hdassist.drive.preset.knowledge import read_requirements

        wish = asdict(self.only(WishOptions))
        like = load_preset(wish.pop("like"))
        requirements = read_requirements(like, **wish)
        write_text(self.output, similar_preset(self.name, like, requirements), self.force)
        return 0


PRESET = "vzp160"
M_G = 800.0
STORED_F_IOR = 7.706924145663  # arcsec; stored F'_ior of the drive of the self-test
AGREES = 1e-6  # arcsec; largest difference from the stored value
_CROSS = "HIGHS"


@dataclass(frozen=True)
class DoctorFinding:
    """Finding about a part of the installation.

    what: name of the part.
    status: status of the part; broken means that results cannot be trusted.
    found: description of the finding.
    """

    what: str
    status: Literal["ok", "note", "broken"]
    found: str


class DoctorCommand(o.PageOptions):
    """Check of this installation: versions, engine, cache, a self-test, cores and the terminal.

    \b
    Examples:
      hdassist doctor
      hdassist doctor --json
      hdassist doctor --empty-cache

    The self-test solves every mesh position of a drive of the library, solves the extremes again with another solver,
    and compares the results with stored digits. Exit codes: 0 fine, 5 results of this installation cannot be trusted.
    """

    empty_cache: bool = False

    def report(self, out: Output, _preset: str) -> Report:
        """Return the report on the checks of this installation."""
        from hdassist.run.kept import empty_cache

        if self.empty_cache:
            empty_cache()
        with out.progress("this installation"):  # shown before numpy is imported
            findings = [*_packages(), surroundings(out.style), engine(), cache(), self_test()]
        findings.sort(key=lambda each: ("broken", "note", "ok").index(each.status))
        broken = ", ".join(finding.what for finding in findings if finding.status == "broken")
        error = UntrustedError(
            f"results of this installation cannot be trusted: {broken}",
            "install hdassist again in a fresh environment",
        )
        if broken:
            complain(error)
        return Report(
            command="doctor",
            drive=None,
            head="this installation",
            verdict=f"broken: {broken}" if broken else "fine",
            blocks=(Table("", ("part", "status", "found"), tuple(map(astuple, findings))),),
            values={"findings": list(map(asdict, findings))},
            exit_code=error.exit_code if broken else 0,
        )


def _packages() -> Iterator[DoctorFinding]:
    """Yield the versions of hdassist, Python and each required package."""
    # at the top of the file, this import would take a fifth of the import time of `hdassist --help`
    from importlib.metadata import PackageNotFoundError, requires, version

    yield DoctorFinding("hdassist", "ok", f"{__version__}, Python {platform.python_version()}, {platform.platform()}")
    for needed in requires("hdassist") or ():
        if "extra ==" in needed:
            continue
        name = re.split("[<>=;]", needed)[0].strip()
        try:
            yield DoctorFinding(name, "ok", f"{version(name)} ({needed} needed)")
        except PackageNotFoundError:
            yield DoctorFinding(name, "broken", f"not installed; required: {needed}")


def engine() -> DoctorFinding:
    """Return the finding about the engine that solves the mesh positions."""
    from hdassist.drive.solve import walk

    compiled, description = walk.walk_library()
    return DoctorFinding("engine", "ok" if compiled else "note", description)


def cache() -> DoctorFinding:
    """Return the finding about the cache: its folder, its size, and the option that empties it."""
    from hashlib import sha256

    from hdassist.run import kept

    sizes = kept.cached_files()
    key = sha256(b"doctor").hexdigest()
    kept.keep("doctor", key, b"")
    if kept.cached("doctor", key) is None:
        message = kept.why_unsafe() or f"{kept.cache_folder()} cannot be used"
        return DoctorFinding("cache", "note", f"{message}: no results are cached; set {kept.FOLDER} to another folder")
    description = f"{kept.cache_folder() / kept.OWN_FOLDER}, {len(sizes)} files, {sum(sizes) / 1e6:.1f} MB"
    way = "--empty-cache deletes them" if kept.keeps_answers() else f"{kept.NO_CACHE} is set: no results are cached"
    return DoctorFinding("cache", "ok", f"{description}; {kept.FOLDER} sets another folder, {way}")


def surroundings(style: Style) -> DoctorFinding:
    """Return the finding about the machine: its cores and the style of standard output.

    style: style of standard output, determined before a progress bar redirects the stream.
    """
    cores = count(0)
    kind = "a terminal" if sys.stdout.isatty() else "not a terminal"
    shown = f"{style.width} columns, {'7-bit' if style.ascii else 'all'} characters"
    return DoctorFinding("machine", "ok", f"{cores} core{'s' if cores > 1 else ''}; output: {kind}, {shown}")


def self_test() -> DoctorFinding:
    """Return the finding of the self-test.

    The self-test compares F'_ior of a drive with the stored value, and solves the extremes with another solver.
    """
    from hdassist.drive.error.cycle import kinematic_error
    from hdassist.drive.error.error_map import ErrorMap
    from hdassist.drive.loading import load_preset
    from hdassist.drive.model.geometry import Kinematics, pitch_locked_states

    try:
        drive = load_preset(PRESET)
        extremes = ErrorMap(drive, M_G).extremes()
        import numpy as np

        states = pitch_locked_states(Kinematics.of(drive), np.array([*extremes.at_max, *extremes.at_min]))
        again = kinematic_error(drive, M_G, states=states, solver=_CROSS, run=UNCHECKED).range_arcsec
    except HdassistError as error:
        return DoctorFinding("self-test", "broken", error.message)
    off = abs(extremes.first - STORED_F_IOR)
    difference_arcsec = abs(again - extremes.first)
    description = (
        f"{extremes.first:.6f} arcsec, {off:.0e} from the stored value; {_CROSS} differs by {difference_arcsec:.0e}"
    )
    fine = off <= AGREES and difference_arcsec <= 1e-3 and extremes.certificate.max_residual <= 1e-8
    return DoctorFinding(
        "self-test", "ok" if fine else "broken", f"{description}; residual {extremes.certificate.max_residual:.0e}"
    )


class ExplainCommand(o.PageOptions):
    """Meaning of a check, error, field, symbol, term or option, and what to do about it.

    \b
    Examples:
      hdassist explain
      hdassist explain F_IOR COVERAGE
      hdassist explain cam.W_0 phi_g "one-wave share"
      hdassist explain "гибкое колесо" robust --json

    Without a name, all names are listed.
    """

    names: list[str]

    def report(self, out: Output, _preset: str) -> Report:
        """Return the report that explains the names."""
        from hdassist.interface.explaining import explained, is_name
        from hdassist.interface.pages.data import explain_report

        options = {field: option_text["help"] for table in o.DECLARED.values() for field, option_text in table.items()}
        phrase = " ".join(self.names)
        names = [phrase] if is_name(phrase) else self.names  # several words without quotes may be one name
        entries = list(dict.fromkeys(entry for name in names for entry in explained(name, options)))
        if out.style.ascii and not out.json:
            entries = [entry.in_latin() for entry in entries]
        return explain_report(entries)
