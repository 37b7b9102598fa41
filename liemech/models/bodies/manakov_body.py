"""The free rigid body in n dimensions, Euler's equations on so(n), and the integrals that Manakov found."""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput
from ...formulas import Vec, real_array, record
from ...groups.matrices.classical import SO
from ...systems.kinetic_energy import KineticEnergy
from ...systems.lie_poisson import LiePoissonSystem


@record
class ManakovBody(LiePoissonSystem):
    """The free rigid body in n dimensions: M' = [M, Omega] with M = Lambda Omega + Omega Lambda.

    moments : the second moments of mass l_1, ..., l_n along its axes, in kg m^2, positive, n at least
    3; a turn in the plane ij has the inertia l_i + l_j.  mu is the angular momentum on so(n), in
    kg m^2/s.

    It is integrable: M' = [M, Omega] holds if and only if M + s Lambda^2 moves by the conjugation of
    Omega + s Lambda for every s, so that all coefficients of the polynomials tr (M + s Lambda^2)^k are constant.

    Source: Manakov, Funct. Anal. Appl. 10 (1976) 328; Ratiu, Indiana Univ. Math. J. 29 (1980) 609.
    """

    called: ClassVar[str] = "body"

    group: SO = field(init=False, repr=False)
    hamiltonian: KineticEnergy = field(init=False, repr=False)
    lagrangian: KineticEnergy = field(init=False, repr=False)
    moments: Vec

    def __repr__(self) -> str:
        return f"{type(self).__name__}(moments={self.moments!r})"

    def __post_init__(self) -> None:
        moments = real_array(self.moments, "ManakovBody: moments")
        if moments.ndim != 1 or len(moments) < 3:
            raise InvalidInput(f"ManakovBody: moments are n positive numbers, n at least 3; got {self.moments!r}")
        if not (np.isfinite(moments) & (moments > 0.0)).all():
            bad = int(np.flatnonzero(~(np.isfinite(moments) & (moments > 0.0)))[0])
            raise InvalidInput(f"ManakovBody: moments[{bad}] is {moments[bad]:g}; it must be positive")
        group = SO(len(moments))
        k, i, j, _ = group._entries()
        inertia = np.zeros(group.dim)
        inertia[k] = moments[i] + moments[j]
        kinetic = KineticEnergy(Vec.of(inertia.tolist()))
        for name, value in (("group", group), ("hamiltonian", kinetic), ("lagrangian", kinetic)):
            object.__setattr__(self, name, value)
        super().__post_init__()

    def integrals(self, mu: Any) -> np.ndarray:
        """The coefficients of s^j in tr (M + s Lambda^2)^k/k, k = 2, ..., n, where k - j is even and not
        zero: those with j = 0 are Casimirs, the others not.  Lambda in units of its largest entry.
        mu : (..., dim); (..., integrals), as `pairs` has them.
        """
        m = self.group.generated.hat(real_array(mu, "ManakovBody.integrals: mu"))
        l = np.array(self.moments)
        square = np.diag((l / l.max()) ** 2)
        powers = [m, np.broadcast_to(square, m.shape)]
        traces = []
        for k in range(2, self.group.n + 1):
            by_m = [p @ m for p in powers]
            by_l = [p @ square for p in powers]
            powers = [by_m[0], *[a + b for a, b in zip(by_m[1:], by_l)], by_l[-1]]
            traces += [np.trace(p, axis1=-2, axis2=-1) / k for j, p in enumerate(powers) if (k - j) % 2 == 0 and j < k]
        return np.stack(traces, axis=-1)

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """(k, j) of the integrals."""
        sizes = range(2, self.group.n + 1)
        return tuple([(k, j) for k in sizes for j in range(k) if (k - j) % 2 == 0])

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Energy, Casimirs, the spatial momentum if the attitude is known, and Manakov's integrals."""
        values = self.integrals(states["mu"])
        manakov = {f"Manakov ({k}, {j})": values[..., i] for i, (k, j) in enumerate(self.pairs) if j > 0}
        return super().constants(states) | manakov
