"""Arrays of finite numbers, with their verification, in the user's cache folder."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Annotated, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter

from hdassist.run.kept import kept_answer

_ProofT = TypeVar("_ProofT")
_ITEM_SIZE = np.dtype(float).itemsize


def kept_array(
    kind: str,
    depends: object,
    shape: tuple[int, ...],
    proof_type: type[_ProofT],
    compute: Callable[[], tuple[NDArray[np.float64], _ProofT]],
) -> tuple[NDArray[np.float64], _ProofT]:
    """Return an array and its verification from the cache, or compute and store them.

    Args:
        kind: kind of the result, which is part of its name in the cache.
        depends: everything that determines the result, as JSON.
        shape: shape of the array.
        proof_type: type of the verification.
        compute: function that returns the array and its verification.
    """

    def computed_bytes() -> tuple[bytes, _ProofT]:
        array, proof = compute()
        return array.tobytes(), proof

    size = prod(shape) * _ITEM_SIZE
    data_type = Annotated[bytes, Field(min_length=size, max_length=size), AfterValidator(_require_finite)]
    adapter: TypeAdapter[tuple[bytes, _ProofT]] = TypeAdapter(
        tuple[data_type, proof_type],  # type: ignore[valid-type]
        config=ConfigDict(ser_json_bytes="base64", val_json_bytes="base64"),
    )
    data, proof = kept_answer(kind, depends, adapter, computed_bytes)
    return np.frombuffer(data).reshape(shape), proof


def _require_finite(data: bytes) -> bytes:
    if not np.isfinite(np.frombuffer(data)).all():
        raise ValueError("expected finite numbers")
    return data
