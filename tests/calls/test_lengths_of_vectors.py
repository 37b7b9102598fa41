"""Small vectors go straight to the formulas, but not those of another length."""

from typing import Any

import pytest

import liemech as lm
from liemech.errors import InvalidInput

XI6 = lm.SE3().log(lm.SE3().exp(lm.vec(0.1, 0.2, 0.3, 1.0, 2.0, 3.0)))
CASES: dict[str, Any] = {
    "SO3.exp: xi": lambda: lm.SO3().exp(XI6),
    "GL.cayley: xi": lambda: lm.GL(2).cayley(lm.vec(1.0, 1.0, 1.0, 1.0, 1.0)),
    "SO3Algebra.bracket: eta": lambda: lm.SO3().algebra.bracket(lm.vec(1.0, 2.0, 3.0), XI6),
    "SO3.Ad: g": lambda: lm.SO3().Ad(lm.SE3().identity(), lm.vec(1.0, 2.0, 3.0)),
    "Exponential.tau: xi": lambda: lm.Exponential().tau(lm.SO3(), XI6),
}


@pytest.mark.parametrize("where", CASES)
def test_they_are_refused_by_name(where: str) -> None:
    with pytest.raises(InvalidInput, match=where.replace(".", r"\.") + r" has shape .* must be"):
        CASES[where]()
