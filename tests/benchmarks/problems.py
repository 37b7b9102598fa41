"""The problems that packages are compared on: free rigid bodies, and a heavy top."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from peers import Problem

import liemech as lm

REFERENCE: dict[str, Any] = json.loads((Path(__file__).parents[1] / "reference" / "heavy_top.json").read_text())
"""A top that is neither Lagrange's nor Kovalevskaya's, at a few times, in 22 digits."""


def numbers(name: str, data: Any = REFERENCE) -> np.ndarray:
    """An entry of the reference."""
    return np.array(data[name], dtype=float)


def top(name: str, *times: float) -> Problem:
    """The top of the reference."""
    x, y, z, w = np.array(lm.SO3().quaternion(numbers("R0"))).tolist()
    load = numbers("mgl") * numbers("chi")
    return Problem(name, tuple(numbers("J")), tuple(numbers("pi0")), times, tuple(load), (w, x, y, z), pace=4.0)


MU = (0.5, 0.0, math.sqrt(0.75))
BODY = Problem("free body, J = (1, 1.5, 2), t = 100", (1.0, 1.5, 2.0), MU, (100.0,))
FLAT = Problem("free body, J = (2/3, 1, 2), t = 100", (2 / 3, 1.0, 2.0), MU, (100.0,))
TOP = top("heavy top, t = 10", 10.0)
PROBLEMS = (BODY, FLAT, TOP)
