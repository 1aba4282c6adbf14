"""The compiled walk under the address and undefined-behaviour sanitizers, over the drives of the tests.

`python -m tests.solve.sanitized` compiles it so, and runs itself with the sanitizers loaded before Python.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

FLAGS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-fno-omit-frame-pointer", "-g", "-O1"]


def walk_over_drives(library: Path) -> int:
    """Solve states of presets and of drives with coned flanks and measured teeth; how many."""
    import numpy as np

    from hdassist import load_preset
    from hdassist.drive.error.error_map import Batch, ErrorMap
    from hdassist.drive.error.extremes import DRAWN_GRIDS, many_extremes
    from hdassist.drive.model.contacts import StateGaps
    from hdassist.drive.model.deviations import ToothDeviations
    from hdassist.drive.solve import walk
    from hdassist.drive.solve.formulation import formulate
    from hdassist.run.files import preset_names
    from tests.helpers.process import SMALL, TINY
    from tests.helpers.support import load_case
    from tests.solve.test_walk import states_of

    walk.walk_library = lambda: (walk._load(library), "")
    cases = [(load_preset(name), None) for name in preset_names()]
    cases += [(load_preset(file, [f"numerics.stations={n}"]), None) for file in (SMALL, TINY) for n in (1, 3, 5)]
    small = load_preset(SMALL)
    cases.append((small, ToothDeviations(np.ones(small.gears.z_g), np.ones(small.gears.z_b))))
    solved = 0
    for drive, teeth in cases:
        system, gaps = states_of(drive, 400, teeth)
        engine, formulation = None, formulate(system)
        for M_g in drive.operation.M_g:
            engine = load_case(formulation, M_g * 1e3, engine, many=True)
            for some in (gaps, gaps[:1], gaps[:0], StateGaps(np.full((3, 2), np.nan))):
                own, torque = engine._walk, M_g * 1e3
                sums = own.solve(some, torque, slope=True) if own else engine.sums(some, slope=True)
                solved += len(sums.rotation)
        solved += many_extremes(ErrorMap(drive, M_g), Batch.turned(drive, [0.0, 30.0]), DRAWN_GRIDS).certificate.states
    return solved


def main() -> int:
    """Compile, and run again with the sanitizers; the exit code of that run."""
    if len(sys.argv) > 1:
        print(f"sanitized walk: {walk_over_drives(Path(sys.argv[1]))} states, no finding")
        return 0
    from hdassist.drive.solve.build import compile_walk, library_name

    with tempfile.TemporaryDirectory() as folder:
        assert compile_walk(Path(folder), FLAGS)
        names = ("libasan.so", "libubsan.so")
        found = [subprocess.check_output(["cc", f"-print-file-name={name}"], text=True).strip() for name in names]
        env = os.environ | {"LD_PRELOAD": " ".join(found), "ASAN_OPTIONS": "detect_leaks=0", "OMP_NUM_THREADS": "1"}
        library = Path(folder) / library_name(1)
        return subprocess.run([sys.executable, "-m", "tests.solve.sanitized", str(library)], env=env).returncode


if __name__ == "__main__":
    sys.exit(main())
