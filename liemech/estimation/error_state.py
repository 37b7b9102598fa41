"""The error-state Kalman filter on a group: MEKF on SO(3), the invariant filters on SE_2(3)."""

from __future__ import annotations

from typing import Any

from ..formulas import Ambient, Element, Mat, Vec, dot, identity_matrix, mat, record, solve, transpose, vec
from .errors_of_elements import by_error, moved, squares, symmetric, transition, transported
from .filter import Correction, Filter


@record
class ErrorStateFilter(Filter):
    """The extended Kalman filter of the error in the algebra, with the state on the group.

    predict:  g' = move(g, u, 0, h),    P' = F P F^T + L Q L^T
    update:   S = H P H^T + R,  K = P H^T S^-1,  e = K r,  g' = g exp(e) or exp(e) g,
              P' = (1 - K H) P (1 - K H)^T + K R K^T    (Joseph's form)

    F and L are the differentials of the discrete map itself, by the error before and by the noise,
    trivialised on the side of the error; H is minus that of the residual.  All three are derived.

    On SO(3) this is the multiplicative filter (MEKF).  For processes that are affine on the group, such
    as `Imu`, F does not depend on the estimate: the left- and right-invariant extended Kalman filters.
    On a product of groups with the same state it is the ordinary extended Kalman filter.

    Source: Barrau and Bonnabel, IEEE Trans. Autom. Control 62 (2017), sections II, III; Markley,
    J. Guidance, Control, and Dynamics 26 (2003), on the MEKF; Bucy and Joseph (1968) for the form.
    """

    def propagated(self, g: Element, covariance: Mat, u: Vec, h: float) -> tuple[Element, Mat]:
        """g' and P'.  covariance : (dim, dim), u : (inputs,)."""
        process = self.process
        g_next = process.led(g, u, h)
        F = transition(self.group, self.side, g, lambda x: process.led(x, u, h), g_next)
        L = process.by_noise(self.side, g, u, h)
        return g_next, symmetric(F @ covariance @ F.T + squares(L))

    def correction(self, sensor: Any, limit: float) -> Correction:
        return ErrorStateCorrection(sensor, self.side, self.reset, limit)


@record
class ErrorStateCorrection(Correction):
    """The update of the extended filter.

    Source: Barrau and Bonnabel, IEEE Trans. Autom. Control 62 (2017), section III.
    """

    def corrected(self, g: Element, covariance: Mat, z: Ambient) -> tuple[Element, Mat, float]:
        """g', P' and r . S^-1 r."""
        r, H, R = self._linear(g, z)
        PH = covariance @ H.T
        S = symmetric(H @ PH + R)
        K, nis = gain(S, PH, r)
        if nis > self.limit:
            return g, covariance, nis
        e = K @ r
        A = identity_matrix(self.group.dim) - K @ H
        P = symmetric(A @ covariance @ A.T + K @ R @ K.T)
        if self.reset:
            P = transported(self.group, self.side, e, P)
        return moved(self.group, self.side, g, e), P, nis

    def innovation(self, g: Element, covariance: Mat, z: Ambient) -> tuple[Vec, Mat]:
        """The residual r and its covariance S = H P H^T + R."""
        r, H, R = self._linear(g, z)
        return r, symmetric(H @ covariance @ H.T + R)

    def _linear(self, g: Any, z: Any) -> tuple[Any, Any, Any]:
        """r(e) = r - H e, and the covariance of r."""
        sensor = self.sensor
        slopes = by_error(self.group, self.side, g, lambda x: sensor.residual(x, z))
        return sensor.residual(g, z), -transpose(mat(*slopes)), sensor.covariance(g)


def gain(S: Mat, C: Mat, r: Vec) -> tuple[Mat, float]:
    """K = C S^-1, and r . S^-1 r, by one elimination.  S : (m, m), C : (dim, m), r : (m,)."""
    n = len(C)
    solved = solve(S, mat(*[vec(*[C[j, i] for j in range(n)], r[i]) for i in range(len(r))]))
    return transpose(mat(*[row[:n] for row in solved])), dot(r, vec(*[row[n] for row in solved]))
