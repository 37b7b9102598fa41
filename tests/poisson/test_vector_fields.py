"""Vector fields of one's own: Lie derivatives, sums of fields, and which are those of an energy."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, InvalidType, LawViolation
from liemech.formulas import cos, exp, sin

EPS = float(np.finfo(float).eps)


@lm.record
class Shear(lm.VectorField):
    """A wave along one axis of space: every point moves on a straight line."""

    dim: ClassVar[int] = 3
    axis: int
    strength: float

    def velocity(self, y: lm.Vec) -> lm.Vec:
        j, k = (self.axis + 1) % 3, (self.axis + 2) % 3
        s, c = self.strength * sin(y[self.axis]), self.strength * cos(y[self.axis])
        return lm.vec(*[s if i == j else c if i == k else 0.0 for i in range(3)])


@lm.record
class Turn(lm.VectorField):
    """A rotation about the third axis, and a constant wind: affine."""

    dim: ClassVar[int] = 3
    rate: float

    def velocity(self, y: lm.Vec) -> lm.Vec:
        return lm.vec(-self.rate * y[1], self.rate * y[0] + 0.2, 0.3)


@lm.record
class Growth(lm.VectorField):
    """y_3' = 1 - y_3^2, with its motion."""

    dim: ClassVar[int] = 3

    def velocity(self, y: lm.Vec) -> lm.Vec:
        return lm.vec(0.0, 0.0, 1.0 - y[2] * y[2])

    def flow(self, y: lm.Vec, t: float) -> lm.Vec:
        s, c = lm.formulas.sinh(t), lm.formulas.cosh(t)
        return lm.vec(y[0], y[1], (y[2] * c + s) / (c + y[2] * s))


ABC = lm.SplitField((Shear(0, 0.7), Shear(1, 0.4), Shear(2, 1.1)))
MIXED = lm.SplitField((Turn(0.9), Growth(), Shear(0, 0.5)))
Y = [0.3, -0.4, 0.2]


# ---------------------------------------------------------------- Lie derivatives


def test_lie_derivatives_of_a_field() -> None:
    """D F = sum f_j dF/dy_j, by hand; of the coordinates it is f, and D is linear in f."""
    y = lm.vec(*Y)

    def F(x: Any) -> Any:
        return x[0] * x[1] ** 2 + sin(x[2])

    f = np.array(ABC.velocity(y))
    by_hand = f @ [y[1] ** 2, 2.0 * y[0] * y[1], math.cos(y[2])]
    assert ABC.lie_derivative(F)(Y) == pytest.approx(by_hand, rel=1e-14)
    assert list(ABC.lie_derivative(lambda x: x)(y)) == list(f)
    parts = sum(part.lie_derivative(F)(y) for part in ABC.parts)
    assert parts == pytest.approx(by_hand, rel=1e-14)
    twice = ABC.parts[0].lie_derivative(ABC.parts[1].lie_derivative(F))
    assert twice(y) != pytest.approx(ABC.parts[1].lie_derivative(ABC.parts[0].lie_derivative(F))(y))


def test_the_lie_series_is_the_motion() -> None:
    """F(y(t)) = sum t^k/k! (D^k F)(y): with six terms the error is of order six."""

    def F(x: Any) -> Any:
        return x[0] * x[1] ** 2 + sin(x[2])

    y, errors = lm.vec(*Y), []
    derivatives = [F(y)] + [MIXED.lie_derivative(F, times=k)(y) for k in range(1, 6)]
    for t in (0.2, 0.1):
        run = lm.integrate(MIXED, lm.RKMK(order=8), MIXED.state(Y), h=t / 8, steps=8, compiled=False, progress=False)
        series = sum(d * t**k / math.factorial(k) for k, d in enumerate(derivatives))
        errors.append(abs(series - F(run.y[-1])))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(6.0, abs=0.2)


def test_a_poisson_system_is_a_vector_field() -> None:
    """Its Lie derivative is the bracket with the energy."""
    body = lm.RigidBody([1.0, 1.5, 2.0])
    system = lm.PoissonSystem(lm.coadjoint(lm.SO3()).poisson_structure, body.hamiltonian)
    bracket = system.structure.bracket(lambda y: y[0] * y[1], system.energy)
    found = system.lie_derivative(lambda y: y[0] * y[1])
    assert found(Y) == pytest.approx(bracket(Y), rel=1e-14)


# ---------------------------------------------------------------- sums of fields


def stepped(system: Any, method: lm.Method, y: Any, h: float) -> Any:
    memory = method.start(system, lm.PoissonState(lm.vec(*y)), h)
    return method.observe(method.step(system, 0.0, memory, h)).y


def test_which_motions_are_recognised() -> None:
    kinds = [type(part).__name__ for part in MIXED.parts]
    assert kinds == ["AffineField", "Growth", "StraightField"]
    for part in MIXED.parts:
        there = np.array(part.flow(lm.vec(*Y), 0.7))
        run = lm.integrate(part, lm.RKMK(order=8), part.state(Y), h=0.07, steps=10, compiled=False, progress=False)
        assert np.abs(there - run.y[-1]).max() < 1e-11
    assert lm.check_system(MIXED)["flow"].verdict == "holds"


@pytest.mark.parametrize("order", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("system", [ABC, MIXED], ids=["waves", "mixed"])
def test_order(system: lm.SplitField, order: int) -> None:
    start, method = system.state(Y), lm.Splitting(order=order, quadratic=False)

    def end(method: lm.Method, n: int) -> np.ndarray:
        run = lm.integrate(system, method, start, h=1.0 / n, steps=n, compiled=False, progress=False)
        return np.asarray(run.y[-1])

    exact = end(lm.RKMK(order=8), 100)
    errors = [np.abs(end(method, n) - exact).max() for n in ((8, 16) if order < 6 else (3, 6))]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.3)


@pytest.mark.slow
def test_a_composition_of_shears_keeps_volumes_and_goes_back() -> None:
    method = lm.Splitting(order=4)
    D = np.array(lm.jacobian(lambda y: stepped(ABC, method, y, 0.5), lm.vec(*Y)))
    assert np.linalg.det(D) == pytest.approx(1.0, rel=64 * EPS)
    runge_kutta = np.array(lm.jacobian(lambda y: stepped(ABC, lm.RKMK(order=4), y, 0.5), lm.vec(*Y)))
    assert abs(np.linalg.det(runge_kutta) - 1.0) > 1e-7
    back = stepped(ABC, method, stepped(ABC, method, Y, 0.5), -0.5)
    assert np.abs(np.array(back) - Y).max() < 64 * EPS
    assert lm.check_method(method, ABC, ABC.state(Y))["symmetric"].verdict == "holds"


def test_kicks_and_drifts_as_fields_are_the_separable_system() -> None:
    """T and V of a pendulum, as two fields: the same steps."""

    @lm.record
    class Drift(lm.VectorField):
        dim: ClassVar[int] = 2

        def velocity(self, y: lm.Vec) -> lm.Vec:
            return lm.vec(y[1], 0.0)

    @lm.record
    class Kick(lm.VectorField):
        dim: ClassVar[int] = 2

        def velocity(self, y: lm.Vec) -> lm.Vec:
            return lm.vec(0.0, -sin(y[0]))

    @lm.record
    class Bob(lm.SeparableSystem):
        degrees: ClassVar[int] = 1

        def kinetic(self, p: lm.Vec) -> float:
            return 0.5 * p[0] * p[0]

        def potential(self, q: lm.Vec) -> float:
            return -cos(q[0])

    fields, bob = lm.SplitField((Drift(), Kick())), Bob()
    for method in (lm.Splitting(order=4, quadratic=False), lm.StormerVerlet()):
        a = lm.integrate(fields, method, fields.state([1.0, 0.3]), h=0.1, steps=50, compiled=False, progress=False)
        b = lm.integrate(bob, method, bob.state([1.0], [0.3]), h=0.1, steps=50, compiled=False, progress=False)
        assert np.abs(a.y - np.hstack([b.q, b.p])).max() < 1e-14


@pytest.mark.compiled
def test_lie_derivatives_compile() -> None:
    """A field that is made of the Lie derivative of another one."""

    @lm.record
    class Descent(lm.VectorField):
        dim: ClassVar[int] = 3

        def velocity(self, y: lm.Vec) -> lm.Vec:
            return -0.1 * MIXED.lie_derivative(lambda x: x * x[0])(y)

    start = Descent().state(Y)
    native, python = (
        lm.integrate(Descent(), lm.RKMK(order=2), start, h=0.1, steps=5, compiled=c, progress=False)
        for c in (True, False)
    )
    assert native.y.tobytes() == python.y.tobytes()


@pytest.mark.compiled
@pytest.mark.parametrize("system", [ABC, MIXED], ids=["waves", "mixed"])
def test_native_code_and_ensembles_have_the_same_bits(system: lm.SplitField) -> None:
    many = system.state(np.array(Y) + np.linspace(0.0, 0.5, 9)[:, None])
    for start in (system.state(Y), many):
        native, python = (
            lm.integrate(system, lm.Splitting(order=2), start, h=0.1, steps=20, compiled=c, progress=False)
            for c in (True, False)
        )
        assert native.y.tobytes() == python.y.tobytes()


def test_what_is_refused() -> None:
    @lm.record
    class Unknown(lm.VectorField):
        dim: ClassVar[int] = 3

        def velocity(self, y: lm.Vec) -> lm.Vec:
            return lm.vec(y[0] * y[1], sin(y[0]), y[2] ** 2)

    @lm.record
    class Wall(lm.VectorField):
        dim: ClassVar[int] = 3

        def velocity(self, y: lm.Vec) -> lm.Vec:
            return lm.vec(1.0 if y[0] > 0.0 else 2.0, 0.0, 0.0)

    @lm.record
    class Plane(lm.VectorField):
        dim: ClassVar[int] = 2

        def velocity(self, y: lm.Vec) -> lm.Vec:
            return lm.vec(y[1], 0.0)

    @lm.record
    class Wrong(Growth):
        def flow(self, y: lm.Vec, t: float) -> lm.Vec:
            return lm.vec(y[0], y[1], y[2] + t * (1.0 - y[2] * y[2]))

    for part, why in (
        (Unknown(), "it is no straight line, and the field is not affine"),
        (Wall(), "need not be the same at all points"),
    ):
        with pytest.raises(IncompatibleSystem, match=why):
            lm.Splitting(order=2).require(lm.SplitField((Shear(0, 1.0), part)))
    with pytest.raises(IncompatibleSystem, match="quadratic=False"):
        lm.Splitting(tableau=lm.tableaus.SPLITTINGS["Blanes-Moan 6"]).require(ABC)
    with pytest.raises(IncompatibleSystem, match="needs a SeparableSystem"):
        lm.StormerVerlet().require(Unknown())
    with pytest.raises(InvalidInput, match=r"of dimensions \[3, 2\]"):
        lm.SplitField((Growth(), Plane()))
    with pytest.raises(InvalidType, match="must be VectorFields"):
        lm.SplitField((lm.Kepler(),))  # type: ignore[arg-type]
    with pytest.raises(InvalidType, match="F must be a formula of"):
        ABC.lie_derivative(3.0)  # type: ignore[arg-type]
    with pytest.raises(LawViolation, match="flow"):
        lm.check_system(lm.SplitField((Wrong(), Shear(0, 1.0))))
    with pytest.raises(InvalidInput, match="shape"):
        ABC.state([1.0, 2.0])


def test_formulas_that_are_none_are_refused_by_the_state() -> None:
    @lm.record
    class Timed(lm.VectorField):
        dim: ClassVar[int] = 2

        def velocity(self, t: float, y: lm.Vec) -> lm.Vec:  # type: ignore[override]
            return y

    @lm.record
    class Forgotten(lm.VectorField):
        dim: ClassVar[int] = 2

        def velocity(self, y: lm.Vec) -> lm.Vec:
            lm.vec(y[1], y[0])  # type: ignore[return]

    @lm.record
    class Long(lm.VectorField):
        dim: ClassVar[int] = 2

        def velocity(self, y: lm.Vec) -> lm.Vec:
            return lm.vec(y[1], y[0], 1.0)

    @lm.record
    class Bare(Growth):
        def flow(self, t: float) -> lm.Vec:  # type: ignore[override]
            return lm.vec(t, t, t)

    with pytest.raises(InvalidType, match=r"Timed.velocity takes .* write `def velocity\(self, y\)`"):
        Timed().state([1.0, 2.0])
    with pytest.raises(InvalidType, match=r"Bare.flow takes .* write `def flow\(self, y, t\)`"):
        lm.SplitField((Bare(), Shear(0, 1.0))).state(Y)
    with pytest.raises(InvalidType, match=r"Forgotten.velocity returns nothing"):
        Forgotten()
    for field in (Long(), lm.SplitField([Long()])):  # type: ignore[arg-type]
        with pytest.raises(InvalidInput, match="must return a vector of 2 numbers"):
            field.state([1.0, 2.0])
    assert lm.SplitField([Turn(1.0)]).parts == lm.SplitField((Turn(1.0),)).parts  # type: ignore[arg-type]


# ---------------------------------------------------------------- fields of an energy


def kepler(y: Any) -> Any:
    q = lm.vec(y[0], y[1])
    r2 = lm.dot(q, q)
    return lm.vec(y[2], y[3], *(-q / (r2 * lm.formulas.sqrt(r2))))


def energy(y: Any) -> Any:
    return 0.5 * (y[2] ** 2 + y[3] ** 2) - 1.0 / lm.formulas.sqrt(y[0] ** 2 + y[1] ** 2)


SO3 = lm.coadjoint(lm.SO3()).poisson_structure
FLAT = lm.structures.ConstantStructure([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
BODY = lm.RigidBody([1.0, 1.5, 2.0])


def euler(y: Any) -> Any:
    return lm.cross(y, BODY.velocity(y))


PLANE = lm.structures.Canonical(2)
FIELDS: dict[str, tuple[Callable[[Any], Any], lm.PoissonStructure, set[str]]] = {
    "Kepler": (kepler, PLANE, set()),
    "friction": (lambda y: kepler(y) - lm.vec(0.0, 0.0, 0.1 * y[2], 0.1 * y[3]), PLANE, {"flow of Poisson maps"}),
    "locally": (lambda y: lm.vec(0.0, 0.0, -y[1], y[0]) / (y[0] ** 2 + y[1] ** 2), PLANE, set()),
    "Euler": (euler, SO3, set()),
    "damped": (lambda y: euler(y) - 0.1 * y, SO3, {"flow of Poisson maps", "leaves", "Casimirs"}),
    "on the sphere": (lambda y: (1.0 + y[0] ** 2) * euler(y), SO3, {"flow of Poisson maps"}),
    "across": (lambda y: lm.vec(0.0, 0.0, 1.0), FLAT, {"leaves", "Casimirs"}),
    "Lotka": (lm.models.LotkaVolterra().velocity, lm.models.LotkaVolterra().structure, set()),
}  # fmt: skip


@pytest.mark.parametrize("name", FIELDS)
def test_which_fields_are_those_of_an_energy(name: str) -> None:
    """df/dy J^-1 symmetric, or the Lie derivative of B zero; and tangent to the leaves.  The angle
    about the origin is no function, its gradient a field all the same: locally.
    """
    f, B, broken = FIELDS[name]
    report = lm.check_poisson_field(f, B, raises=False)
    assert {finding.law for finding in report.findings if finding.verdict == "broken"} == broken
    assert bool(report) is (not broken)
    if broken:
        with pytest.raises(LawViolation):
            lm.check_poisson_field(f, B)


@pytest.mark.parametrize("name", FIELDS)
def test_they_are_if_and_only_if_their_motion_is_of_poisson_maps_that_respect_casimirs(name: str) -> None:
    """The theorem: the same answer from the motion over a time, by a Runge-Kutta method of order
    eight with its derivative.
    """
    f, B, broken = FIELDS[name]
    n = B.dim

    @lm.record
    class Given(lm.VectorField):
        dim: ClassVar[int] = n

        def velocity(self, y: lm.Vec) -> lm.Vec:
            return f(y)

    start = lm.vec(*[0.9, 0.3, 0.4, 0.8][:n])

    def moved(y: Any) -> Any:
        for _ in range(8):
            y = stepped(Given(), lm.RKMK(order=8), y, 0.025)
        return y

    D, after = np.array(lm.jacobian(moved, start)), moved(start)
    there = np.array(B.matrix(after))
    poisson = bool(np.abs(D @ np.array(B.matrix(start)) @ D.T - there).max() < 1e-9)
    before, now = np.array(B.casimirs(start)), np.array(B.casimirs(after))
    respected = bool(np.abs(now - before).max(initial=0.0) < 1e-9)
    assert (poisson and respected) is (not broken)
    assert poisson is ("flow of Poisson maps" not in broken)
    assert respected is ("Casimirs" not in broken)


def test_a_scaled_field_is_hamiltonian_if_sigma_is_a_function_of_the_energy() -> None:
    """sigma f = J^-1 dK needs d sigma x dH = 0: constants do it, and functions of H, with K the
    integral of sigma(H); no sigma that tells points of one energy apart.
    """
    B = lm.structures.Canonical(2)
    for sigma, hamiltonian in (
        (lambda y: 3.0, True),
        (lambda y: exp(energy(y)), True),
        (lambda y: (y[0] ** 2 + y[1] ** 2) ** 0.75, False),
        (lambda y: 1.0 + 1e-9 * y[0], False),
        (lambda y: y[0] * y[3] - y[1] * y[2], False),
    ):
        report = lm.check_poisson_field(lambda y, sigma=sigma: sigma(y) * kepler(y), B, raises=False)
        assert bool(report) is hamiltonian


def test_what_the_check_refuses() -> None:
    with pytest.raises(InvalidType, match="with the brackets"):
        lm.check_poisson_field(kepler, lm.structures.Canonical)  # type: ignore[arg-type]
    with pytest.raises(InvalidType, match="a VectorField or a formula"):
        lm.check_poisson_field(3.0, lm.structures.Canonical(2))  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="of dimension 3"):
        lm.check_poisson_field(ABC, lm.structures.Canonical(2))
    with pytest.raises(InvalidInput, match="shape"):
        lm.check_poisson_field(kepler, lm.structures.Canonical(2), [[1.0, 2.0]])
    report = lm.check_poisson_field(lambda y: lm.vec(y[0]), lm.structures.Canonical(2), raises=False)
    assert not report
