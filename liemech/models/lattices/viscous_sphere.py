"""Viscous flow on the sphere by Zeitlin's truncation."""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput, require
from ...formulas import Vec, record
from ...formulas.large_maps import LinearMap
from ...rooms.noise.dissipative import Dissipative
from ...systems.lie_poisson import BodyState
from .zeitlin_sphere import ZeitlinSphere, laplacian_matrix


@record
class ViscousSphere(Dissipative):
    """The equations of Navier and Stokes on the unit sphere, by Zeitlin's truncation:

        omega' = {omega, psi} + nu (Delta + 2) omega,   F' = [F, Psi]/(i hbar) + nu (Delta_N + 2) F

    system : the flow without viscosity, a `ZeitlinSphere`.
    viscosity : nu, not negative, in rad^2/s.

    Viscosity alone damps harmonics of degree l by exp(-nu (l (l + 1) - 2) t), exactly; solid rotation, l = 1,
    is no strain and stays, and so does the beta term.  Energy and enstrophy fall, the angular momentum
    stays (of a rotating sphere along its axis).

    Raises InvalidInput for a negative viscosity, InvalidType for another system.
    Source: Gilbert, Riedinger, Thuburn, Q. J. Mech. Appl. Math. 67 (2014) 97 (the operator Delta + 2); Modin and
    Viviani, J. Fluid Mech. 884 (2020) A22 (the truncation).
    """

    called: ClassVar[str] = "sphere"

    system: ZeitlinSphere
    viscosity: float

    def __post_init__(self) -> None:
        super().__post_init__()
        require("ViscousSphere: system", self.system, ZeitlinSphere)
        if not 0.0 <= self.viscosity < np.inf:
            raise InvalidInput(f"ViscousSphere: viscosity is {self.viscosity!r}; it must be finite and not negative")

    @cached_property
    def diffusion(self) -> LinearMap:
        """Delta_N + 2 on matrices."""
        form = (self.system.n, self.system.n), True
        return LinearMap(laplacian_matrix(self.system.n, 2.0), form, form)

    @cached_property
    def fastest(self) -> float:
        """The rate at which viscosity damps the highest harmonics, nu (N (N - 1) - 2)."""
        return self.viscosity * (self.system.n * (self.system.n - 1.0) - 2.0)

    def damped(self, mu: Vec, t: float) -> Vec:
        """exp(nu t (Delta + 2)), summed up as a series, over times in which nothing is damped by more than e.

        mu : (N^2 - 1,).  Source: Higham, Functions of Matrices (2008), section 4.3 (the series).
        """
        algebra, pieces = self.system.group.algebra, 1.0
        while self.fastest * t > pieces:
            pieces = pieces + 1.0
        nu, largest, done = self.viscosity * t / pieces, self.fastest * t / pieces, 0.0
        while done < pieces:
            term = nu * self.diffusion(algebra.covector(mu))
            change, bound, k = term, largest, 1.0
            while bound > 2.0**-56 and k < 32.0:
                k = k + 1.0
                term = (nu / k) * self.diffusion(term)
                change, bound = change + term, bound * (largest / k)
            mu = mu + algebra.pairing(change)
            done = done + 1.0
        return mu

    def from_harmonics(self, coefficients: Any) -> BodyState:
        """The state with this absolute vorticity; as `ZeitlinSphere.from_harmonics` has it."""
        return self.state(self.system.from_harmonics(coefficients).mu)

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Angular momentum, of a rotating sphere along its axis."""
        turning = self.system.angular_momentum(states["mu"])
        return {"angular momentum": turning[..., 2] if self.system.rotation else turning}
