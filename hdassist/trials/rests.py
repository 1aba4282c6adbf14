"""What an advice from trials rests on: how sure it stays over the plausible range of what is assumed of a drive."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial

from hdassist.error.rests_on import MOST, reached, weighed
from hdassist.errors import UntrustedError
from hdassist.mounting.losses import Losses
from hdassist.mounting.stays import End, Stays
from hdassist.preset.fields import Drive
from hdassist.trials.cloud import QUICK, Cloud
from hdassist.trials.draws import Draws

Make = Callable[..., Cloud]
Teach = Callable[[Cloud], tuple[Draws, Losses]]

COARSE = replace(QUICK, samples=4096)  # enough for a probability to some per cent


def stays_good(
    drive: Drive,
    losses: Losses,
    M_g: float,
    make: Make,
    teach: Teach,
    *,
    most: int = MOST,
    executor: Executor | None = None,
) -> tuple[Stays, ...]:
    """What becomes of the choice over the ranges of the assumptions that move F'_ior most, the greatest change first.

    At both ends of each a coarser cloud is drawn, and the trials teach of it. Arguments: losses, what trials taught of
    the drive as told; M_g, their torque [N*m]; make, a cloud of a drive with an effort; teach, what trials teach of it,
    in the positions of losses; most, how many assumptions; executor, to spread the work over. Raises UntrustedError
    where an answer cannot be trusted.
    """
    known = weighed(drive, (M_g,), executor=executor) if most else None
    if known is None:
        return ()
    chosen = [known.assumed[k] for k in known.heaviest(most)]
    look = partial(_end, drive, losses.best, partial(make, effort=COARSE), teach)
    ends = list((executor.map if executor else map)(look, [(a.path, end) for a in chosen for end in (a.low, a.high)]))
    told = float(losses.probability_good[losses.best])
    held = [Stays(*row) for row in zip(chosen, zip(ends[::2], ends[1::2], strict=True), strict=True)]
    return tuple(sorted(held, key=lambda each: -max(abs((end.good or 0.0) - told) for end in each.ends)))


def _end(drive: Drive, best: int, make: Make, teach: Teach, task: tuple[str, float]) -> End:
    """What becomes of the choice, by its place, with a field at, or on the way to, an end of its range."""
    value, cloud = reached(drive, *task, make)
    try:
        _, losses = teach(cloud)
    except UntrustedError:
        return End(value, None, None, None)
    loss, good = losses.expected_loss[best], losses.probability_good[best]
    return End(value, losses.rotations_deg[losses.best], float(loss), float(good))
