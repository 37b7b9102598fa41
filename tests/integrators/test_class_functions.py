"""Class functions on groups, from which Hamilton-Jacobi methods of the first kind begin."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.rooms.hamilton_jacobi.class_functions import CayleySquare, InvariantForm


@pytest.mark.parametrize("size", [1e-9, 0.3, 4.0, 1e5])
def test_a_turn_by_cayley_has_its_momentum(size: float) -> None:
    """xi = turn of (1 + |xi|^2/4) xi."""
    xi = size * np.array([0.6, -0.48, 0.64])
    s, given = CayleySquare(), (lm.SO3(), lm.Cayley())
    found = np.array(s.turn(*given, s.momentum(*given, lm.vec(*xi))))
    assert np.abs(found - xi).max() < 4e-15 * size


def test_a_form_that_is_not_symmetric_is_no_class_function() -> None:
    form = np.eye(3) + 1e-3 * np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    body = lm.RigidBody([1.0, 1.6, 2.3])
    method = lm.FirstKindHamiltonJacobi(2, s0=InvariantForm(form))
    with pytest.raises(lm.errors.LiemechError, match="is not symmetric"):
        lm.integrate(body, method, body.state([0.3, 0.2, 0.9], np.eye(3)), h=0.1, steps=1)
