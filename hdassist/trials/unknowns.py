"""What is not known of a drive before a trial: the cam offset that stands with the fixed wheel, and the rest.

Each unknown is drawn by a share in 0..1 that is uniform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, qmc

from hdassist.errors import UsageError
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive, field_table
from hdassist.preset.kinds import least_of

FINE_SIZES, FINE_DIRECTIONS = 41, 72  # of the offset, over which it is weighed
NARROWEST = 1.0  # um: a size needs some width to be weighed over
WIDEST = 2.0  # an offset without an uncertainty may be so many times the preset's
OUTERMOST = 0.001  # shares beyond are drawn as this one: no table reaches all of a normal distribution


@dataclass(frozen=True)
class OffsetNames:
    """Fields of the offset that stands with the fixed wheel."""

    size: str
    direction: str

    @classmethod
    def of(cls, drive: Drive) -> OffsetNames:
        """Those of a drive, by the wheel that is fixed."""
        if drive.mounting.fixed == "rigid":
            return cls("tolerances.e_hb", "phases.phi_hb")
        return cls("tolerances.e_hg", "phases.phi_hg")


@dataclass(frozen=True, eq=False)
class Unknowns:
    """The offset and the rest of a drive.

    size_um, shape (sizes,), direction_deg, shape (directions,), evenly over the turn from 0, and how likely each is;
    paths: fields of the rest that are drawn.
    """

    drive: Drive
    names: OffsetNames
    size_um: Array
    size_weight: Array
    direction_deg: Array
    direction_weight: Array
    paths: tuple[str, ...]

    @classmethod
    def of(cls, drive: Drive) -> Unknowns:
        """Those of a drive. Raises UsageError where nothing is known of the size of the offset."""
        names = OffsetNames.of(drive)
        direction = np.arange(FINE_DIRECTIONS) * 360.0 / FINE_DIRECTIONS
        return cls(
            drive,
            names,
            *_sizes(drive, names.size),
            direction,
            _facing(drive, names.direction, direction),
            _paths(drive, names),
        )

    @property
    def widest(self) -> float:
        """Greatest size of the offset [um]."""
        return float(self.size_um[-1])

    def drawn(self, count: int, seed: int) -> list[dict[str, float]]:
        """Values of the rest, drawn evenly over what they may be; a single, empty draw where nothing is open."""
        if not self.paths:
            return [{}]
        return listed(self.rest(qmc.Sobol(len(self.paths), seed=seed).random(count)), count)

    def rest(self, shares: Array) -> dict[str, Array]:
        """Values of the rest by field, shape (draws,), from shares, shape (draws, paths)."""
        drawn = {}
        for path, share in zip(self.paths, shares.T, strict=True):
            value = self.drive.number(path)
            if self._open(path):
                drawn[path] = share * (WIDEST * value if path == "tolerances.e_hh" else 360.0)
            else:
                least = least_of(field_table()[path])
                drawn[path] = np.maximum(value + self.drive.uncertainty[path] / 2 * norm.ppf(share), least)
        return drawn

    def outermost(self) -> dict[str, float]:
        """Values of the rest that are greater than any drawn by shares up to 1 - OUTERMOST."""
        return listed(self.rest(np.full((1, len(self.paths)), 1 - OUTERMOST)), 1)[0]

    @property
    def circular(self) -> NDArray[np.bool_]:
        """Which of size, direction, rest begin again: angles of which nothing is known."""
        rest = [self._open(path) and path != "tolerances.e_hh" for path in self.paths]
        return np.array([False, self.names.direction not in self.drive.uncertainty, *rest])

    def values(self, shares: Array) -> dict[str, Array]:
        """Values by field of size, direction, rest, from shares, shape (draws, 2 + paths)."""
        inner = np.clip(shares, OUTERMOST, 1 - OUTERMOST)
        size = np.interp(shares[:, 0], *_edges(self.size_um, self.size_weight))
        first = int(np.argmin(self.direction_weight)) if not self.circular[1] else 0
        around = self.direction_deg + self.direction_deg[first]  # from the least likely one on
        direction = np.interp(shares[:, 1], *_edges(around, np.roll(self.direction_weight, -first)))
        return {
            self.names.size: np.clip(size, 0, self.widest),
            self.names.direction: direction % 360,
            **self.rest(inner[:, 2:]),
        }

    def _open(self, path: str) -> bool:
        return path not in self.drive.uncertainty


def listed(values: dict[str, Array], count: int) -> list[dict[str, float]]:
    """Draws one by one from arrays of them."""
    return [{path: float(column[k]) for path, column in values.items()} for k in range(count)]


def _edges(centres: Array, weight: Array) -> tuple[Array, Array]:
    """Shares at the edges between evenly spaced centres, and the edges."""
    half = (centres[1] - centres[0]) / 2
    shares = np.concatenate([[0.0], np.cumsum(weight)])
    return shares / shares[-1], np.append(centres - half, centres[-1] + half)


def _paths(drive: Drive, names: OffsetNames) -> tuple[str, ...]:
    measured = {path for path in drive.uncertainty if path not in (names.size, names.direction)}
    if not drive.tolerances.e_hh and not any(drive.uncertainty[path] for path in measured):
        return ()
    return tuple(sorted({"tolerances.e_hh", "phases.phi_hh"} | measured))


def _sizes(drive: Drive, path: str) -> tuple[Array, Array]:
    """Sizes of the offset [um] and how likely each is."""
    value, uncertainty = float(drive.value(path)), drive.uncertainty.get(path)
    if uncertainty is None:
        if not value > 0:
            raise UsageError(
                f"nothing is known of the size of the cam offset {path}",
                f"--set {path}=80 says that up to {WIDEST:g} times 80 um are likely",
            )
        return np.linspace(0, WIDEST * value, FINE_SIZES), np.full(FINE_SIZES, 1 / FINE_SIZES)
    size = np.linspace(0, max(value + 2 * uncertainty, NARROWEST), FINE_SIZES)
    # no narrower than the grid can show
    weight = norm.pdf(size, value, max(uncertainty / 2, size[1] / 2))
    return size, weight / weight.sum()


def _facing(drive: Drive, path: str, direction: Array) -> Array:
    """How likely each direction [deg] of the offset is."""
    uncertainty = drive.uncertainty.get(path)
    if uncertainty is None:
        return np.full(len(direction), 1 / len(direction))
    away = (direction - float(drive.value(path)) + 180) % 360 - 180
    weight = norm.pdf(away, 0, max(uncertainty / 2, 180 / len(direction)))
    return np.asarray(weight / weight.sum())
