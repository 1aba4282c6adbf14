"""`hdassist compare` with presets beside each other; comparing/command.py sends it here."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hdassist.errors import UsageError
from hdassist.terminal import options as o

SUFFIXES = (".yaml", ".yml")


def is_preset(name: str) -> bool:
    """Whether an argument beside a preset is one too, and no trace: a name of the library, or a YAML file."""
    from hdassist.preset.library import preset_names

    return Path(name).suffix.lower() in SUFFIXES or name in preset_names()


def require_presets(names: Sequence[str], *, plain: bool) -> None:
    """Raise UsageError where traces stand among presets, or options are asked for that belong to traces."""
    if traces := [name for name in names if not is_preset(name)]:
        words = f"{traces[0]} is taken for a trace, and {next(filter(is_preset, names))} for a preset"
        raise UsageError(words, "a preset is a name of the library or a .yaml file; compare presets, or traces")
    if not plain:
        raise UsageError("how a trace is read says nothing of presets", "leave out its options, or name a trace")


def compare_presets(
    names: Sequence[str],
    torques: list[str],
    drives: o.DriveOptions,
    work: tuple[int, int, int],
    options: o.FigureOptions,
) -> int:
    """Compare presets and give the answer; returns the exit code.

    Arguments: names; torques, as overrides; drives; work: draws, seed and jobs; options.
    """
    from hdassist.comparing.presets import compare_drives, estimate_comparison
    from hdassist.comparing.presets_page import answer, warnings
    from hdassist.terminal.answers import failure
    from hdassist.terminal.output import warn
    from hdassist.terminal.runs import Answer, give, run_each
    from hdassist.terminal.workers import workers

    out, (draws, seed, jobs) = options.open(), work

    def one(_: str) -> Answer:
        loaded = [drives.load(name, *torques) for name in names]
        total = estimate_comparison(loaded, draws)
        with out.progress(", ".join(drive.name for drive in loaded), total) as progress, workers(jobs) as executor:
            result = compare_drives(loaded, draws=draws, seed=seed, executor=executor, progress=progress)
        for text in warnings(result):
            warn(text)
        return answer(result, seed=seed)

    answers = run_each(
        "compare-presets", [""], one, options,
        failed=lambda _, error: failure("compare-presets", error, preset=names[0]),
    )  # fmt: skip
    return give("compare-presets", answers, options, out)
