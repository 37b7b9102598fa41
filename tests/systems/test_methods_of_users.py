"""Methods that a user's class writes in another way than its base is called are refused where the
class or the system is first made, with what to write instead.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import liemech as lm
from liemech.errors import InvalidInput, InvalidType


def _hamiltonian(**methods: Any) -> Any:
    cls = type("Mine", (lm.Hamiltonian,), {"energy": lambda self, mu: 0.5 * lm.dot(mu, mu), **methods})
    return lm.LiePoissonSystem(lm.SO3(), lm.record(cls)())


def _separable(**methods: Any) -> Any:
    both = {"kinetic": lambda self, p: 0.5 * lm.dot(p, p), "potential": lambda self, q: q[0] ** 2}
    cls = type("Mine", (lm.SeparableSystem,), {"degrees": 2, **both, **methods})
    return lm.record(cls)()


def _field(energy: Callable[..., Any]) -> Any:
    cls = type("Mine", (lm.Potential,), {"energy": energy})
    body: Any = lm.RigidBody([1.0, 1.5, 2.0])
    system: Any = lm.MechanicalSystem
    return system(body, lm.record(cls)())


def _forgotten(self: Any, mu: Any) -> Any:
    lm.dot(mu, mu)


def _on_one_way(self: Any, mu: Any) -> Any:
    if mu[0] > 5.0:
        return 1.0


WRONG = {
    "another argument": (lambda: _hamiltonian(energy=lambda self, t, mu: t), r"write `def energy\(self, mu\)`; .*driven"),
    "no argument": (lambda: _hamiltonian(energy=lambda self: 1.0), r"write `def energy\(self, mu\)`"),
    "a forgotten return": (lambda: _hamiltonian(energy=_forgotten), "returns nothing: end it with `return"),
    "a return on one way": (lambda: _hamiltonian(energy=_on_one_way), "got None: end every way"),
    "a vector for a number": (lambda: _hamiltonian(energy=lambda self, mu: 0.5 * mu * mu), r"a number; got Vec.*lm.dot"),
    "a number for a vector": (lambda: _hamiltonian(gradient=lambda self, mu: 2.0), r"must return a vector.*lm.vec"),
    "a matrix for a number": (lambda: _field(lambda self, g: g), "Mine.energy must return a number; got Mat"),
    "a potential that is a vector": (lambda: _separable(potential=lambda self, q: q), "Mine.potential must return a number"),
    "a potential of time": (lambda: _separable(potential=lambda self, t, q: t), "DrivenHamiltonianSystem"),
    "an argument by name only": (
        lambda: _hamiltonian(energy=lambda self, *, mu: mu[0]),
        r"Mine.energy takes \(self, \*, mu\).*write `def energy\(self, mu\)`",
    ),
    "one more by name only": (
        lambda: _hamiltonian(energy=lambda self, mu, *, scale: scale * mu[0]), r"takes \(self, mu, \*, scale\)"
    ),
    "a generator": (lambda: _hamiltonian(energy=lambda self, mu: (yield mu[0])), "Mine.energy yields.*`return"),
    "a potential of nothing": (lambda: _separable(potential=_forgotten), "Mine.potential returns nothing"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_refused_where_the_system_is_made(what: str) -> None:
    made, words = WRONG[what]
    with pytest.raises(InvalidType, match=words):
        made()


@pytest.mark.compiled
def test_arrays_and_lists_are_vectors_where_a_vector_belongs() -> None:
    """The same bits as `lm.vec`, plain and native."""
    written: list[Callable[..., Any]] = [
        lambda self, mu: lm.vec(mu[0], 2.0 * mu[1], mu[2]),
        lambda self, mu: np.array([mu[0], 2.0 * mu[1], mu[2]]),
        lambda self, mu: [mu[0], 2.0 * mu[1], mu[2]],
    ]
    found = []
    for gradient in written:
        system = _hamiltonian(gradient=gradient, energy=lambda self, mu: 0.5 * lm.dot(mu, lm.vec(1.0, 2.0, 1.0) * mu))
        for compiled in (False, True):
            run = lm.integrate(
                system, lm.RKMK(order=2), system.state(mu=[0.1, 0.2, 0.3]), h=0.1, steps=20, compiled=compiled
            )
            found.append(run.mu.tobytes())
    assert len(set(found)) == 1


def test_more_arguments_with_values_of_their_own_are_welcome() -> None:
    def by_name(self: Any, mu: Any, *, scale: float = 2.0) -> Any:
        return scale * lm.dot(mu, mu)

    for energy in (lambda self, mu, scale=2.0: scale * lm.dot(mu, mu), by_name):
        system = _hamiltonian(energy=energy)
        assert list(system.velocity(lm.vec(1.0, 0.0, 0.0))) == [4.0, 0.0, 0.0]


class _Ring(lm.ConstrainedSystem):
    degrees: ClassVar[int] = 2

    def energy(self, q: Any, p: Any) -> Any:
        return 0.5 * lm.dot(p, p)

    def constraint(self, q: Any) -> Any:
        return lm.dot(q, q) - 1.0


def test_a_constraint_is_a_vector() -> None:
    with pytest.raises(InvalidType, match=r"_Ring.constraint must return a vector.*lm.vec"):
        lm.record(_Ring)()


@pytest.mark.parametrize(
    ("g", "words"), [([1.0, 0.0, 0.0, 0.0], r"UnitQuaternions\(\).matrix"), ([0.0, 0.0, 1.0], r"SO3\(\).exp\(v\)")]
)
def test_rotations_given_in_another_way(g: list[float], words: str) -> None:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    with pytest.raises(InvalidInput, match=words):
        body.state(mu=[0.1, 0.2, 0.3], g=g)
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5])
    quaternions = lm.RigidBody([1.0, 1.5, 2.0], group=lm.UnitQuaternions())
    with pytest.raises(InvalidInput, match=r"from_matrix\(r.as_matrix\(\)\)"):
        quaternions.state(mu=[0.1, 0.2, 0.3], g=turn)
    q = turn.as_quat()
    as_told = np.array(lm.UnitQuaternions().matrix(q))
    assert np.allclose(as_told, turn.as_matrix(), atol=1e-15)
    back = np.array(lm.UnitQuaternions().from_matrix(turn.as_matrix()))
    assert np.allclose(abs(back @ q), 1.0, atol=1e-15)


def test_names_that_are_nearly_right() -> None:
    for wrong, right in (
        ("Rattle", "RATTLE"),
        ("rigid_body", "RigidBody"),
        ("LieVerlett", "LieVerlet"),
        ("heavy_top", "models.HeavyTop"),
    ):
        with pytest.raises(AttributeError, match=rf"Did you mean lm.{right}\?"):
            getattr(lm, wrong)
    with pytest.raises(AttributeError, match=r"no attribute 'zzzzzz'$"):
        _ = lm.zzzzzz


def test_numbers_of_the_sites_as_an_array_are_told_what_they_are() -> None:
    """An array is a vector that all sites have, of which no energy of a pair can be made by a product."""

    @lm.record
    class Weighted(lm.Term):
        def energy(self, a: Any, b: Any) -> float:
            return -a.weight * b.weight * lm.dot(a.mu, b.mu)

    ring, weights = lm.neighbours.ring(4), np.array([1.0, 2.0, 3.0, 4.0])
    with pytest.raises(InvalidType, match=r"a number for each site or edge is lm\.each\(values\)"):
        lm.LiePoissonSystem(lm.SO3() ** 4, lm.Terms(Weighted().over(ring), weight=weights))
    system = lm.LiePoissonSystem(lm.SO3() ** 4, lm.Terms(Weighted().over(ring), weight=lm.each(weights)))
    assert system.energy(np.ones(12)) == -3.0 * (2.0 + 6.0 + 12.0 + 4.0)
