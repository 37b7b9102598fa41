"""The generator of random points."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...errors import InvalidInput, InvalidType


def generator(what: str, seed: Any) -> np.random.Generator:
    """The generator of a seed, a whole number from 0 on.  what : the function that was called."""
    if isinstance(seed, (bool, np.bool_)) or not isinstance(seed, (int, np.integer)):
        raise InvalidType(f"{what}: seed must be a whole number; got {seed!r}")
    if seed < 0:
        raise InvalidInput(f"{what}: seed must be 0 or larger; got {seed}")
    return np.random.default_rng(int(seed))
