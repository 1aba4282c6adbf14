"""The bounds of the harmonics that are not known, against the accuracy that catalogues promise of every drive sold."""

from __future__ import annotations

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.drive.preset.knowledge import HIGHER_ORDERS, SECOND_ORDER
from tests.validation.case import Case, Kind, parameters
from tests.validation.drawn_drives import F_ior_drawn, percentiles

SIZES = (14, 17, 20, 25, 32, 40, 45, 50, 58, 65)
COUNT = 64  # drives of a size
ON_REQUEST = {14: 60, 17: 60}  # arcsec; of all other sizes 30
IN_ANGLE = 3.25 * 32.4 / 39.95  # factor on size 65 that makes F_p of class 7 as large in angle as that of size 20

TITLE = "The bounds of the harmonics and the catalogues' accuracy"
ABOUT = (
    f"If a preset does not specify the amplitudes of the harmonics, these range up to {100 * SECOND_ORDER:g} % (order "
    f"2) and {100 * HIGHER_ORDERS:g} % (orders 3 and 4) of half of F'_i. No published source states these bounds, "
    "although they determine the level of F'_ior of every catalogue preset. The bounds are therefore compared with "
    "the accuracy in the catalogue, which every drive sold meets. The catalogue states no load, and the comparison "
    "uses a tenth of the rated torque. The first table gives the share of 64 sampled drives that meet the accuracy. "
    "The second table gives this share with the bounds multiplied by the factor in the first column. It also gives "
    "the factors by which the median and the 95th percentile of F'_ior then change.\n\nWith the bounds doubled, "
    "nearly half of the drives of size 20 do not meet the accuracy. With the bounds halved, the error in the "
    "[recording of an actual drive](#a-real-drive-among-sampled-ones) would exceed that of all sampled drives. The "
    "bounds are therefore not changed. The sampled deviations of single teeth follow from the accuracy class of F'_i, "
    "and agree with half of these bounds ([theory](theory.md#single-teeth)).\n\nThe catalogue states the same "
    "accuracy in arcsec for sizes 20 to 65, but the computed F'_ior decreases with the diameter. The reason is the "
    "assumed accuracy class of the teeth. F_p of class 7 (ISO 1328-1) is 32 µm for size 20 and 40 µm for size 65, "
    "although the diameter of size 65 is 3.25 times as large. With the same angular deviation as size 20 (class 9 to "
    "10), size 65 also meets the accuracy (last row of this section). The accuracy in a catalogue is an upper limit, "
    "so the error of actual drives may be lower. Conversely, F'_ior of the presets may be too small by a factor of up "
    "to 1.9 (size 40) and 2.9 (size 65)."
)
SOURCE = "Harmonic Drive CSF/CSG catalogue, table 40"


def limit(size: int) -> float:
    """Accuracy [arcsec] that the catalogue promises of a size."""
    return float(load_preset(f"size-{size}-100").catalogue.accuracy or 0)


def kept(size: int, harmonics: float = 1.0) -> float:
    """Share [%] of drawn drives of a size within its accuracy, by a factor on the bounds of the harmonics."""
    return float(100 * np.mean(F_ior_drawn(size, COUNT, harmonics) <= limit(size)))


def moved(size: int, harmonics: float, share: float) -> float:
    """A percentile of F'_ior of a size with other bounds of the harmonics, over that with these."""
    other, own = (np.percentile(F_ior_drawn(size, COUNT, factor), 100 * share) for factor in (harmonics, 1.0))
    return float(other / own)


def table() -> str:
    """F'_ior of drawn drives of each size beside the catalogue's accuracy, and by the bounds of the harmonics."""
    lines = [
        "|size|accuracy|F'_ior of sampled drives: 5th/50th/95th percentile|share that meets the accuracy|share that "
        "meets the accuracy available on request|",
        "|---|---|---|---|---|",
    ]
    for size in SIZES:
        F_ior, special = F_ior_drawn(size, COUNT), ON_REQUEST.get(size, 30)
        share = 100 * np.mean(F_ior <= special)
        lines.append(f"|{size}|{limit(size):g}″|{percentiles(F_ior)}″|{kept(size):.0f}%|{special}″: {share:.0f}%|")
    lines += [
        "",
        "|bounds of harmonics|size|F'_ior of sampled drives: 5th/50th/95th percentile|share that meets the accuracy|"
        "change of the median|change of the 95th percentile|",
        "|---|---|---|---|---|---|",
    ]
    for factor in (0.5, 2.0):
        for size in (17, 20, 65):
            cells = (
                f"×{factor:g}",
                f"{size}",
                f"{percentiles(F_ior_drawn(size, COUNT, factor))}″",
                f"{kept(size, factor):.0f}%",
                *(f"×{moved(size, factor, share):.2f}" for share in (0.5, 0.95)),
            )
            lines.append(f"|{'|'.join(cells)}|")
    return "\n".join(lines)


CASES = [
    Case(
        "share of drives that meet the accuracy, smallest of all sizes",
        "%",
        SOURCE,
        90,
        100,
        why="The share of all drives that meet the accuracy should be 95 % or more. The accepted share of 64 drives "
        "is smaller by its statistical uncertainty",
        kind=Kind.CHECK,
        digits=".0f",
        value=lambda: min(kept(size) for size in SIZES),
        slow=True,
    ),
    Case(
        "share of drives of size 20 that meet the accuracy, with the bounds of the harmonics multiplied by 2",
        "%",
        SOURCE,
        0,
        50,
        why="With these bounds most drives sold would not meet the accuracy",
        kind=Kind.CHECK,
        miss="Half of the sampled wheels have small single pitch deviations. Nearly half of the samples do not meet "
        "the accuracy",
        digits=".0f",
        value=lambda: kept(20, 2.0),
        slow=True,
    ),
    Case(
        "95th percentile of size 65 with the angular tooth deviations of size 20",
        "arcsec",
        SOURCE,
        30,
        60,
        why="The range extends from the accuracy available on request to the accuracy of all drives",
        kind=Kind.CHECK,
        digits=".0f",
        value=lambda: float(np.percentile(F_ior_drawn(65, COUNT, IN_ANGLE, IN_ANGLE), 95)),
        slow=True,
    ),
]


@pytest.mark.parametrize("case", parameters(CASES))
def test_case(case: Case) -> None:
    case.check()
