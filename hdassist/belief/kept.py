"""Draws kept in the user's cache, so that the next command on the same drive goes on from them.

They are found by all that they depend on: values of the drive and ranges of its prior, torques, turns, evidence, seed,
the source of what computes them and the machine's instructions, on which the last digits depend. What is read is
checked as work from anywhere is; whatever does not hold is drawn anew.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import astuple, dataclass
from functools import cache, cached_property
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from pydantic import TypeAdapter

from hdassist.belief.evidence import ACCURACY, STIFFNESS_FIGURES, Evidence
from hdassist.belief.prior import DrivePrior
from hdassist.run.cache import cached, keep, keeps_samples
from hdassist.run.kept import ClosedRecord, Count, Magnitude, Number
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.certificate import Residual
from hdassist.solve.walk import library

KIND = "samples"
# of a preset, what no draw depends on: words, limits; the prior stands in the key by itself
BESIDE = {"name", "description", "acceptance", "cost", "source", "uncertainty"}


@dataclass(frozen=True)
class Draw(ClosedRecord):
    """One draw: why it is no drive, or its predictions, F'_ior [arcsec] (None where weeded), weight and proof.

    F_ior_arcsec, at each torque; turned_arcsec, at each torque with each turn; proof: states, residuals, fallbacks.
    """

    refused: str = ""
    figures: Mapping[str, Number] | None = None
    F_ior_arcsec: tuple[Magnitude, ...] | None = None
    turned_arcsec: tuple[tuple[Magnitude, ...], ...] | None = None
    weight: Magnitude = 0.0
    proof: tuple[Count, Residual, Residual, Residual, Residual, Count] = astuple(EMPTY)

    @property
    def certificate(self) -> Certificate:
        """Proof of the states behind it."""
        return Certificate(*self.proof)

    def holds(self, torques: int, turns: int, evidence: Sequence[Evidence]) -> bool:
        """Whether it can be a draw at so many torques and turns, weeded by evidence."""
        figures = frozenset(self.figures or ())
        needed = frozenset(STIFFNESS_FIGURES if any(each.figure != ACCURACY for each in evidence) else ())
        if self.F_ior_arcsec is None:
            is_weeded = not self.refused and figures == needed != frozenset()
            is_refused = bool(self.refused) and self.figures is None
            return (is_weeded or is_refused) and self.turned_arcsec is None and not self.weight
        turned = self.turned_arcsec or ()
        shape = len(self.F_ior_arcsec), len(turned), {len(each) for each in turned} - {turns}
        return not self.refused and shape == (torques, torques, set()) and figures >= needed and self.proof[0] > 0


_DRAWS = TypeAdapter(list[Draw])


@dataclass(frozen=True)
class KeptDraws:
    """Where the draws of samples are kept, by all that they depend on.

    torques [N*m]; rotations_deg; evidence; further: what figures beside F'_ior they have, in words; seed.
    """

    prior: DrivePrior
    torques: tuple[float, ...]
    rotations_deg: tuple[float, ...]
    evidence: tuple[Evidence, ...]
    further: str
    seed: int

    def read(self) -> list[Draw]:
        """The draws that are kept, from the first on; none where not all of them hold."""
        data = cached(KIND, self._key) if keeps_samples() else None
        with suppress(ValueError, RecursionError):
            draws = _DRAWS.validate_python(json.loads(data or b"[]"))
            sizes = len(self.torques), len(self.rotations_deg), self.evidence
            figures = {frozenset(each.figures or ()) for each in draws if each.F_ior_arcsec is not None}
            if len(figures) <= 1 and all(each.holds(*sizes) for each in draws):
                return draws
        return []

    def keep(self, draws: Sequence[Draw]) -> None:
        """Keep draws, from the first on."""
        if keeps_samples():
            with suppress(ValueError):  # a number that is none
                keep(KIND, self._key, json.dumps(_DRAWS.dump_python(list(draws)), allow_nan=False).encode())

    @cached_property
    def _key(self) -> str:
        depends = {
            "drive": self.prior.drive.model_dump(mode="json", exclude=BESIDE),
            "fields": [[each.path, each.distribution, each.low, each.high] for each in self.prior.fields],
            "torques": self.torques,
            "rotations": self.rotations_deg,
            "evidence": [astuple(each) for each in self.evidence],
            "further": self.further,
            "seed": self.seed,
            "program": _program(),
        }
        return sha256(json.dumps(depends, sort_keys=True).encode()).hexdigest()


@cache
def _program() -> list[str]:
    """What computes: source, versions of the packages, engine and machine."""
    source = sha256()
    for path in sorted(Path(__file__).parents[1].glob("*/*.[cp]*")):
        source.update(path.read_bytes())
    packages = [f"{name} {version(name)}" for name in ("numpy", "scipy", "daqp", "pydantic")]
    kernels = [f"{name}={text}" for name, text in sorted(os.environ.items()) if name.startswith("OPENBLAS_")]
    return [source.hexdigest(), *packages, *kernels, library()[1], platform.platform(), platform.python_version()]
