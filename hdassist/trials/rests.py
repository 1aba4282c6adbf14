"""What an advice from trials rests on: how sure it stays over the plausible range of what is assumed of a drive."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

import numpy as np

from hdassist.error.rests_on import LEAST, MOST, reached, weighed
from hdassist.error.table import Mesh
from hdassist.errors import UntrustedError
from hdassist.mounting.losses import Losses
from hdassist.mounting.stays import End, Stays
from hdassist.trials.cloud import Cloud, Effort
from hdassist.trials.draws import Draws

Make = Callable[..., Cloud]
Teach = Callable[[Cloud], tuple[Draws, Losses]]

COARSE, COUNT = Mesh((9, 5, 9, 9), 0), 12  # of tables that tell what an end of a range changes


def stays_good(
    cloud: Cloud,
    best: int,
    samples: int,
    make: Make,
    teach: Teach,
    *,
    most: int = MOST,
    executor: Executor | None = None,
) -> tuple[Stays, ...]:
    """What becomes of the choice over the ranges of the assumptions that move F'_ior most, the greatest change first.

    At both ends of each the same samples are drawn, coarser tables tell by how much their F'_ior changes, and the
    trials teach of that: at their own torque alone. Arguments: cloud, of the drive as told; best, place of the choice;
    samples, of the effort of the cloud; make, a cloud of a drive with an effort; teach, what trials teach of it; most,
    how many assumptions; executor, to spread the work over. Raises UntrustedError where an answer cannot be trusted.
    """
    known = weighed(cloud.drive, (cloud.rig_M_g,), executor=executor) if most else None
    if known is None:
        return ()
    chosen = [known.assumed[k] for k in known.heaviest(most)]
    coarse = partial(make, effort=Effort(samples, COARSE, COUNT))
    here = coarse(cloud.drive, executor=executor)
    look = partial(_end, cloud, here, best, coarse, teach)
    ends = list((executor.map if executor else map)(look, [(a.path, end) for a in chosen for end in (a.low, a.high)]))
    told = float(teach(cloud)[1].probability_good[best])
    held = [Stays(*row) for row in zip(chosen, zip(ends[::2], ends[1::2], strict=True), strict=True)]
    return tuple(sorted(held, key=lambda each: -max(abs((end.good or 0.0) - told) for end in each.ends)))


def _end(cloud: Cloud, here: Cloud, best: int, make: Make, teach: Teach, task: tuple[str, float]) -> End:
    """What becomes of the choice, by its place, with a field at, or on the way to, an end of its range.

    Arguments: cloud, of the drive as told, and the same by coarser tables, here.
    """
    value, there = reached(cloud.drive, *task, make)
    if there.values.keys() == here.values.keys():  # else nothing is open of what was, and they are other samples
        change = there.F_ior_arcsec / np.maximum(here.F_ior_arcsec, LEAST)
        there = replace(there, tables=cloud.tables, F_ior_arcsec=cloud.F_ior_arcsec * change)
    cloud = there
    try:
        _, losses = teach(cloud)
    except UntrustedError:
        return End(value, None, None, None)
    loss, good = losses.expected_loss[best], losses.probability_good[best]
    return End(value, losses.rotations_deg[losses.best], float(loss), float(good))
