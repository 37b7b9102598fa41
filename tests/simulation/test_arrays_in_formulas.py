"""A formula that gives NumPy arrays where numbers belong is a mistake in the program."""

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidType

wrong = False


@lm.record
class Energy(lm.Hamiltonian):
    def energy(self, mu: lm.Vec) -> float:
        return lm.dot(mu, mu)

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        return lm.vec(np.array([mu[0], 0.0]) if wrong else 2.0 * mu[0], 2.0 * mu[1], 2.0 * mu[2])


@pytest.mark.parametrize("steps", [{"h": 0.1, "steps": 3}, {"t_end": 1.0, "rtol": 1e-6}])
@pytest.mark.parametrize("bodies", [None, 2])
def test_it_is_raised_and_stops_no_body_as_if_a_step_had_failed(
    steps: dict[str, Any], bodies: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    system = lm.LiePoissonSystem(lm.SO3(), Energy())
    start = system.state([0.3, 0.8, -0.5] if bodies is None else np.ones((bodies, 3)))
    monkeypatch.setitem(globals(), "wrong", True)
    with pytest.raises(InvalidType, match=r"NumPy array where a number belongs, write liemech.vec"):
        lm.integrate(system, lm.RKMK(order=5), start, **steps, compiled=False)


def test_a_public_function_names_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    energy = Energy()
    monkeypatch.setitem(globals(), "wrong", True)
    with pytest.raises(InvalidType, match=r"Energy.gradient gave .*numbers, vectors, matrices"):
        energy.gradient([0.3, 0.8, -0.5])


@lm.record
class Field(lm.GroupEquation):
    strength: float

    def velocity(self, t: float, g: Any) -> Any:
        return AXIS * np.cos(self.strength * t)


AXIS = np.array([0.0, 0.6, 0.8])


def test_an_array_for_a_vector_says_what_to_write() -> None:
    equation = Field(lm.SO3(), 2.0)
    with pytest.raises(InvalidType, match=r"given a NumPy array.* liemech.vec\(\*B\) \* x for B \* x"):
        lm.integrate(
            equation, lm.RKMK(order=4), equation.state(np.eye(3)), h=0.1, steps=2, compiled=False
        )
