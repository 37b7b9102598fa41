"""Hamiltonians on the dual of a Lie algebra."""

from __future__ import annotations

from ..native import Record, Vec, record


@record
class Hamiltonian(Record):
    """The energy of a body as a function of its momentum, H(mu).

    A subclass writes `energy` and `gradient`; its fields are the parameters (`float`, `Vec`, `Mat` or other records).
    """

    def energy(self, mu: Vec) -> float:
        """H(mu).  mu : (dim,)."""
        raise NotImplementedError(f"{type(self).__name__} must define `energy`")

    def gradient(self, mu: Vec) -> Vec:
        """The velocity xi = dH/dmu.  mu : (dim,)."""
        raise NotImplementedError(f"{type(self).__name__} must define `gradient`")
