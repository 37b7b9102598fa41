"""The equations of Bloch and Iserles, an integrable flow of symmetric matrices."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas import Mat, real_array, record
from ...formulas.large import Large
from ...formulas.numbers.bases import InMemory
from ...systems.equations.isospectral_flow import IsospectralFlow


@record
class BlochIserles(IsospectralFlow):
    """L' = [N, L^2] = [N L + L N, L] with a constant skew matrix N.

    skew : N, (n, n), n at least 2.
    It is integrable: L + s N moves by the conjugation of N L + L N + s N^2 for every s, so that the
    coefficients of the polynomials tr (L + s N)^k are constant (`integrals`), beside the eigenvalues.

    Source: Bloch and Iserles, On an isospectral Lie-Poisson system and its Lie algebra, Found. Comput.
    Math. 6 (2006) 121; Bloch, Brinzanescu, Iserles, Marsden, Ratiu, Comm. Math. Phys. 290 (2009) 399.
    """

    skew: Mat

    def __post_init__(self) -> None:
        n = real_array(self.skew, "BlochIserles: skew")
        if n.ndim != 2 or n.shape[0] != n.shape[1] or len(n) < 2:
            raise InvalidInput(f"BlochIserles: skew has shape {n.shape}; it must be (n, n), n >= 2")
        if not np.array_equal(n, -n.T):
            i, j = (int(k) for k in np.unravel_index(int(np.abs(n + n.T).argmax()), n.shape))
            raise InvalidInput(
                f"BlochIserles: skew must be skew, N^T = -N; [{i}, {j}] is {n[i, j]:g}, [{j}, {i}] is {n[j, i]:g}"
            )
        object.__setattr__(self, "skew", Mat.of(n.tolist()))
        super().__post_init__()

    @property
    def size(self) -> int:
        return len(self.skew)

    @cached_property
    def _in_memory(self) -> Large:
        return Large(np.array(self.skew))

    def velocity_matrix(self, m: Mat) -> Mat:
        """X = -(N L + L N).  m : (n, n)."""
        n: Any = self._in_memory if isinstance(m, InMemory) else self.skew
        product = n @ m
        return product.T - product

    def integrals(self, mu: Any) -> np.ndarray:
        """The coefficients of s^j in tr (L + s N)^k/k, j even and between 0 and k, k = 2, ..., n.
        mu : (..., n^2); (..., integrals).
        """
        l, skew = self.matrix(mu), np.array(self.skew)
        powers: list[Any] = [l, np.broadcast_to(skew, l.shape)]
        integrals = []
        for k in range(2, self.size + 1):
            by_l, by_n = [p @ l for p in powers], [p @ skew for p in powers]
            powers = [by_l[0], *[a + b for a, b in zip(by_l[1:], by_n)], by_n[-1]]
            integrals += [np.trace(powers[j], axis1=-2, axis2=-1) / k for j in range(2, k, 2)]
        return np.stack(integrals, axis=-1) if integrals else np.zeros((*l.shape[:-2], 0))

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The eigenvalues and the other integrals."""
        names = [f"integral ({k}, {j})" for k in range(2, self.size + 1) for j in range(2, k, 2)]
        values = self.integrals(states["mu"])
        return super().constants(states) | {x: values[..., i] for i, x in enumerate(names)}
