"""Readers of the tool under a fuzzer that is guided by the code that an input reaches.

`python -m tests.fuzz inputs --guided`. It needs the extra `fuzz` (atheris). An input is a byte that chooses
the reader, and what is read. A reader may refuse it with one of our errors; anything else ends the run with a
traceback, and the input is kept as crash-....
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import atheris
import numpy as np

with atheris.instrument_imports(include=["hdassist"]):
    from hdassist.drive.loading import load_text
    from hdassist.features.acceptance.answer import read_answers
    from hdassist.features.acceptance.limits import LimitText
    from hdassist.features.acceptance.request import Request, read_lot
    from hdassist.features.calibration import read_targets
    from hdassist.features.measuring.measure import measure
    from hdassist.features.measuring.orders import parse_orders, parse_stated
    from hdassist.features.mounting.posterior import read_trial
    from hdassist.readers.pitch import read_pitch
    from hdassist.readers.trace import TraceForm, read_trace
    from hdassist.run.errors import HdassistError

from tests.fuzz import mutate
from tests.fuzz.inputs import MOST_MEMORY, MOST_SECONDS
from tests.fuzz.seeds import DRIVE, LOTS, PITCH, TARGETS, TRACES, answers, presets

KEPT = Path(tempfile.mkdtemp())
THE_DRIVE = load_text(DRIVE, "drive.yaml")
(KEPT / "run.csv").write_text(TRACES[0][0])
WANTED = read_targets(TARGETS.encode(), str(KEPT / "targets.yaml"), THE_DRIVE)
OPTIONS = (
    "F_ior@1=60",
    "order_2=5±1 arcsec",
    "1-12",
    "encoder=0.3",
    "h4=17.3",
    "120=17.3",
    "cam.W_0=1.1",
    "gears.j_n=5 um",
)


def _as_file(name: str, data: bytes) -> Path:
    (KEPT / name).write_bytes(data)
    return KEPT / name


def _options(data: bytes) -> None:
    text = data.decode("utf-8", "surrogateescape")
    for parse in (
        lambda: LimitText.parse(text, "--limit"),
        lambda: LimitText.parse(text, "--value"),
        lambda: parse_stated([text]),
        lambda: parse_orders(text),
        lambda: read_trial(text, 12),
        lambda: load_text(DRIVE, "drive.yaml", [text]),
    ):
        try:
            parse()
        except HdassistError:
            continue


READERS: dict[str, Callable[[bytes], object]] = {
    "preset": lambda data: load_text(data, "given.yaml"),
    "targets": lambda data: read_targets(data, str(KEPT / "targets.yaml"), THE_DRIVE),
    "trace": lambda data: measure(read_trace(data, TraceForm(), 15.0), ratio=15.0),
    "pitch": lambda data: read_pitch(data, 32),
    "lot": lambda data: read_lot(str(_as_file("lot.csv", data)), Request("drive.yaml")),
    "options": _options,
    "replay": lambda data: read_answers(str(_as_file("answers.json", data))),
}
SEEDS: dict[str, tuple[str, ...]] = {
    "preset": presets(), "targets": (TARGETS,), "trace": tuple(text for text, _ in TRACES),
    "pitch": tuple(text for text, _ in PITCH), "lot": LOTS, "options": OPTIONS, "replay": answers(),
}  # fmt: skip
CHANGES: dict[str, Callable[[str, mutate.Rng], bytes]] = {
    "preset": mutate.yaml_text, "targets": mutate.yaml_text, "trace": mutate.table_text, "pitch": mutate.table_text,
    "lot": mutate.table_text, "replay": mutate.json_text,
}  # fmt: skip
NAMES = list(READERS)


def read(given: bytes) -> None:
    """Read an input; what is ours to refuse is refused."""
    if not given:
        return
    name = NAMES[given[0] % len(NAMES)]
    if given[0] < len(NAMES):
        try:
            READERS[name](given[1:])
        except HdassistError as error:
            assert str(error), "an error without a word"


def change(given: bytes, most: int, seed: int) -> bytes:
    """Another input: with its structure kept, half of them, as the fuzzer without guidance does it."""
    rng = np.random.default_rng(seed)
    name = NAMES[given[0] % len(NAMES)] if given else ""
    if name in CHANGES and rng.random() < 0.5:
        with suppress(Exception):  # it may be no text of that structure any more
            return (given[:1] + CHANGES[name](given[1:].decode(), rng))[:most]
    return given[:1] + bytes(atheris.Mutate(given[1:], most - 1))


def main() -> None:
    """Fuzz until so many inputs are done; libFuzzer ends the process."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz inputs --guided")
    parser.add_argument("--n", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="*", default=())
    args = parser.parse_args()
    corpus = KEPT / "corpus"
    corpus.mkdir()
    for name in args.kinds or NAMES:
        for k, text in enumerate(SEEDS[name]):
            (corpus / f"{name}{k}").write_bytes(bytes([NAMES.index(name)]) + text.encode())
    sys.stderr = open(os.devnull, "w")  # noqa: PTH123, SIM115 (warnings of numpy; libFuzzer writes to the descriptor)
    memory = int(MOST_MEMORY) + 400  # of the process with all that it has imported
    options = (f"-runs={args.n}", f"-seed={args.seed + 1}", f"-timeout={int(MOST_SECONDS)}", f"-rss_limit_mb={memory}")
    atheris.Setup(
        [sys.argv[0], *options, "-max_len=20000", "-print_final_stats=1", str(corpus)], read, custom_mutator=change
    )
    atheris.Fuzz()


if __name__ == "__main__":
    main()
