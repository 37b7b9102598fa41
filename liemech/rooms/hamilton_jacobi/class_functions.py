"""Class functions, S_0(h g h^-1) = S_0(g): what generating functions of the first kind start from."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, OutsideChart, undefined
from ...formulas import (
    Dual,
    Mat,
    Record,
    Vec,
    cos,
    cross,
    dot,
    identity_matrix,
    jacobian,
    log1p,
    norm,
    record,
    sin,
    sinh,
    solve,
    sqrt,
    vec,
    where,
)
from ...formulas.numbers.series import Series
from ...formulas.sums import total
from ...groups.lie_group import LieGroup
from ...groups.retractions import Cayley, Exponential, Retraction
from ...groups.rigid.rotation_coefficients import BERNOULLI, LIMIT, polynomial
from ...groups.rigid.se3 import SE3Algebra
from ...groups.rigid.so3 import SO3, SO3Algebra
from ...groups.rigid.unit_quaternions import UnitQuaternions
from ...solvers import newton

Form = tuple[tuple[float, ...], ...]

SECOND_KIND = "LiePoissonHamiltonJacobi, of the second kind, serves every group"


@record
class ClassFunction(Record):
    """A function S_0 of the group with S_0(h g h^-1) = S_0(g), known up to a factor; abstract.

    What it generates turns the group and leaves every momentum alone: at tau(xi), its momentum is
    one for the body and for space,

        P(xi) = (dtau^-1_xi)* dS_0/dxi     (left-trivialised and right-trivialised).

    1. A subclass writes `momentum`, its inverse `turn`, and `along`.
    2. It refuses groups and retractions that do not fit (`require`), and says how far it should
    lead from the identity (`reach`).

    Source: Ge and Marsden, Phys. Lett. A 133 (1988), 134.
    """

    reach: ClassVar[float] = 1.0

    def require(self, group: LieGroup, retraction: Retraction) -> None:
        """Raise IncompatibleSystem unless it is a class function that generates the identity on
        this group.
        """

    def momentum(self, group: LieGroup, retraction: Retraction, xi: Vec) -> Vec:
        """P at tau(xi).  xi : (dim,)."""
        raise undefined(self, "momentum")

    def turn(self, group: LieGroup, retraction: Retraction, mu: Vec) -> Vec:
        """The xi with P = mu.  mu : (dim,).  Raises OutsideChart if there is none."""
        raise undefined(self, "turn")

    def along(self, group: LieGroup, retraction: Retraction, xi: Vec, u: Vec) -> Vec:
        """P on the way h' = -h u from h = tau(xi), as series in t.  xi : (dim,) numbers, u : (dim,)
        series.
        """
        raise undefined(self, "along")

    def size(self, group: LieGroup, retraction: Retraction, mu: Vec) -> float:
        """The factor with which S_0 turns by about `reach`, an angle, where the momentum is mu.
        mu : (dim,).
        """
        raise undefined(self, "size")


@record
class InvariantForm(ClassFunction):
    """The class function of an invariant form, P(xi) = F xi.

    S_0 is (xi, xi)/2 for the exponential, 2 log(1 + |xi|^2/4) for the Cayley map on so(3).

    form : F, (dim, dim), symmetric, regular, invariant under ad; by default
    `algebra.invariant_form`: |xi|^2 on so(3), the Klein form w.v on se(3).  The Heisenberg algebra
    has none.
    Exponential() on SO(3) and SE(3), Cayley() where it is one of ad or of a semisimple group; both
    up to any |mu|.

    Source: Channell and Scovel, Physica D 50 (1991), 80; Li and Qin, J. Comput. Math. 13 (1995),
    164.
    """

    form: Form | None = None

    def __post_init__(self) -> None:
        if self.form is not None:
            try:
                rows = np.array(self.form, dtype=float)
            except (TypeError, ValueError):
                rows = np.zeros(0)
            if rows.ndim != 2 or rows.shape[0] != rows.shape[1] or not np.isfinite(rows).all():
                raise InvalidInput(f"InvariantForm: form must be a square matrix of finite numbers; got {self.form!r}")
            object.__setattr__(self, "form", tuple(map(tuple, rows.tolist())))
        super().__post_init__()

    def require(self, group: LieGroup, retraction: Retraction) -> None:
        """The form is regular and invariant, and P the momentum of a class function in the
        coordinates of the retraction.
        """
        form = group.algebra.invariant_form if self.form is None else np.array(self.form)
        if form is None:
            raise IncompatibleSystem(
                f"InvariantForm: the algebra of {group!r} has no regular invariant form. {SECOND_KIND}"
            )
        reason = _flaw(group, form)
        if reason:
            raise IncompatibleSystem(
                f"InvariantForm: on {group!r} the form {reason}. InvariantForm() takes that of the algebra"
            )
        if isinstance(retraction, Exponential):
            if not _rotations(group) and not _screws(group):
                raise IncompatibleSystem(
                    f"InvariantForm: Exponential() is for SO3() and SE3(); on {group!r} take "
                    f"Cayley() if it has one. {SECOND_KIND}"
                )
        elif not _is_class_function(group, retraction, Mat.of(form.tolist())):
            raise IncompatibleSystem(
                f"InvariantForm: on {group!r} with {retraction!r}, F xi is the momentum of no "
                f"class function. On SE3() take Exponential() or CayleyAdjoint(). {SECOND_KIND}"
            )

    def momentum(self, group: LieGroup, retraction: Retraction, xi: Vec) -> Vec:
        """The momentum F xi, by the invariant form, (dim,)."""
        return _times(self._form(group), xi)

    def turn(self, group: LieGroup, retraction: Retraction, mu: Vec) -> Vec:
        """F^-1 mu.  mu : (dim,).  Raises OutsideChart."""
        xi = self._raised(group, mu)
        if not retraction.is_chart(group, xi):
            raise OutsideChart(
                f"InvariantForm: this momentum asks for a displacement {norm(xi):.3g} from the "
                f"identity, beyond the chart of {retraction!r}. "
                "Take a larger scale; None chooses one"
            )
        return xi

    def along(self, group: LieGroup, retraction: Retraction, xi: Vec, u: Vec) -> Vec:
        """F y with tau(y) = h."""
        return _times(self._form(group), _chart(group, retraction, xi, u))

    def size(self, group: LieGroup, retraction: Retraction, mu: Vec) -> float:
        """The angle of F^-1 mu, over 3 (nearly half a turn) for the exponential.  mu : (dim,)."""
        return _ratio(group, self._raised(group, mu), 3.0 if isinstance(retraction, Exponential) else self.reach)

    def _raised(self, group: LieGroup, mu: Vec) -> Vec:
        form = Mat.of(self._form(group))
        return _times(tuple([tuple(solve(form, unit)) for unit in identity_matrix(group.dim)]), mu)

    def _form(self, group: LieGroup) -> Form:
        rows: Any = group.algebra.invariant_form if self.form is None else self.form
        return tuple([tuple([float(x) for x in row]) for row in rows])


@record
class CayleySquare(ClassFunction):
    """S_0 = |xi|^2/2 of the Cayley map on SO(3):  P(xi) = (1 + |xi|^2/4) xi.

    Source: Marsden, Pekarsky, Shkoller, Nonlinearity 12 (1999), section 5 (the Cayley map in a
    generating function of so(3)).
    """

    def require(self, group: LieGroup, retraction: Retraction) -> None:
        """Raise IncompatibleSystem for other groups than rotations, and other retractions than Cayley()."""
        if not isinstance(group, (SO3, UnitQuaternions)) or not isinstance(retraction, Cayley):
            raise IncompatibleSystem(
                f"CayleySquare is for SO3() with Cayley(); got {group!r} with {retraction!r}. "
                "InvariantForm() knows more groups"
            )

    def momentum(self, group: LieGroup, retraction: Retraction, xi: Vec) -> Vec:
        """The momentum (1 + |xi|^2/4) xi, (3,)."""
        return (1.0 + 0.25 * dot(xi, xi)) * xi

    def turn(self, group: LieGroup, retraction: Retraction, mu: Vec) -> Vec:
        """mu/(1 + r^2/4) with r + r^3/4 = |mu|: by Cardano's formula r = (4/sqrt 3)
        sinh(asinh(sqrt 27 |mu|/4)/3).
        """
        s = 0.25 * sqrt(27.0) * norm(mu)
        r = 4.0 / sqrt(3.0) * sinh(log1p(s + s * s / (1.0 + sqrt(1.0 + s * s))) / 3.0)
        return mu / (1.0 + 0.25 * (r * r))

    def along(self, group: LieGroup, retraction: Retraction, xi: Vec, u: Vec) -> Vec:
        """(1 + |y|^2/4) y with tau(y) = h."""
        return self.momentum(group, retraction, _chart(group, retraction, xi, u))

    def size(self, group: LieGroup, retraction: Retraction, mu: Vec) -> float:
        """The length |mu| over the reach.  mu : (3,)."""
        return _ratio(group, mu, self.reach)


@record
class TraceOfAd(ClassFunction):
    """S_0 = -tr(Ad_g)/k, k the largest entry of the Killing form:  P(g)_j = -tr(Ad_g ad_j)/k;  on
    so(3) P = sin(theta) n.

    For semisimple groups, where tr(ad_i ad_j) is regular, and any retraction.  On so(3) it reaches
    only |mu| < 1, times the scale.

    Source: Ge and Marsden, Phys. Lett. A 133 (1988), 134.
    """

    reach: ClassVar[float] = 0.5

    def require(self, group: LieGroup, retraction: Retraction) -> None:
        """The Killing form is regular."""
        reason = _flaw(group, group.algebra.killing_form)
        if reason:
            raise IncompatibleSystem(
                f"TraceOfAd: the Killing form of {group!r} {reason}: its algebra is not "
                f"semisimple. InvariantForm() needs no Killing form; {SECOND_KIND}"
            )

    def momentum(self, group: LieGroup, retraction: Retraction, xi: Vec) -> Vec:
        """The momentum with components -tr(Ad ad_j)/k, (dim,)."""
        return self._trace(group, self._rows(group, retraction, xi))

    def turn(self, group: LieGroup, retraction: Retraction, mu: Vec) -> Vec:
        """The xi with P = mu, by Newton's method.  mu : (dim,).  Raises OutsideChart."""
        first = self._first(group, mu)
        xi, size, enough, _ = newton(lambda x: self._excess(group, retraction, x, mu), first, dot(mu, mu))
        if not size <= enough:
            raise OutsideChart(
                f"TraceOfAd: the momentum, {norm(mu):.3g} times the scale, is beyond what the "
                "function reaches (on so(3) 1). Take a larger scale; None chooses one"
            )
        return xi

    def along(self, group: LieGroup, retraction: Retraction, xi: Vec, u: Vec) -> Vec:
        """The rows a of Ad_h obey a' = -ad*_u a."""
        rows = [vec(*[Series(c) for c in row]) for row in self._rows(group, retraction, xi)]
        for row in rows:
            for component, rate in zip(row, group.ad_star(u, row)):
                component.grow(rate, -1.0)
        return self._trace(group, rows)

    def size(self, group: LieGroup, retraction: Retraction, mu: Vec) -> float:
        """The angle of the xi that the Killing form gives, over 1/2: the slope of P is regular up
        to pi/2.  mu : (dim,).
        """
        return _ratio(group, self._first(group, mu), self.reach)

    def _first(self, group: LieGroup, mu: Vec) -> Vec:
        """The xi with P = mu to first order."""
        return solve(-self._factor(group) * Mat.of(_constants(group.algebra.killing_form)), mu)

    def _excess(self, group: LieGroup, retraction: Retraction, xi: Vec, mu: Vec) -> tuple[Vec, Mat, float]:
        slope = jacobian(lambda x: self.momentum(group, retraction, x), xi)
        return self.momentum(group, retraction, xi) - mu, slope, 1.0

    def _rows(self, group: LieGroup, retraction: Retraction, xi: Vec) -> Any:
        g = retraction.tau(group, xi)
        columns = [group.Ad(g, unit) for unit in identity_matrix(group.dim)]
        return [vec(*[column[i] for column in columns]) for i in range(group.dim)]

    def _trace(self, group: LieGroup, rows: Any) -> Vec:
        """-tr(Ad ad_j) = sum_i (ad*_E_i row_i)_j."""
        trace: Any = None
        for row, unit in zip(rows, identity_matrix(group.dim)):
            term = group.ad_star(unit, row)
            trace = term if trace is None else trace + term
        return self._factor(group) * trace

    def _factor(self, group: LieGroup) -> float:
        largest = 0.0
        for row in _constants(group.algebra.killing_form):
            for entry in row:
                largest = max(largest, abs(entry))
        return 1.0 / largest


def _ratio(group: LieGroup, xi: Vec, reach: float) -> float:
    """The angle of xi over a reach.  A displacement that does not turn counts by its length, and
    zero as 1.
    """
    angle = _turning(group, xi)
    length = where(angle > 0.0, angle, norm(xi))
    return where(length > 0.0, length / reach, 1.0)


def _turning(group: LieGroup, xi: Vec) -> float:
    """The angle of a displacement, the same in all units: that of a rotation or a screw, else
    |ad_xi|_F/sqrt 2.

    The latter is no less than any eigenvalue of ad_xi on a semisimple algebra, where these come in
    pairs of opposite sign.
    Source: Horn and Johnson, Matrix Analysis, 2nd ed., theorem 2.3.1 and inequality (2.3.2a)
    (Schur).
    """
    if _rotations(group):
        return norm(xi)
    if _screws(group):
        return norm(vec(xi[0], xi[1], xi[2]))
    columns = [group.ad(xi, unit) for unit in identity_matrix(group.dim)]
    return sqrt(0.5 * total([dot(column, column) for column in columns]))


# ------------------------------------------------------------------ forms


def _flaw(group: LieGroup, form: np.ndarray) -> str | None:
    """Why a form does not make a class function with a regular Hessian; None if it does."""
    n = group.dim
    if form.shape != (n, n):
        return f"is of shape {form.shape}, not {(n, n)}"
    sizes = np.linalg.svd(form, compute_uv=False)
    if not np.abs(form - form.T).max() <= 1e-12 * sizes[0]:
        return "is not symmetric"
    if not sizes[-1] > 1e-10 * sizes[0]:
        return f"is degenerate, of rank {int((sizes > 1e-10 * sizes[0]).sum())}"
    ad = [np.array([group.ad(a, b) for b in identity_matrix(n)]).T for a in identity_matrix(n)]
    worst = max(np.abs(form @ a + a.T @ form).max() for a in ad)
    return None if worst <= 1e-10 * sizes[0] else "is not invariant, ([x, y], z) = (x, [y, z])"


def _is_class_function(group: LieGroup, retraction: Retraction, form: Mat) -> bool:
    """Whether dS = (dtau_xi)* F xi is the same for both sides, and a gradient; tested at one generic point."""
    xi = vec(*[0.4 * float(np.cos(1.0 + k)) for k in range(group.dim)])
    slopes = jacobian(lambda x: retraction.dtau_dual(group, x, form @ x), xi)
    sides = [np.array(retraction.dtau_dual(group, x, form @ xi)) for x in (xi, -xi)]
    hessian = np.array(slopes)
    return max(np.abs(sides[0] - sides[1]).max(), np.abs(hessian - hessian.T).max()) <= 1e-9 * np.abs(hessian).max()


def _constants(form: np.ndarray) -> Form:
    return tuple([tuple([float(x) for x in row]) for row in form])


def _times(form: Form, x: Vec) -> Vec:
    """A constant matrix times a vector of numbers of any kind."""
    return vec(*[_row(row, x) for row in form])


def _row(row: tuple[float, ...], x: Vec) -> Any:
    product: Any = None
    for a, c in zip(row, x):
        if a != 0.0:
            term = c if a == 1.0 else a * c
            product = term if product is None else product + term
    return 0.0 * x[0] if product is None else product


# ------------------------------------------------------------------ the chart as a series


def _chart(group: LieGroup, retraction: Retraction, xi: Vec, u: Vec) -> Vec:
    """The y with tau(y) = h on the way h' = -h u from tau(xi): y' = -dtau^-1_y u, left-trivialised."""
    y = vec(*[Series(c) for c in xi])
    for component, rate in zip(y, inverse_differential(group, retraction, y, u)):
        component.grow(rate, -1.0)
    return y


def inverse_differential(group: LieGroup, retraction: Retraction, y: Vec, u: Vec) -> Vec:
    """dtau^-1_y u, left-trivialised, of numbers that may be series; the exponential without a
    branch on SO(3) and SE(3).
    """
    if not isinstance(retraction, Exponential):
        return retraction.dtau_inv(group, y, u)
    if _rotations(group):
        return _dexp_inv(y, u)
    if not _screws(group):
        return group.dexp_inv(y, u)
    # screws are rotations over dual numbers
    first, second = [vec(*[Dual(x[i], x[i + 3]) for i in range(3)]) for x in (y, u)]
    z = _dexp_inv(first, second)
    return vec(*[x.value for x in z], *[x.slope for x in z])


def _rotations(group: LieGroup) -> bool:
    return bool(group.algebra.structure_constants == SO3Algebra().structure_constants)


def _screws(group: LieGroup) -> bool:
    return bool(group.algebra.structure_constants == SE3Algebra().structure_constants)


def _dexp_inv(y: Vec, u: Vec) -> Vec:
    """u + y x u/2 + d y x (y x u), d = (1 - (th/2) cot(th/2))/th^2, th^2 = |y|^2.

    Both forms of d, near zero and far from it, are computed, the second with an argument that it
    bears.
    """
    x, w = dot(y, y), cross(y, u)
    far = where(x > LIMIT, 1.0, 0.0)
    z = x + (1.0 - far)
    half = 0.5 * sqrt(z)
    d = far * ((1.0 - half * cos(half) / sin(half)) / z) + (1.0 - far) * polynomial(BERNOULLI, x)
    return u + (d * cross(y, w) + 0.5 * w)
