"""Effect of the reference data of a drive on the range of its F'_ior: `python -m benchmarks.evidence`.

The drive is known from its data sheet. The table of docs/unknown.md is printed; `--picture` draws the figure of the
page from the table in the page. `--accuracy` prints the table for an accuracy in the catalogue, by the test of the
manufacturer.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"
FIGURE = DOCS / "figures" / "reference-data.svg"
M_G = 6.7
STIFFNESS = ("catalogue.K_1=3.1e4", "catalogue.K_2=5.0e4", "catalogue.K_3=5.7e4")
EVIDENCE: dict[str, tuple[str, ...]] = {
    "no reference data": (),
    "K_1 to K_3 of the catalogue": STIFFNESS,
    "plus lost motion, at most 60″": (*STIFFNESS, "catalogue.lost_motion=60"),
    "plus F'_ior as assembled, 40 ± 3″": (
        *STIFFNESS, "catalogue.lost_motion=60", f"measured.F_ior={{h0@{M_G}: 40 ± 3}}"
    ),
}  # fmt: skip
ACCURACY_ARCSEC = 30.0  # in the catalogue
TESTS = ("unstated", "full_revolution", "12_positions", "typical")
WIDTH, ROW, LEFT, MOST = 720, 44, 250, 190.0  # sizes of the figure; its right edge is at MOST arcsec


def rows(draws: int) -> Iterator[tuple[str, list[float], list[float], float, int]]:
    """Yield a row for each set of reference data.

    A row has the words of the set, the 5th, 50th and 95th percentile of F'_ior [arcsec], the 5th and 95th percentile of
    W_0, the effective sample size and the number of samples.

    draws: required effective sample size.
    """
    from hdassist import load_preset
    from hdassist.belief.evidence import evidence_of
    from hdassist.belief.prior import prior_of
    from hdassist.belief.samples import SamplingEffort, draw_samples
    from hdassist.belief.statistics import weighted_quantile
    from hdassist.drive.loading import load_text, similar_preset
    from hdassist.drive.preset.knowledge import read_requirements

    like = load_preset("vzp160")
    text = similar_preset("own", like, read_requirements(like, ratio=100.0, pitch_diameter="63.5 mm", torque="67"))
    for words, overrides in EVIDENCE.items():
        drive = load_text(text, "own.yaml", [f"operation.M_g={M_G}", *overrides])
        prior = prior_of(drive)
        found = draw_samples(prior, (M_G,), evidence=evidence_of(drive), effort=SamplingEffort.of(draws))
        (k,) = (k for k, each in enumerate(prior.fields) if each.path == "cam.W_0")
        W_0 = prior.fields[k].value(found.shares[:, k])
        wave = [weighted_quantile(W_0, found.weights, share) for share in (0.05, 0.95)]
        yield words, [found.percentile(share, 0) for share in (0.05, 0.5, 0.95)], wave, found.effective, found.draws


def accuracy_rows(draws: int) -> Iterator[str]:
    """Yield the Markdown row of a drive without an accuracy, and of each test of an accuracy.

    draws: required effective sample size.
    """
    import numpy as np

    from hdassist import load_preset
    from hdassist.belief.evidence import ACCURACY
    from hdassist.belief.prior import prior_of
    from hdassist.belief.samples import drive_samples
    from hdassist.belief.statistics import weighted_quantile
    from hdassist.drive.loading import load_text, similar_preset
    from hdassist.drive.preset.knowledge import read_requirements

    like = load_preset("vzp160")
    known = read_requirements(like, ratio=100.0, pitch_diameter="63.5 mm", torque="67", coupling="oldham")
    text = similar_preset("mine", like, known)
    for test in ("", *TESTS):
        accuracy = (f"catalogue.{ACCURACY}={ACCURACY_ARCSEC}", f"catalogue.accuracy_test={test}") if test else ()
        overrides = [f"operation.M_g={M_G}", *STIFFNESS, "catalogue.lost_motion=60", *accuracy]
        drive = load_text(text, "mine.yaml", overrides)
        found = drive_samples(prior_of(drive), [None], draws=draws)
        ends = ", ".join(f"{found.percentile(share, 0):.0f}" for share in (0.05, 0.5, 0.95))
        compared = "| "
        if test:
            readings = np.array([draw.figures[ACCURACY] for draw in found.made if draw.F_ior_arcsec is not None])
            above = np.average(readings > ACCURACY_ARCSEC, weights=found.weights)
            compared = f"{weighted_quantile(readings, found.weights, 0.5):.1f} | {100 * above:.0f} %"
        words = f"{ACCURACY_ARCSEC:.0f}″, `{test}`" if test else "not given"
        yield f"| {words} | {ends} | {compared} | {found.effective:.0f} of {found.draws} |"


def rows_of_page() -> list[tuple[str, list[float]]]:
    """Return the words and the percentiles of F'_ior of the rows in the page."""
    text = (DOCS / "unknown.md").read_text(encoding="utf-8")
    found = re.findall(r"^\| (.+?) \| (\d+), (\d+), (\d+) \| [\d.]+ to [\d.]+ \|", text, re.MULTILINE)
    return [(words, [float(value) for value in values]) for words, *values in found]


def drawn() -> str:
    """Return the figure, with a bar from the 5th to the 95th percentile and the median for each set of data."""
    found = rows_of_page()
    height = ROW * len(found) + 50

    def x(arcsec: float) -> float:
        return LEFT + (WIDTH - LEFT - 20) * arcsec / MOST

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" font-family="sans-serif" '
        'font-size="13" fill="#888">',
    ]
    for k, (words, (low, median, high)) in enumerate(found):
        y = 20 + ROW * k
        parts += [
            f'<text x="{LEFT - 12}" y="{y + 15}" text-anchor="end">{words}</text>',
            f'<rect x="{x(low):.1f}" y="{y}" width="{x(high) - x(low):.1f}" height="20" fill="#2e86c1"/>',
            f'<line x1="{x(median):.1f}" y1="{y}" x2="{x(median):.1f}" y2="{y + 20}" stroke="#fff" stroke-width="3"/>',
            f'<text x="{x(high) + 6:.1f}" y="{y + 15}">{low:.0f} to {high:.0f}</text>',
        ]
    axis = height - 34
    parts.append(f'<line x1="{LEFT}" y1="{axis}" x2="{WIDTH - 20}" y2="{axis}" stroke="#888"/>')
    for tick in range(0, int(MOST) + 1, 20):
        parts.append(f'<text x="{x(tick):.1f}" y="{axis + 15}" text-anchor="middle">{tick}</text>')
    parts.append(
        f'<text x="{x(MOST / 2):.1f}" y="{axis + 31}" text-anchor="middle">kinematic error F\'_ior, arcsec</text>'
    )
    return "\n".join([*parts, "</svg>"]) + "\n"


def main() -> None:
    """Print the table, or draw the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=64, help="effective samples of each row")
    parser.add_argument("--picture", action="store_true", help="draw the figure from the page's table")
    parser.add_argument("--accuracy", action="store_true", help="print the table of an accuracy in the catalogue")
    args = parser.parse_args()
    if args.accuracy:
        for row in accuracy_rows(args.draws):
            print(row, flush=True)
        return
    if args.picture:
        FIGURE.write_text(drawn(), encoding="utf-8")
        return
    for words, (low, median, high), (least, most), effective, draws in rows(args.draws):
        print(f"| {words} | {low:.0f}, {median:.0f}, {high:.0f} | {least:.3f} to {most:.3f} | ", end="")
        print(f"{effective:.0f} of {draws} |", flush=True)


if __name__ == "__main__":
    main()
