"""Energies of spins on lattices, as their books write them."""

from __future__ import annotations

from typing import Any

import liemech as lm


@lm.record
class Exchange(lm.Term):
    """Heisenberg's energy of two neighbours."""

    J: float

    def energy(self, a: Any, b: Any) -> float:
        return -self.J * lm.dot(a.mu, b.mu)


@lm.record
class Twist(lm.Term):
    """Of Dzyaloshinskii and Moriya: a and b are not alike."""

    D: lm.Vec

    def energy(self, a: Any, b: Any) -> float:
        return lm.dot(self.D, lm.cross(a.mu, b.mu))


@lm.record
class Chiral(lm.Term):
    """The volume that three spins span."""

    K: float

    def energy(self, a: Any, b: Any, c: Any) -> float:
        return self.K * lm.dot(a.mu, lm.cross(b.mu, c.mu))


@lm.record
class Zeeman(lm.Term):
    """A field that is the same everywhere."""

    B: lm.Vec

    def energy(self, a: Any) -> float:
        return -lm.dot(self.B, a.mu)


@lm.record
class Biquadratic(lm.Term):
    K: float

    def energy(self, a: Any, b: Any) -> float:
        return self.K * lm.dot(a.mu, b.mu) ** 2
