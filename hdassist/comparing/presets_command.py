"""`hdassist compare` with presets beside each other; comparing/command.py sends it here."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hdassist.errors import UsageError
from hdassist.run.run import Run
from hdassist.terminal import options as o

PRESET_SUFFIXES = (".yaml", ".yml")
LARGEST_TORQUE = 1e7  # N*m, as in a preset


def is_preset(name: str) -> bool:
    """Whether an argument beside a preset is one too, and no trace: a name of the library, or a YAML file."""
    from hdassist.preset.library import preset_names

    return Path(name).suffix.lower() in PRESET_SUFFIXES or name in preset_names()


def require_presets(names: Sequence[str], *, plain: bool) -> None:
    """Raise UsageError where traces stand among presets, or options are asked for that belong to traces."""
    if traces := [name for name in names if not is_preset(name)]:
        words = f"{traces[0]} is taken for a trace, and {next(filter(is_preset, names))} for a preset"
        raise UsageError(words, "a preset is a name of the library or a .yaml file; compare presets, or traces")
    if not plain:
        raise UsageError("how a trace is read says nothing of presets", "leave out its options, or name a trace")


def compare_presets(
    names: Sequence[str],
    torque: float | None,
    drives: o.DriveOptions,
    work: tuple[int, int, int],
    options: o.FigureOptions,
    *,
    details: bool,
) -> int:
    """Compare presets and give the answer; returns the exit code.

    Arguments: names; torque [N*m], None for those that all have; drives; work: draws, seed and jobs; options; details,
    whether all tables are shown. Raises UsageError for a torque that is none.
    """
    from hdassist.comparing.presets import common_torques, compare_drives, estimate_comparison
    from hdassist.comparing.presets_page import comparison_warnings, drives_answer
    from hdassist.run.processes import workers
    from hdassist.terminal.answers import failure
    from hdassist.terminal.output import warn
    from hdassist.terminal.runs import Answer, give, run_each

    if torque is not None and not 0 < abs(torque) <= LARGEST_TORQUE:
        raise UsageError(
            f"--torque must be a torque in N*m, and not {torque:g}", f"up to {LARGEST_TORQUE:g}, and not 0"
        )
    out, (draws, seed, jobs) = options.open(), work

    def one(_: str) -> Answer:
        loaded = [drives.load(name) for name in names]
        torques = common_torques(loaded) if torque is None else (torque,)
        total = estimate_comparison(loaded, torques, draws)
        with out.progress(", ".join(drive.name for drive in loaded), total) as progress, workers(jobs) as executor:
            result = compare_drives(loaded, torques, draws=draws, run=Run(executor, progress, seed))
        for text in comparison_warnings(result):
            warn(text)
        return drives_answer(result, seed=seed, details=details)

    answers = run_each(
        "compare-presets", [""], one, options,
        failed=lambda _, error: failure("compare-presets", error, preset=names[0]),
    )  # fmt: skip
    return give("compare-presets", answers, options, out)
