"""Required resolution of the encoders of a test rig, for docs/measure.md: `python -m benchmarks.encoders`.

`hdassist measure` reads the full cycle of vzp160 at 80 N*m as two encoders would record it. A motor turns unevenly, so
readings triggered by a clock are at uneven angles; readings triggered by the input encoder are at even angles.
"""

from __future__ import annotations

import numpy as np

from hdassist import kinematic_error, load_preset
from hdassist.drive.model.geometry import Array
from hdassist.features.measuring.measure import measure
from hdassist.readers.trace import TraceForm, read_trace
from hdassist.run.errors import HdassistError

READINGS = 50  # readings per input revolution
CLOCK, CAM = 0.4, 0.0  # unevenness of the angles as a share of the step between readings, by trigger
RIGS = (  # steps of the output encoder [arcsec] and of the input encoder [deg], noise [arcsec], trigger
    (1.0, 0.01, 0.0, CLOCK), (5.0, 0.01, 0.0, CLOCK), (20.0, 0.01, 0.0, CLOCK), (40.0, 0.01, 0.0, CLOCK),
    (1.0, 0.1, 0.0, CLOCK), (1.0, 0.5, 0.0, CLOCK), (1.0, 0.01, 2.0, CLOCK), (5.0, 0.1, 1.0, CLOCK),
    (1.0, 0.01, 0.0, CAM), (5.0, 0.01, 0.0, CAM), (20.0, 0.01, 0.0, CAM), (5.0, 0.01, 1.0, CAM),
)  # fmt: skip


def recorded(error: Array, ratio: float, output_step: float, cam_step: float, noise: float, uneven: float) -> bytes:
    """Return the file of both angles [deg] of a recording over the full cycle.

    error: error at even input angles over the cycle [arcsec].
    ratio: input revolutions per output revolution.
    output_step: step of the output encoder [arcsec].
    cam_step: step of the input encoder [deg].
    noise: standard deviation of the output readings [arcsec].
    uneven: unevenness of the angles as a share of the step between readings.
    """
    rng = np.random.default_rng(0)
    cycle = round(ratio)
    turns = np.arange(cycle * READINGS) / READINGS
    turns = turns + rng.uniform(0, uneven / READINGS, len(turns))
    states = np.linspace(0, cycle, len(error) + 1)
    wanted = turns / -ratio * 1296000 + np.interp(turns, states, [*error, error[0]])
    output = np.round((wanted + noise * rng.standard_normal(len(turns))) / output_step) * output_step / 3600
    cam = np.round(turns * 360 / cam_step) * cam_step
    rows = (f"{a:.6f},{b:.7f}" for a, b in zip(cam, output, strict=True))
    return "\n".join(["cam_deg,output_deg", *rows]).encode()


def main() -> None:
    drive = load_preset("vzp160")
    solved = kinematic_error(drive, M_g=80)
    print(f"F'_ior {solved.F_ior_arcsec:.2f} arcsec\n")
    print("| output step, arcsec | cam step, deg | noise, arcsec | readings by | F'_ior read, arcsec | 95 % |")
    print("| --- | --- | --- | --- | --- | --- |")
    for rig in RIGS:
        try:
            file = recorded(solved.error_arcsec, 100, *rig)
            (found,) = measure(read_trace(file, TraceForm(second="output_deg"), ratio=100), drive=drive).directions
            low, high = found.interval_arcsec
            told = f"{found.range.value:.1f} | {low:.1f} to {high:.1f}"
        except HdassistError as refused:
            told = f"refused: {refused} | "
        print(f"| {rig[0]:g} | {rig[1]:g} | {rig[2]:g} | {'clock' if rig[3] else 'cam'} | {told} |", flush=True)


if __name__ == "__main__":
    main()
