"""The unscented Kalman filter on a group: no derivatives, elements on both sides of the estimate."""

from __future__ import annotations

from typing import Any

from ..errors import InvalidInput
from ..formulas import Ambient, Element, Mat, Vec, mat, outer, record, sqrt, vec, vectors
from .error_state import gain
from .errors_of_elements import error, moved, squares, symmetric, transported
from .filter import Correction, Filter


@record
class UnscentedFilter(Filter):
    """The unscented Kalman filter with the state on the group and its error in the algebra.

    Of N directions d_i, the columns of the root of the covariance and of the noise, it moves
    the elements with the errors +-s sqrt(N) d_i, each of weight 1/(2 N s^2) and the estimate with what
    is missing to 1.  Means and covariances are those of the errors.  Where map, residual and group are
    linear it is Kalman's filter to rounding.

    spread : s.  1 (the default) leaves no weight to the estimate, small values approach the extended
        filter.  Where the logarithm of errors twice as large is another one, as beyond half a turn, s is halved
        until it is not: beliefs of an attitude may be as wide as they like.

    Source: Julier and Uhlmann, Proc. IEEE 92 (2004); Julier, The scaled unscented transformation, ACC (2002);
    Brossard, Barrau, Bonnabel, A code for unscented Kalman filtering on manifolds, ICRA (2020).
    """

    spread: float = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.spread > 0.0:
            raise InvalidInput(f"UnscentedFilter: spread must be positive; got {self.spread}")

    def propagated(self, g: Element, covariance: Mat, u: Vec, h: float) -> tuple[Element, Mat]:
        """g' and P'.  covariance : (dim, dim), u : (inputs,)."""
        group, side, process = self.group, self.side, self.process
        size = process.deviations(h)
        g_next, count = process.led(g, u, h), group.dim + len(size)
        columns = root(covariance).T
        noises = [vec(*[size[j] if i == j else 0.0 for i in range(len(size))]) for j in range(len(size))]
        led = lambda s: [process.led(moved(group, side, g, s * column), u, h) for column in columns]  # noqa: E731
        pushed = lambda s: [process.move(g, u, s * noise, h) for noise in noises]  # noqa: E731
        # errors after the step by how they begin, which no turn has taken away
        ends = [(1.0 / LITTLE) * error(group, side, g_next, x) for x in (*led(LITTLE), *pushed(LITTLE))]
        length = in_chart(group, ends, self.spread * sqrt(float(count)))
        sides = *zip(led(length), led(-length)), *zip(pushed(length), pushed(-length))
        moves = [x for both in sides for x in both]
        errors = [error(group, side, g_next, x) for x in moves]
        weight = 0.5 / (length * length)
        mean = weight * vectors.sum(errors)
        P = spread_about(mean, errors, weight)
        if self.reset:
            P = transported(group, side, mean, P)
        return moved(group, side, g_next, mean), P

    def correction(self, sensor: Any, limit: float) -> Correction:
        return UnscentedCorrection(sensor, self.side, self.reset, limit, self.spread)


@record
class UnscentedCorrection(Correction):
    """The update of the unscented filter.

    Source: Brossard, Barrau, Bonnabel, A code for unscented Kalman filtering on manifolds, ICRA (2020).
    """

    spread: float = 1.0

    def corrected(self, g: Element, covariance: Mat, z: Ambient) -> tuple[Element, Mat, float]:
        """g', P' and r . S^-1 r."""
        r, S, C, weight, errors, away, mean = self._moments(g, covariance, z)
        K, nis = gain(S, C, r)
        if nis > self.limit:
            return g, covariance, nis
        # P - K S K^T as a sum of squares: of what the update leaves of each error, and of the noise
        left = [e + K @ d for e, d in zip(errors, away)]
        e, P = K @ r, symmetric(spread_about(K @ mean, left, weight) + K @ self.sensor.covariance(g) @ K.T)
        if self.reset:
            P = transported(self.group, self.side, e, P)
        return moved(self.group, self.side, g, e), P, nis

    def innovation(self, g: Element, covariance: Mat, z: Ambient) -> tuple[Vec, Mat]:
        """The mean r of the residual, and its covariance S."""
        r, S, *_ = self._moments(g, covariance, z)
        return r, S

    def _moments(self, g: Any, covariance: Any, z: Any) -> tuple[Any, ...]:
        """The mean of the residual, its covariance, and minus that of error and residual; the weight of each error,
        the errors, and by how much they change the residual, on average too.
        """
        group, side, sensor = self.group, self.side, self.sensor
        residual, columns = sensor.residual(g, z), root(covariance).T
        length = self.spread * sqrt(float(group.dim))
        if sensor.elements is not None:
            length = in_chart(group, columns, length)
        weight = 0.5 / (length * length)
        errors: list[Any] = []
        away: list[Any] = []
        C = None
        for column in columns:
            e = length * column
            errors = [*errors, e, -e]
            plus = self._away(g, moved(group, side, g, e), residual, z)
            minus = self._away(g, moved(group, side, g, -e), residual, z)
            away = [*away, plus, minus]
            part = weight * outer(e, minus - plus)
            C = part if C is None else C + part
        mean = weight * vectors.sum(away)
        S = symmetric(spread_about(mean, away, weight) + sensor.covariance(g))
        return residual + mean, S, C, weight, errors, away, mean

    def _away(self, g: Any, x: Any, here: Any, z: Any) -> Any:
        """The residual at x minus that at g.  Of elements it is told by the value at x alone:
        residuals on both sides of half a turn lie a whole turn apart.
        """
        sensor = self.sensor
        return sensor.residual(x, z) - here if sensor.elements is None else -sensor.residual(g, sensor.value(x))


HALVINGS = 40
"""Times that a spread is halved, at most."""
LITTLE = 2.0**-30
"""The part of a direction by which the derivative of a step along it is estimated."""


def in_chart(group: Any, columns: Any, length: Any) -> Any:
    """A length, halved until the logarithm gives back twice the errors of this length along the columns."""
    sizes = [sum([abs(column[i]) for column in columns]) for i in range(group.dim)]
    if returns(group, (2.0 * length) * vec(*sizes)):  # an error that is larger than each
        return length
    for _ in range(HALVINGS):
        outside = False
        for column in columns:
            outside = outside or not returns(group, (2.0 * length) * column)
        if not outside:
            break
        length = 0.5 * length
    return length


def returns(group: Any, e: Vec) -> bool:
    """Is an error the logarithm of its exponential?  Another branch differs by as much as the error, rounding by far
    less.
    """
    away, largest, back = group.log(group.exp(e)) - e, 1.0, True
    for x in e:
        largest = max(largest, abs(x))
    for x, d in zip(e, away):
        back = back and abs(d) <= 0.01 * abs(x) + 1e-9 * largest
    return back


def spread_about(mean: Vec, vectors: list[Vec], weight: Any) -> Mat:
    """The covariance of vectors of this weight each with this mean, and of zero with the weight that is missing
    to 1, scaled so that it is never negative: weight sum v v^T - s^2 mean mean^T with s^2 = 1/(2 n weight),
    the square of the spread; Julier (2002).
    """
    sum_of_weights = float(len(vectors)) * weight
    excess = 2.0 - sum_of_weights - 1.0 / sum_of_weights
    return symmetric(weight * gram([v - mean for v in vectors]) + excess * outer(mean, mean))


def gram(vectors: list[Vec]) -> Mat:
    """The sum of v v^T."""
    return squares(mat(*vectors).T)


def root(P: Mat) -> Mat:
    """The lower triangular matrix L with L L^T = P (Cholesky); a column of zeros where a pivot is not
    positive, for covariances that are singular.
    """
    n = len(P)
    rows: list[list[Any]] = []
    for i in range(n):
        row: list[Any] = []
        for j in range(i):
            remainder = P[i, j]
            for k in range(j):
                remainder = remainder - row[k] * rows[j][k]
            pivot = rows[j][j]
            row = [*row, remainder / pivot if pivot > 0.0 else 0.0]
        remainder = P[i, i]
        for k in range(i):
            remainder = remainder - row[k] * row[k]
        # what rounding leaves of zero is zero
        row = [*row, sqrt(remainder) if remainder > 1e-14 * P[i, i] else 0.0]
        rows = [*rows, row]
    return mat(*[vec(*row, *[0.0] * (n - 1 - i)) for i, row in enumerate(rows)])
