"""Isospectral flows of matrices: symmetric ones that are turned by skew ones."""

from __future__ import annotations

from dataclasses import field
from typing import Any, ClassVar

import numpy as np

from ...errors import InvalidInput, undefined
from ...formulas import Mat, Vec, real_array, record
from ...formulas.large import Large
from ...groups.matrices.classical import GL
from ..lie_poisson import BodyState, LiePoissonMotion, body_state, of_group


@record
class IsospectralFlow(LiePoissonMotion):
    """The motion of a symmetric matrix by conjugation, L' = [L, X(L)] with a skew matrix X; abstract.

    A subclass writes `size` and `velocity_matrix`, X.  The momentum mu is L row by row, on gl(n)*, so
    that methods for Lie-Poisson systems apply; X need not be the derivative of an energy there.  An
    element moves with it, g' = g X, and g L g^-1 stays.
    `Isospectral` keeps all eigenvalues to rounding; so do RKMK and CommutatorFree.

    Source: Calvo, Iserles, Zanna, Numerical solution of isospectral flows, Math. Comp. 66 (1997);
    Modin and Viviani, Found. Comput. Math. 20 (2020).
    """

    alternatives: ClassVar[str] = "Isospectral, RKMK and CommutatorFree keep its eigenvalues"
    called: ClassVar[str] = "flow"

    group: GL = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "group", GL(self.size))
        super().__post_init__()

    @property
    def size(self) -> int:
        """The number of rows of the matrix."""
        raise undefined(self, "size")

    def velocity_matrix(self, m: Mat) -> Mat:
        """The skew matrix X of L.  m : L, (n, n)."""
        raise undefined(self, "velocity_matrix")

    def velocity(self, mu: Vec) -> Vec:
        """X row by row.  mu : (n^2,)."""
        algebra = self.group.algebra
        return algebra.vee(self.velocity_matrix(algebra.covector(mu)))

    def rate(self, t: float, state: BodyState) -> Vec:
        """The antisymmetric matrix X, row by row."""
        return self.velocity(state.mu)

    @property
    def is_large(self) -> bool:
        return self.group.is_large

    def _in_numpy(self, method: str, arguments: dict[str, Any]) -> Any:
        if method == "energy":
            return 0.5 * np.sum(arguments["mu"] ** 2, axis=-1)
        if method == "velocity":
            return np.array([np.asarray(self.velocity(Large(mu))) for mu in arguments["mu"]])
        return of_group(self.group, method, arguments)

    # ---------------------------------------------------------------- input, output

    def state(self, matrix: Any = None, g: Any = None, *, mu: Any = None) -> BodyState:
        """A start for `integrate`: the matrix L, or L row by row, and perhaps an element.

        matrix : (n, n) symmetric, or (members, n, n).  mu : (n^2,), or (members, n^2).
        Raises InvalidInput for other shapes and matrices that are not symmetric.
        """
        name, n = f"{type(self).__name__}.state", self.size
        entries = mu if matrix is None else matrix
        array = real_array(entries, f"{name}: matrix")
        if matrix is None and array.shape[-1:] == (n * n,):
            array = array.reshape(*array.shape[:-1], n, n)
        if array.shape[-2:] != (n, n) or array.ndim > 3:
            raise InvalidInput(f"{name}: matrix has shape {array.shape}; it must be ({n}, {n})")
        asymmetry = np.abs(array - np.swapaxes(array, -1, -2))
        if not (asymmetry <= 1e-12 * np.abs(array).max()).all():
            at = tuple(int(k) for k in np.unravel_index(int(asymmetry.argmax()), asymmetry.shape))
            raise InvalidInput(
                f"{name}: matrix is not symmetric: entry {at} differs from its mirror image by {asymmetry.max():.1e}"
            )
        rows = array.reshape(*array.shape[:-2], n * n)
        return self._vouched(body_state(name, self.group, rows, g))

    def matrix(self, mu: Any) -> np.ndarray:
        """The matrix L, (..., n, n).  mu : (..., n^2)."""
        array = real_array(mu, f"{type(self).__name__}.matrix: mu")
        return array.reshape(*array.shape[:-1], self.size, self.size)

    def eigenvalues(self, mu: Any) -> np.ndarray:
        """The eigenvalues of L, from below: constant.  mu : (..., n^2); (..., n)."""
        return np.linalg.eigvalsh(self.matrix(mu))

    def energy(self, mu: Vec) -> float:
        """tr L^2/2.  mu : (n^2,)."""
        return 0.5 * mu @ mu

    def constants(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The eigenvalues, and g L g^-1 if the element is known."""
        constants = {"eigenvalues": self.eigenvalues(states["mu"])}
        g = states.get("g")
        if g is None:
            return constants
        return constants | {"spatial momentum": np.asarray(self.spatial_momentum(states["mu"], g))}
