"""Von Neumann's equation for the density matrix of a quantum system with n levels."""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, Vec, dot, record
from ...groups.matrices.classical import U
from ...systems.hamiltonian import Hamiltonian
from ...systems.lagrangian import Lagrangian
from ...systems.lie_poisson import BodyState, LiePoissonSystem
from ..input_checks import positive_number


@record
class ExpectedEnergy(Hamiltonian):
    """A linear energy, <mu, xi>, of which the velocity xi is constant.

    rate : xi, (dim,).
    """

    rate: Vec

    def energy(self, mu: Vec) -> float:
        """<mu, xi>.  mu : (dim,)."""
        return dot(self.rate, mu)

    def gradient(self, mu: Vec) -> Vec:
        """The constant velocity xi = dE/dmu.  mu : (dim,)."""
        return self.rate + 0.0 * mu


@record
class VonNeumann(LiePoissonSystem):
    """Von Neumann's equation, i hbar rho' = [H, rho], a Lie-Poisson system on u(n)*.

    energies : the Hamiltonian H, (n, n) hermitian, or (n,) its levels, n at least 2.  hbar : in the same
    units.
    The momentum is that of the matrix i rho; `density` goes back.  The element of U(n) is the evolution
    backwards: g' = g (i H/hbar), g = exp(i H t/hbar).

    Conserved: the populations, which are the eigenvalues of rho, so the purity tr rho^2 and von Neumann's
    entropy; and the expected energy tr (rho H).  `exact` is the motion in closed form.

    Source: Breuer and Petruccione, The Theory of Open Quantum Systems, section 3.1.
    """

    called: ClassVar[str] = "levels"

    group: U = field(init=False, repr=False)
    hamiltonian: ExpectedEnergy = field(init=False, repr=False)
    lagrangian: Lagrangian | None = field(init=False, repr=False, default=None)
    energies: Any
    hbar: float = 1.0

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self.energies)} levels, hbar={self.hbar!r})"

    def __post_init__(self) -> None:
        h = np.array(self.energies)
        h = np.diag(h) if h.ndim == 1 else h
        if h.ndim != 2 or h.shape[0] != h.shape[1] or len(h) < 2:
            raise InvalidInput(f"VonNeumann: energies has shape {h.shape}; it must be (n, n) or (n,), n >= 2")
        require_hermitian("VonNeumann: energies", h)
        hbar = positive_number("VonNeumann: hbar", self.hbar)
        group = U(len(h))
        xi = group.generated.vee(1j * h.astype(complex) / hbar)
        for name, value in (
            ("group", group),
            ("hamiltonian", ExpectedEnergy(Vec.of(np.asarray(xi).tolist()))),
            ("lagrangian", None),
            ("energies", Mat.of(h.astype(complex).tolist())),
        ):
            object.__setattr__(self, name, value)
        super().__post_init__()

    def of_density(self, rho: Any, g: Any = None) -> BodyState:
        """The state with this density matrix.  rho : (n, n), hermitian, or a state vector (n,).

        Raises InvalidInput for others, and a trace that is not 1.
        """
        rho = np.array(rho, dtype=complex)
        rho = np.outer(rho, rho.conj()) if rho.ndim == 1 else rho
        n = self.group.n
        if rho.shape != (n, n):
            raise InvalidInput(f"VonNeumann.of_density: rho has shape {rho.shape}; it must be ({n}, {n})")
        require_hermitian("VonNeumann.of_density: rho", rho)
        if not abs(np.trace(rho).real - 1.0) <= 1e-9:
            raise InvalidInput(f"VonNeumann.of_density: the trace of rho is {np.trace(rho).real:g}; it must be 1")
        return self.state(np.asarray(self.group.generated.pairing(1j * rho)), g)

    def density(self, mu: Any) -> np.ndarray:
        """rho.  mu : (..., n^2); (..., n, n)."""
        return np.asarray(-1j * self.group.generated.covector(np.asarray(mu, dtype=float)))

    def populations(self, mu: Any) -> np.ndarray:
        """The eigenvalues of rho, from below.  mu : (..., n^2); (..., n)."""
        return np.linalg.eigvalsh(self.density(mu))

    def exact(self, start: BodyState, t: float) -> np.ndarray:
        """rho at the time t, U rho_0 U^H with U = exp(-i H t/hbar).  (n, n)."""
        values, vectors = np.linalg.eigh(np.array(self.energies))
        u = (vectors * np.exp(-1j * values * t / self.hbar)) @ vectors.conj().T
        return np.asarray(u @ self.density(np.asarray(start.mu)) @ u.conj().T)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Energy, populations, and the spatial momentum if the element is known."""
        mu, g = states["mu"], states.get("g")
        constants = {"energy": np.asarray(self.energy(mu)), "populations": self.populations(mu)}
        if g is None:
            return constants
        return constants | {"spatial momentum": np.asarray(self.spatial_momentum(mu, g))}


def require_hermitian(name: str, h: np.ndarray, must: str = "must be hermitian") -> None:
    """Raise InvalidInput unless a matrix is hermitian to rounding.  must : what the message says of it."""
    off = np.abs(h - h.conj().T)
    if not (off <= 1e-12 * np.abs(h).max()).all():
        i, j = (int(k) for k in np.unravel_index(int(off.argmax()), off.shape))
        raise InvalidInput(f"{name} {must}: [{i}, {j}] is {h[i, j]:.6g}, [{j}, {i}] is {h[j, i]:.6g}")
