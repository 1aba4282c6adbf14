"""cvxpy, started without scipy.stats: import it from here.

cvxpy asks scipy.stats for one function, the entropy in an atom that no quadratic programme has, and that import is two
fifths of the start of cvxpy: 0.3 s of the 3 s that `hdassist check vzp160` takes. So a stand-in is there while cvxpy
starts; it hands out that function, which loads scipy.stats when it is called, and is gone afterwards.
"""

from __future__ import annotations

import sys
from importlib import import_module
from types import ModuleType
from typing import Any

STATISTICS = "scipy.stats"


class _StandIn(ModuleType):
    """scipy.stats as far as cvxpy needs it; gives way to the real one should anything else be asked for."""

    @staticmethod
    def entropy(*arguments: Any, **options: Any) -> Any:
        """scipy.stats.entropy, loaded now."""
        return import_module(STATISTICS).entropy(*arguments, **options)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        _withdraw()
        return getattr(import_module(STATISTICS), name)


def _withdraw() -> None:
    if isinstance(sys.modules.get(STATISTICS), _StandIn):
        del sys.modules[STATISTICS]


if "cvxpy" not in sys.modules:
    sys.modules.setdefault(STATISTICS, _StandIn(STATISTICS))
try:
    import cvxpy as cp
finally:
    _withdraw()

__all__ = ["cp"]
