"""Waves of F'_ior over the holes of hidden drives: `python -m benchmarks.waves [--n 20] [--first 640] [--keep DIR]`.

A wave is the amplitude of one order of ln F'_ior over the holes. The hidden drives are those of case A of
benchmarks.regret. Their waves are compared with the root mean square of the same waves over the samples of the preset,
which cannot represent the hidden drives. The ratio of both is the factor of the smooth curves of `mount`
(`_WAVE_FACTORS` in features/mounting/posterior.py). Its logarithm is assumed to be normal. The log likelihood is
printed for several medians and standard deviations, for order 1 and for the higher orders together.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from scipy.special import logsumexp

from benchmarks.regret import CASES, HOLES, samples_of, true_values
from hdassist.drive.model.geometry import Array

ORDERS = {"order 1": [1], "orders 2 to 4": [2, 3, 4]}
MEDIANS = (0.25, 0.35, 0.5, 0.7, 1.0)
SPREADS = (0.1, 0.35, 0.7, 1.0)
FACTORS = 2.0 ** (np.arange(-12, 9) / 4)


def squared_waves(F_ior: Array) -> Array:
    """Return the squared amplitudes of the orders of ln F'_ior over the holes, shape (curves, orders).

    F_ior: F'_ior in the holes [arcsec], shape (curves, holes).
    """
    return np.asarray(np.square(2 / HOLES * np.abs(np.fft.rfft(np.log(F_ior)))))


def log_likelihoods(squares: Array, mean_squares: Array) -> Array:
    """Return the log likelihood of the waves for each median (row) and spread (column) of the factor.

    The cosine and the sine of a wave are normal, so the density of its squared amplitude is exponential.

    squares: squared amplitudes, shape (drives, orders).
    mean_squares: their means over the samples, shape (orders,).
    """
    expected = np.multiply.outer(FACTORS**2, mean_squares)  # shape (factors, orders)
    log_density = -(squares[:, None] / expected + np.log(expected)).sum(axis=2)  # shape (drives, factors)
    rows = []
    for median in MEDIANS:
        for spread in SPREADS:
            log_shares = -0.5 * np.square(np.log(FACTORS / median) / spread)
            log_of_drives = logsumexp(log_density + log_shares - logsumexp(log_shares), axis=1)
            rows.append(log_of_drives.sum())
    return np.reshape(rows, (len(MEDIANS), len(SPREADS)))


def main() -> None:
    """Print the waves of hidden drives and of the samples, and the log likelihood of their ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, default=20, help="hidden drives")
    parser.add_argument("--first", type=int, default=640, help="number of the first of them")
    parser.add_argument("--keep", type=Path, help="folder of true values")
    args = parser.parse_args()
    case = CASES["A"]
    samples = samples_of(case, args.first, light=False)
    mean_squares = samples.weight.sum(axis=1) @ squared_waves(samples.F_ior_arcsec)
    seeds = range(args.first, args.first + args.n)
    squares = squared_waves(np.array([true_values(case, seed, args.keep)[0] for seed in seeds]))
    print("rms of the waves of orders 1 to 4, samples:      ", np.sqrt(mean_squares[1:5]).round(3))
    print("rms of the waves of orders 1 to 4, hidden drives:", np.sqrt(squares.mean(axis=0)[1:5]).round(3))
    for name, orders in ORDERS.items():
        table = log_likelihoods(squares[:, orders], mean_squares[orders])
        print(f"{name}, log likelihood below the largest; spreads {SPREADS}")
        for median, row in zip(MEDIANS, table - table.max(), strict=True):
            print(f"  median {median:4g}:", row.round(1))


if __name__ == "__main__":
    main()
