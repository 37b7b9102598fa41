"""Symmetric positive matrices of blocks on and beside the diagonal: the normal equations of a chain."""

from __future__ import annotations

import numpy as np

ALMOST = 1e-13
"""The part of a diagonal entry below which what is left of it is rounding."""


def require_digits(roots: np.ndarray, diagonal: np.ndarray) -> None:
    """Raise numpy.linalg.LinAlgError where the pivots of a Cholesky factor are rounding.  roots : of the pivots."""
    if (roots * roots <= ALMOST * diagonal).any():
        raise np.linalg.LinAlgError("a pivot is a rounding error of its diagonal entry")


class BlockTridiagonal:
    """The matrix with the blocks D_k, (n, n, n), on its diagonal and E_k, (n - 1, n, n), below: E_k stands
    in block row k + 1 and block column k.

    Raises numpy.linalg.LinAlgError if it is not positive definite, or if all digits of a pivot are rounding.

    Source: Golub and Van Loan, Matrix Computations, 4th ed., sections 4.3, 4.5.
    """

    def __init__(self, D: np.ndarray, E: np.ndarray) -> None:
        from scipy.linalg import cholesky_banded

        self.D, self.E = D, E
        nodes, n = D.shape[:2]
        # lower band: entry (i, j) of the matrix at [i - j, j]
        band = np.zeros((2 * n, nodes * n))
        for i in range(n):
            for j in range(n):
                if i >= j:
                    band[i - j, j::n] = D[:, i, j]
                if nodes > 1:
                    band[n + i - j, j : (nodes - 1) * n : n] = E[:, i, j]
        self.factor = cholesky_banded(band, lower=True, check_finite=False)
        require_digits(self.factor[0], band[0])

    def solve(self, b: np.ndarray) -> np.ndarray:
        """The solution x, (nodes, n), of the equations with the right side b."""
        from scipy.linalg import cho_solve_banded

        x: np.ndarray = cho_solve_banded((self.factor, True), b.reshape(-1), check_finite=False)
        return x.reshape(b.shape)

    def diagonal_of_inverse(self) -> np.ndarray:
        """The blocks on the diagonal of the inverse, (nodes, n, n).

        With the pivots S_k = D_k - E_k-1 S_k-1^-1 E_k-1^T the last is S^-1, and backwards

            V_k = S_k^-1 + G_k V_k+1 G_k^T,  G_k = S_k^-1 E_k^T.

        Source: Takahashi, Fagan, Chin (1973); Rauch, Tung, Striebel, AIAA J. 3 (1965).
        """
        D, E, nodes = self.D, self.E, len(self.D)
        inverse = np.empty_like(D)
        inverse[0] = np.linalg.inv(D[0])
        for k in range(1, nodes):
            inverse[k] = np.linalg.inv(D[k] - E[k - 1] @ inverse[k - 1] @ E[k - 1].T)
        for k in range(nodes - 2, -1, -1):
            G = inverse[k] @ E[k].T
            inverse[k] = inverse[k] + G @ inverse[k + 1] @ G.T
        return 0.5 * (inverse + inverse.swapaxes(1, 2))
