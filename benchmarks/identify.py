"""Values of vzp160 that agree with Fig. 3 and Fig. 2 of its paper: `python -m benchmarks.identify FILE [--seed 1]`.

Each solved drive is a line of FILE with its values, bars of Fig. 3, ranges of Fig. 2, self errors and K1 to K3; a
second run resumes from FILE. The first drives are spread over all bounds. A smooth surface is then fitted to the
logarithm of each figure of all drives. The next drives are sampled by the likelihood that the surface gives. The
uncertainties of the figures are three times as large in the first round, and decrease to the stated ones. The last
drives, weighted by the ratio of their own likelihood to that of the surface, are samples of the drives that agree with
the figures.

Two of eleven drives in each round are sampled as if K1 to K3 of catalogues were also known. They show the trade-off
between these stiffnesses and the figures.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy is loaded

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import RBFInterpolator
from scipy.special import softmax
from scipy.stats.qmc import Sobol

from hdassist import load_preset
from hdassist.drive.error.cycle import self_error
from hdassist.drive.error.error_map import Batch, ErrorMap
from hdassist.drive.error.extremes import DRAWN_GRIDS, many_extremes
from hdassist.drive.error.stiffness import stiffness
from hdassist.drive.error.waves import trace
from hdassist.drive.model.geometry import Array
from hdassist.drive.model.rules import first_conflict
from hdassist.drive.preset.fields import Drive
from hdassist.features.mounting.positions import phase_deg
from hdassist.run.errors import HdassistError
from hdassist.run.run import UNCHECKED

Row = dict[str, Any]  # a line of the file

# lower and upper bound of the fields on which the figures of the paper depend
BOUNDS = {
    "gears.j_n": (0.0, 20.0),
    "gears.h_a": (0.5, 0.7),
    "flexspline.k_t": (1.0, 1.8),
    "bearing.ring_b": (20.0, 28.0),
    "bearing.ring_h": (3.8, 5.0),
    "bearing.g_b": (0.0, 20.0),
    "bearing.beta": (0.0, 1.0),
    "supports.C_1": (2e5, 2e7),
    "supports.C_2": (5e3, 1e5),
    "supports.C_3": (1e3, 1e5),
    "contact.k_face": (6.8, 10.0),
    "contact.c_ball": (1.25e-5, 2.857e-5),
}
PATHS = tuple(BOUNDS)
LOW, HIGH = np.array(list(BOUNDS.values())).T
LOGARITHMIC = np.array([path.startswith("supports.") for path in PATHS])
BETA = PATHS.index("bearing.beta")  # a phase, for which 0 and 1 are equal

BARS = np.array([31.0, 15.0, 13.0, 2.0])  # arcsec, Fig. 3: largest and smallest at 80 N*m and at 800 N*m
PRINTED = np.array([BARS - 0.5, BARS + 0.5])  # ends of the bars, which are printed in whole arcsec
TURN_STARTS, MOST_OVER_LEAST = (20, 100, 300), (2.0, 3.0)  # Fig. 2: start angles [deg], ratio of the ranges
SELF_ERROR = (0.25, 2.0)  # arcsec
EDGE = 0.05  # standard deviation beyond such ends in the logarithm, for the misfit of the model
CATALOGUE, CATALOGUE_SPREAD = np.array([50.2e4, 79.1e4, 90.1e4]), 0.10  # N*m/rad, sizes 58 and 65 by d^3 at 160 mm

FIRST, EACH_ROUND, WALKERS, STEPS = 128, 44, 300, 120
WIDER = (3.0, 2.0, 1.3)  # factor of the uncertainties in each of the first rounds


def values_at(x: Array) -> dict[str, float]:
    """Return the values of fields, by path; x: positions within the bounds, each from 0 to 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.where(LOGARITHMIC, LOW * (HIGH / LOW) ** x, LOW + (HIGH - LOW) * x)
    return dict(zip(PATHS, found.tolist(), strict=True))


def place_of(drive: Drive) -> Array:
    """Return the position of each field of a drive within its bounds, each from 0 to 1."""
    found = np.array([drive.number(path) for path in PATHS])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(LOGARITHMIC, np.log(found / LOW) / np.log(HIGH / LOW), (found - LOW) / (HIGH - LOW)))


def figures(drive: Drive) -> dict[str, list[float]]:
    """Return the figures of a drive, by name.

    bars, ranges and self: bars of Fig. 3, ranges of Fig. 2 and self errors [arcsec].
    K: K1 to K3 [N*m/rad].
    scans: F'_ior at phases in steps of 30 deg [arcsec], for both torques.
    """
    own, phases, bars, scans = phase_deg(drive), np.arange(0, 360, 30.0), [], []
    for M_g in (80.0, 800.0):
        error_map = ErrorMap(drive, M_g)

        def at(some: Array, error_map: ErrorMap = error_map) -> Array:
            return many_extremes(error_map, Batch.turned(drive, some - own), DRAWN_GRIDS).F_ior_arcsec

        F_ior = at(phases)
        scans.append(F_ior.tolist())
        nearer = []
        for sign in (1, -1):
            k = int((sign * F_ior).argmax())
            before, here, after = F_ior[[k - 1, k, (k + 1) % 12]]
            vertex = 0.5 * (before - after) / (before - 2 * here + after)
            nearer.append(phases[k] + 30 * vertex)
        every = np.append(F_ior, at(np.array(nearer)))
        bars += [every.max(), every.min()]
    ranges = [trace(drive, 80, start_deg=start, run=UNCHECKED).error.range_arcsec for start in TURN_STARTS]
    coarse = drive.with_values({"numerics.n_phase": 5})
    own_errors = [each.range_arcsec for each in self_error(coarse, (80.0, 800.0), run=UNCHECKED)]
    found = stiffness(drive, points=0, run=UNCHECKED)
    K = [found.weaker(k) for k in (1, 2, 3)]
    return {"bars": list(map(float, bars)), "ranges": ranges, "self": own_errors, "K": K, "scans": scans}


def log_likelihood(logs: Array, wider: float = 1.0, catalogue: bool = False) -> Array:
    """Return the log likelihood of figures.

    logs: logarithms of bars, ranges, self errors and K, shape (..., 12).
    wider: factor of the uncertainties.
    catalogue: whether K1 to K3 of the catalogue count.
    """
    bars, ranges, own, K = np.split(logs, [4, 7, 9], axis=-1)
    ratio = ranges.max(axis=-1) - ranges.min(axis=-1)
    off = [beyond(bars, PRINTED), beyond(ratio[..., None], MOST_OVER_LEAST), beyond(own, SELF_ERROR)]
    off += [(K - np.log(CATALOGUE)) / CATALOGUE_SPREAD] if catalogue else []
    return np.asarray(-0.5 * np.square(np.concatenate(off, axis=-1) / wider).sum(axis=-1))


def beyond(logs: Array, ends: ArrayLike) -> Array:
    """Return the distance of logarithms beyond the ends of a range, in units of EDGE; ends: range of the values."""
    low, high = np.log(ends)
    return np.asarray((np.maximum(logs - high, 0) + np.maximum(low - logs, 0)) / EDGE)


def logs_of(rows: Sequence[Row]) -> Array:
    """Return the logarithms of the figures of rows, shape (rows, 12)."""
    return np.asarray(np.log([[*row["bars"], *row["ranges"], *row["self"], *row["K"]] for row in rows]))


class Surface:
    """Smooth surfaces fitted to the logarithms of all figures; axes are scaled by the sensitivity of the figures."""

    def __init__(self, x: Array, logs: Array) -> None:
        z = self.round_beta(x)
        slopes = np.linalg.lstsq(np.c_[np.ones(len(z)), z], logs, rcond=None)[0][1:]
        self.length = np.sqrt(np.square(slopes).sum(axis=1)) + 0.05
        self.fit = RBFInterpolator(z * self.length, logs, kernel="cubic", smoothing=1e-4)

    @staticmethod
    def round_beta(x: Array) -> Array:
        angle = 2 * np.pi * x[:, [BETA]]
        return np.hstack([np.delete(x, BETA, axis=1), np.cos(angle) / 4, np.sin(angle) / 4])

    def logs(self, x: Array) -> Array:
        return np.asarray(self.fit(self.round_beta(x) * self.length))


def drawn_from(
    surface: Surface, start: Array, count: int, wider: float, catalogue: bool, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return samples by the likelihood of a surface, shape (count, fields), and their log likelihood.

    The walkers of the Markov chain move by differences between walkers.
    """
    x = start[rng.integers(len(start), size=WALKERS)] + 0.01 * rng.standard_normal((WALKERS, len(PATHS)))
    x = np.clip(x, 1e-6, 1 - 1e-6)
    log = log_likelihood(surface.logs(x), wider, catalogue)
    for step in range(STEPS):
        a, b = x[rng.integers(WALKERS, size=WALKERS)], x[rng.integers(WALKERS, size=WALKERS)]
        some = rng.random((WALKERS, len(PATHS))) < rng.choice([0.3, 0.6, 1.0])
        size = 1.0 if step % 10 == 9 else 1.7 / np.sqrt(2 * some.sum(axis=1, keepdims=True) + 1)
        moved = x + some * (size * (a - b) + 0.01 * rng.standard_normal(x.shape))
        moved[:, BETA] %= 1
        moved = np.abs(moved)
        moved = np.where(moved > 1, 2 - moved, moved)
        inside = ((moved >= 0) & (moved <= 1)).all(axis=1)
        new = np.full(WALKERS, -np.inf)
        if inside.any():
            new[inside] = log_likelihood(surface.logs(moved[inside]), wider, catalogue)
        taken = np.log(rng.random(WALKERS)) < new - log
        x[taken], log[taken] = moved[taken], new[taken]
    chosen = rng.permutation(WALKERS)[:count]
    return x[chosen], log[chosen]


def solved(drive: Drive, x: Array) -> Row | None:
    """Return the row of a drive in the file; None if the drive is impossible or has no result.

    x: positions of the fields within the bounds.
    """
    values = {path: float(f"{value:.4g}") for path, value in values_at(x).items()}
    moved = drive.with_values(values)
    if first_conflict(moved):
        return None
    try:
        return {"values": values, **figures(moved)}
    except HdassistError:
        return None


def weights_of(rows: Sequence[Row]) -> Array:
    """Return the weights of the drives; only drives sampled by the figures with their stated uncertainties count.

    Each round is weighted by its effective sample size.
    """
    every, logs = np.zeros(len(rows)), log_likelihood(logs_of(rows))
    for number in {row["round"] for row in rows if row["round"] >= len(WIDER)}:
        some = [k for k, row in enumerate(rows) if row["round"] == number and not row["catalogue"]]
        found = softmax([logs[k] - rows[k]["log_surface"] for k in some])
        every[some] = found / np.square(found).sum()  # the sum of a round is its effective sample size
    return np.asarray(every / every.sum())


def fit_lines(rows: Sequence[Row], drive: Drive, count: int) -> Iterator[str]:
    """Yield the lines of the table `fit` of a preset.

    It has the values of the preset, and then those of equally probable drives, sorted by F'_ior as assembled.

    count: number of drives, including the preset.
    """
    weights = weights_of(rows)
    as_mounted = [np.interp(phase_deg(drive), np.arange(0, 360, 30), row["scans"][0]) for row in rows]
    order = np.argsort(as_mounted, kind="stable")
    chosen = order[np.searchsorted(np.cumsum(weights[order]), (np.arange(count - 1) + 0.5) / (count - 1))]
    yield "fit:"
    for path in PATHS:
        draws = [drive.number(path), *(rows[k]["values"][path] for k in chosen)]
        yield f"  {path}: [{', '.join(f'{value:.4g}'.replace('e+0', 'e').replace('e-0', 'e-') for value in draws)}]"
    effective = 1 / np.square(weights).sum()
    print(f"{effective:.0f} effective of {np.count_nonzero(weights)}; {len(set(chosen))} different", file=sys.stderr)


def main() -> None:
    reader = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    reader.add_argument("file", type=Path)
    reader.add_argument("--seed", type=int, default=1)
    reader.add_argument("--rounds", type=int, default=14)
    reader.add_argument("--from-bounds", action="store_true", help="not beginning from the preset")
    reader.add_argument("--fit", type=int, help="print so many samples as the table fit of a preset, and solve none")
    options = reader.parse_args()
    rng, drive = np.random.default_rng(options.seed), load_preset("vzp160")
    rows = [json.loads(line) for line in options.file.read_text().splitlines()] if options.file.exists() else []

    if options.fit:
        print("\n".join(fit_lines(rows, drive, options.fit)))
        return

    def solve(x: Array, more: Row) -> None:
        if row := solved(drive, x):
            rows.append(row | more)
            with options.file.open("a") as file:
                file.write(json.dumps(rows[-1]) + "\n")

    if not rows:
        every = Sobol(len(PATHS), seed=options.seed).random(FIRST)
        if not options.from_bounds:  # half of the drives are near the preset
            every[::2] = np.clip(place_of(drive) + 0.12 * (every[::2] - 0.5), 0, 1)
        for x in every:
            solve(x, {"round": -1})
    begun = 1 + max(row["round"] for row in rows)
    for number in range(begun, options.rounds):
        wider = WIDER[number] if number < len(WIDER) else 1.0
        x = np.array([place_of(drive.with_values(row["values"])) for row in rows])
        logs = logs_of(rows)
        surface = Surface(x, logs)
        for catalogue, count in ((False, EACH_ROUND * 9 // 11), (True, EACH_ROUND * 2 // 11)):
            best = np.argsort(-log_likelihood(logs, wider, catalogue))[:40]
            draws, log = drawn_from(surface, x[best], count, wider, catalogue, rng)
            before = len(rows)
            for place, its_log in zip(draws, log, strict=True):
                solve(place, {"round": number, "catalogue": catalogue, "log_surface": float(its_log)})
            new = rows[before:]
            exact = log_likelihood(logs_of(new), wider, catalogue)
            ratio = exact - [row["log_surface"] for row in new]
            weights = np.exp(ratio - ratio.max())
            every = log_likelihood(logs_of(rows), 1.0, catalogue)
            top = rows[int(every.argmax())]
            print(
                f"round {number}, {'with' if catalogue else 'without'} K: {len(rows)} drives, "
                f"{weights.sum() ** 2 / np.square(weights).sum():.0f} of {len(new)} effective; best {every.max():.2f}: "
                f"bars {np.round(top['bars'], 2)}, Fig. 2 {max(top['ranges']) / min(top['ranges']):.2f}, "
                f"self {np.round(top['self'], 2)}, K {np.round(np.array(top['K']) / 1e4, 1)}, "
                f"g_b {top['values']['bearing.g_b']:.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
