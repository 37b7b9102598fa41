"""Boris' method: its equation, its claims, and that volumes are all it keeps."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm
from liemech.formulas import jacobian


@lm.record
class Well(lm.Hamiltonian):
    def energy(self, x: lm.Vec) -> float:
        return x[0] ** 3 - x[1] ** 3 + 0.2 * x[0] ** 4 + x[1] ** 4 + x[2] ** 4


FIELD = lm.models.TokamakField()
FREE, DRIVEN = lm.models.ChargedParticle(FIELD), lm.models.ChargedParticle(FIELD, Well())
Y = np.array([1.05, 0.1, -0.2, 0.3, 0.5, -0.4])
H = 0.2


def stepped(system: lm.models.ChargedParticle, y: np.ndarray, h: float) -> np.ndarray:
    return np.array(lm.Boris().step(system, 0.0, system.state(y), h).y)


def test_the_equation_of_boris() -> None:
    """(v' - v)/h = E(m) + (v' + v)/2 x B(m) at m = x + h v/2, x' = m + h v'/2."""
    new = stepped(DRIVEN, Y, H)
    (x, v), (x1, v1) = Y.reshape(2, 3), new.reshape(2, 3)
    m = x + H * v / 2
    electric = -np.array(Well().gradient(lm.vec(*m)))
    assert np.allclose((v1 - v) / H, electric + np.cross((v1 + v) / 2, FIELD.at(m)), atol=1e-14)
    assert np.allclose(x1, m + H * v1 / 2, atol=1e-15)


@pytest.mark.slow
def test_claims() -> None:
    lm.check_method(lm.Boris(), DRIVEN, DRIVEN.state(Y), compiled=False)


def test_it_keeps_volumes_and_is_no_poisson_map() -> None:
    slopes = jacobian(lambda y: lm.Boris().step(DRIVEN, 0.0, lm.PoissonState(y), H).y, lm.vec(*Y))
    assert abs(np.linalg.det(np.array(slopes)) - 1.0) < 1e-13
    assert lm.poisson_defect(lm.Boris(), DRIVEN, DRIVEN.state(Y), H) > 1e-5
    speed = [np.linalg.norm(y[3:]) for y in (Y, stepped(FREE, Y, H))]
    assert speed[1] == pytest.approx(speed[0], rel=1e-15)


def test_other_systems_are_refused() -> None:
    with pytest.raises(lm.errors.IncompatibleSystem, match="needs a system with a magnetic_field; LotkaVolterra"):
        lm.Boris().require(lm.models.LotkaVolterra())
