"""A user's program with types, which mypy reads with the library: constructors ask for what they take, and for no more."""

from __future__ import annotations

from typing import Any

import numpy as np

import liemech as lm


@lm.record
class Gyrostat(lm.Hamiltonian):
    inertia: lm.Vec
    rotor: lm.Vec

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * lm.dot(mu - self.rotor, (mu - self.rotor) / self.inertia)


@lm.record
class Exchange(lm.Term):
    J: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.J * lm.dot(a.mu, b.mu)


@lm.record
class Zeeman(lm.Term):
    B: lm.Vec

    def energy(self, a: Any) -> float:
        return -lm.dot(self.B, a.mu)


def many() -> list[lm.Trajectory]:
    lattice = lm.neighbours.ring(3)
    energy = lm.Terms(Exchange(1.0).over(lattice), Zeeman([0.0, 0.0, 0.1]))
    spins = lm.LiePoissonSystem(lm.SO3() ** lattice.sites, energy)
    start = spins.state(mu=np.eye(3))
    masses = lm.each([[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]])
    bodies = lm.LiePoissonSystem(lm.VectorSpace(3) ** 2, lm.PerSite(lm.KineticEnergy(masses)))
    pull = lm.models.Gravity().over(lm.neighbours.all_pairs())
    pair = lm.MechanicalSystem(bodies, lm.Terms(pull, mass=lm.each([1.0, 2.0])))
    water = lm.models.SPC()
    molecules = lm.LiePoissonSystem(lm.SE3() ** 2, lm.PerSite(water.kinetic_energy))
    drop = lm.MechanicalSystem(molecules, lm.Terms(water.over(lm.neighbours.within(9.0, box=[18.6] * 3))))
    print(drop)
    return [
        lm.integrate(spins, lm.RKMK(order=4), start, h=0.1, steps=10),
        lm.integrate(pair, lm.KickDrift(), pair.state(mu=np.zeros((2, 3)), g=np.eye(3)[:2]), h=0.1, steps=10),
    ]  # fmt: skip


def runs() -> list[lm.Trajectory]:
    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.0, 0.7], g=np.eye(3))
    top = lm.models.HeavyTop([1.0, 1.2, 0.6], 1.0, [0.0, 0.0, 0.5])
    pendulum, orbit = lm.SphericalPendulum(length=1.0), lm.Kepler()
    gyrostat = lm.LiePoissonSystem(lm.SO3(), Gyrostat(lm.vec(1.0, 2.0, 3.0), lm.vec(0.0, 0.0, 0.7)))
    return [
        lm.integrate(body, lm.CovariantVariational(lm.Cayley()), start, h=0.1, steps=10),
        lm.integrate(top, lm.LieVerlet(), top.state([0.1, 0.2, 3.0], np.eye(3)), h=0.01, steps=10),
        lm.integrate(pendulum, lm.RATTLE(), pendulum.state([1.0, 0.0, 0.0], [0.0, 0.5, 0.3]), h=0.01, steps=10),
        lm.integrate(orbit, lm.StormerVerlet(), orbit.state([1.0, 0.0], [0.0, 1.0]), h=0.01, steps=10),
        lm.Plan(gyrostat, lm.RKMK(order=4), h=0.1).run(gyrostat.state([0.1, 0.2, 0.3], np.eye(3)), steps=10),
    ]  # fmt: skip


if __name__ == "__main__":
    print([run.drift() for run in [*runs(), *many()]])
