"""Checks of laws: what is right passes, and each of many slips is found and called by its name."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scenes import PlaneAlgebra, PlaneMotions

import liemech as lm
from liemech.checks import Report, check_action, check_group, check_retraction
from liemech.checks.laws.map_laws import Map
from liemech.checks.points.sample_points import phi1, sample_points
from liemech.formulas import acos, cos, sin, sqrt, vec
from liemech.groups.rigid.so3 import SO3Algebra

# ---------------------------------------------------------------- a second group, whose Ad is not orthogonal


@lm.record
class Plane(PlaneMotions):
    """SE(2) with its Casimir function."""

    def casimirs(self, mu: lm.Vec) -> lm.Vec:
        return lm.vec(mu[1] * mu[1] + mu[2] * mu[2])


@lm.record
class CayleyOfQuaternions(lm.Retraction):
    """A retraction that writes tau alone: on SO(3), the rotation by 2 atan(|xi|/2)."""

    def tau(self, group: lm.LieGroup, xi: lm.Vec) -> lm.Element:
        return group.cayley(xi)


# ---------------------------------------------------------------- what is right passes


def test_rotations_obey_all_laws() -> None:
    report = check_group(lm.SO3())
    assert report
    assert not report.broken
    held = [f for f in report.findings if f.verdict == "holds"]
    assert len(held) > 40
    # the bounds leave room for other groups, not for mistakes
    assert all(f.defect <= f.bound / 8 for f in held), report


def test_motions_of_the_plane_obey_all_laws() -> None:
    report = check_group(Plane())
    assert report["Casimirs"].verdict == report["conjugation"].verdict == "holds"
    assert report["dexp by definition"].verdict == "follows"
    assert report["Cayley map"].verdict == "not there"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 3))
@pytest.mark.parametrize("group", [lm.SO3(), Plane()], ids=["SO3", "Plane"])
def test_other_points_tell_the_same(group: lm.LieGroup, seed: int) -> None:
    assert check_group(group, seed=seed)


@pytest.mark.slow
@pytest.mark.compiled
def test_native_code_is_compared_on_request() -> None:
    assert check_group(Plane(), native=True)["native code"].verdict == "holds"
    with pytest.raises(KeyError, match="native"):
        check_group(Plane())["native code"]


@pytest.mark.parametrize(
    "retraction", [lm.Exponential(), lm.Cayley(), CayleyOfQuaternions()], ids=lambda r: type(r).__name__
)
def test_retractions_obey_their_laws(retraction: lm.Retraction) -> None:
    assert check_retraction(retraction, lm.SO3())


def test_a_refused_group_is_reported_as_refused() -> None:
    report = check_retraction(lm.Cayley(), Plane())
    assert report.findings[0].verdict == "refused"
    assert "Plane" in report.findings[0].remark


def test_the_report_is_a_table() -> None:
    report = check_group(lm.SO3())
    lines = str(report).splitlines()
    held = sum(f.verdict == "holds" for f in report.findings)
    assert lines[0] == report.verdict == f"SO3() passes: {held} laws hold, none broken"
    assert len(lines) == 2 + len(report.findings)
    assert isinstance(report, Report)


@pytest.mark.parametrize("wrong", [lm.SO3, 3, None])
def test_what_is_no_group_is_refused(wrong: object) -> None:
    with pytest.raises(lm.errors.InvalidType, match="LieGroup"):
        check_group(wrong)


# ---------------------------------------------------------------- slips, one class each, and the law each breaks

SLIPS: list[tuple[object, str, str]] = []


def slip(law: str, hint: str = "", group: type = object):  # type: ignore[no-untyped-def]
    """Enter a broken class: the law that must be named, a word of the hint; a broken algebra goes into a group."""

    def enter(cls: type) -> type:
        made = lm.record(cls)
        if issubclass(cls, lm.LieAlgebra):

            @lm.record
            class OnBroken(group):
                @property
                def algebra(self) -> lm.LieAlgebra:
                    return made()

            OnBroken.__name__ = OnBroken.__qualname__ = cls.__name__
            SLIPS.append((OnBroken(), law, hint))
        else:
            SLIPS.append((made(), law, hint))
        return made

    return enter


@slip("commutator", "sign", group=lm.SO3)
class BracketWithWrongSign(SO3Algebra):
    def bracket(self, xi, eta):
        return lm.cross(eta, xi)


@slip("antisymmetry", group=lm.SO3)
class BracketNotAntisymmetric(SO3Algebra):
    def bracket(self, xi, eta):
        return lm.cross(xi, eta) + 1e-12 * lm.vec(xi[0] * eta[0], 0.0, 0.0)


@slip("Jacobi identity", group=lm.SO3)
class BracketWithoutJacobi(SO3Algebra):
    def bracket(self, xi, eta):
        return lm.cross(xi, eta) + 1e-12 * lm.vec(xi[0] * eta[1] - xi[1] * eta[0], 0.0, 0.0)


@slip("structure constants", "indices", group=Plane)
class ConstantsInOtherOrder(PlaneAlgebra):
    """[E_i, E_j] = c[i][j], which is not c[k][i][j]."""

    @property
    def structure_constants(self):
        c = np.array(PlaneAlgebra().structure_constants).transpose(1, 2, 0)
        return tuple(tuple(map(tuple, plane)) for plane in c.tolist())

    def bracket(self, xi, eta):
        return lm.vec(0.0, xi[2] * eta[0] - xi[0] * eta[2], xi[0] * eta[1] - xi[1] * eta[0])


@slip("commutator", "sign", group=lm.SO3)
class TransposedHat(SO3Algebra):
    def hat(self, xi):
        return SO3Algebra().hat(-xi)

    def vee(self, matrix):
        return -SO3Algebra().vee(matrix)


@slip("commutator", "factor 1/2", group=lm.SO3)
class HalfABracket(SO3Algebra):
    @property
    def structure_constants(self):
        return tuple(tuple(tuple(0.5 * x for x in row) for row in plane) for plane in SO3Algebra().structure_constants)

    def bracket(self, xi, eta):
        return 0.5 * lm.cross(xi, eta)

    def ad_star(self, xi, mu):
        return 0.5 * lm.cross(mu, xi)


@slip("hat and vee", "factor 2", group=lm.SO3)
class VeeWithoutHalf(SO3Algebra):
    def vee(self, matrix):
        return 2.0 * SO3Algebra().vee(matrix)


@slip("dual of the bracket", "sign", group=lm.SO3)
class CoadjointWithWrongSign(SO3Algebra):
    def ad_star(self, xi, mu):
        return lm.cross(xi, mu)


@slip("matrix product", "swapped")
class SwappedProduct(lm.SO3):
    def compose(self, g, h):
        return h @ g


@slip("inverse")
class NoInverse(lm.SO3):
    def inverse(self, g):
        return g


@slip("inverse")
class InverseForgetsRotation(Plane):
    def inverse(self, g):
        return lm.mat(lm.vec(g[0, 0], g[1, 0], -g[0, 2]), lm.vec(g[0, 1], g[1, 1], -g[1, 2]), lm.vec(0.0, 0.0, 1.0))


@slip("exponential", "sign")
class ExponentialOfTheOpposite(lm.SO3):
    def exp(self, xi):
        return lm.SO3().exp(-xi)


@slip("exponential", "factor 1/2")
class ExponentialOfTheHalf(lm.SO3):
    def exp(self, xi):
        return lm.SO3().exp(0.5 * xi)


@slip("exponential")
class ExponentialWrongWhenSmall(lm.SO3):
    """A wrong first coefficient, below a small angle only."""

    def exp(self, xi):
        return lm.SO3().exp((1.0 if lm.dot(xi, xi) > 1e-14 else 0.999) * xi)


@slip("one-parameter subgroup")
class CayleyForExponential(lm.SO3):
    def exp(self, xi):
        return lm.SO3().cayley(xi)


@slip("left action of Ad", "right action")
class TransposedAd(lm.SO3):
    def Ad(self, g, xi):
        return g.T @ xi


@slip("conjugation")
class AdForgetsTranslation(Plane):
    def Ad(self, g, xi):
        return lm.vec(xi[0], g[0, 0] * xi[1] + g[0, 1] * xi[2], g[1, 0] * xi[1] + g[1, 1] * xi[2])


@slip("dual of Ad", "not its dual")
class CoadjointIsAdjoint(Plane):
    def Ad_star(self, g, mu):
        return self.Ad(g, mu)


@slip("dual of Ad", "left action")
class CoadjointFromTheLeft(Plane):
    def Ad_star(self, g, mu):
        return lm.LieGroup.Ad_star(self, self.inverse(g), mu)


@slip("dexp by definition", "it is the right-trivialised one", group=lm.SO3)
class LeftIsRight(SO3Algebra):
    """The formula of the book."""

    def dexp(self, xi, eta):
        return lm.SO3().dexp(xi, eta, side="right")


@slip("dexp by definition", group=lm.SO3)
class DifferentialCutShort(SO3Algebra):
    def dexp(self, xi, eta):
        return eta - 0.5 * lm.cross(xi, eta)


@slip("dexp by definition", group=lm.SO3)
class TextbookQuotients(SO3Algebra):
    """(1 - cos th)/th^2 and (th - sin th)/th^3 as printed: cancellation at small angles."""

    def dexp(self, xi, eta):
        u, x = -xi, lm.dot(xi, xi)
        if x == 0.0:
            return eta
        w, th = lm.cross(u, eta), sqrt(x)
        return eta + (1.0 - cos(th)) / x * w + (th - sin(th)) / (x * th) * lm.cross(u, w)


@slip("dexp_inv", "right-trivialised", group=lm.SO3)
class WrongSignInDexpInv(SO3Algebra):
    def dexp_inv(self, xi, eta):
        return lm.SO3().dexp_inv(-xi, eta)


@slip("dexp_inv", "series cut after ad^2", group=lm.SO3)
class TruncatedDexpInv(SO3Algebra):
    def dexp_inv(self, xi, eta):
        return self.dexp_inv_series(xi, eta, 2)


@slip("dexp_inv", "it is not the inverse", group=lm.SO3)
class DexpInvIsDexp(SO3Algebra):
    def dexp_inv(self, xi, eta):
        return self.dexp(xi, eta)


@slip("dexp_dual", "it is not the dual", group=lm.SO3)
class DexpDualIsDexp(SO3Algebra):
    def dexp_dual(self, xi, mu):
        return self.dexp(xi, mu)


@slip("dexp_inv_dual", "it is not the dual", group=lm.SO3)
class DualWithoutTranspose(SO3Algebra):
    def dexp_inv_dual(self, xi, mu):
        return self.dexp_inv(xi, mu)


@slip("dexp_inv_series", group=lm.SO3)
class OtherBernoulliNumbers(SO3Algebra):
    """B_1 = +1/2, as half of the literature has it."""

    def dexp_inv_series(self, xi, eta, terms):
        return lm.SO3().algebra.dexp_inv_series(-xi, eta, terms)


@slip("log")
class LogarithmOnAnotherBranch(lm.SO3):
    def log(self, g):
        xi = lm.SO3().log(g)
        th = sqrt(lm.dot(xi, xi))
        return xi if th < 1.0 else (1.0 - 2.0 * math.pi / th) * xi


@slip("log")
class LogarithmByArccosine(lm.SO3):
    def log(self, g):
        cosine = 0.5 * (g[0, 0] + g[1, 1] + g[2, 2] - 1.0)
        th = acos(min(max(cosine, -1.0), 1.0))
        return (th / sin(th) if th > 0.0 else 1.0) * self.algebra.vee(g)


@slip("exp_Ad_star", "left action", group=lm.SO3)
class ShortcutToTheLeft(SO3Algebra):
    def exp_Ad_star(self, xi, mu):
        return lm.SO3().exp_Ad_star(-xi, mu)


@slip("compose_exp", "swapped")
class ShortcutFromTheLeft(lm.SO3):
    def compose_exp(self, g, xi):
        return self.exp(xi) @ g


@slip("exp_residual", "left-trivialised", group=lm.SO3)
class ResidualOfTheOtherSide(SO3Algebra):
    def exp_residual(self, xi, p, mu):
        r, by_p, by_xi = lm.SO3().algebra.exp_residual(-xi, p, mu)
        return r, by_p, -by_xi


@slip("exp_residual", "transposed", group=lm.SO3)
class TransposedDerivative(SO3Algebra):
    def exp_residual(self, xi, p, mu):
        r, by_p, by_xi = lm.SO3().algebra.exp_residual(xi, p, mu)
        return r, by_p, by_xi.T


@slip("is_exp_chart", group=lm.SO3)
class ChartBeyondTheSingularity(SO3Algebra):
    def is_exp_chart(self, xi):
        return lm.dot(xi, xi) < 49.0


@slip("cayley as matrices", "factor 2")
class CayleyWithoutHalf(lm.SO3):
    def cayley(self, xi):
        return lm.SO3().cayley(2.0 * xi)


@slip("dcayley_inv as matrices", "right-trivialised", group=lm.SO3)
class CayleyDifferentialFromTheRight(SO3Algebra):
    def dcayley_inv(self, xi, eta):
        return lm.SO3().algebra.dcayley_inv(-xi, eta)


@slip("dcayley by definition", "inverse", group=lm.SO3)
class CayleyDifferentialInverted(SO3Algebra):
    def dcayley(self, xi, eta):
        return self.dcayley_inv(xi, eta)


@slip("dcayley_inv_dual", "it is not the dual", group=lm.SO3)
class CayleyDualWithoutTranspose(SO3Algebra):
    def dcayley_inv_dual(self, xi, mu):
        return self.dcayley_inv(xi, mu)


@slip("cayley_inv", "factor 1/2")
class CayleyInverseWithoutTwo(lm.SO3):
    def cayley_inv(self, g):
        return 0.5 * lm.SO3().cayley_inv(g)


@slip("cayley_residual", group=lm.SO3)
class CayleyResidualWithWrongDerivative(SO3Algebra):
    def cayley_residual(self, xi, p, mu):
        r, by_p, by_xi = lm.SO3().algebra.cayley_residual(xi, p, mu)
        return r, 2.0 * by_p, by_xi


@slip("Casimirs")
class WrongCasimir(lm.SO3):
    def casimirs(self, mu):
        return vec(mu[0] * mu[0] + mu[1] * mu[1] + 1.000001 * mu[2] * mu[2])


@slip("Casimirs")
class CasimirOfRotations(Plane):
    def casimirs(self, mu):
        return vec(lm.dot(mu, mu))


@slip("membership")
class EverythingIsARotation(lm.SO3):
    def defect(self, g):
        return 0.0


@slip("membership")
class NothingIsARotation(lm.SO3):
    def defect(self, g):
        return lm.SO3().defect(g) + 1e-3


@slip("nearest")
class NearestIsItself(lm.SO3):
    def nearest(self, g):
        return g


@slip("random")
class RandomMatrices(lm.SO3):
    def random(self, rng=None, size=()):
        return np.random.default_rng(rng).normal(size=(*np.atleast_1d(size), 3, 3))


@slip("body velocity")
class SpatialVelocity(lm.SO3):
    def body_velocity(self, g, rate):
        return self.algebra.vee(rate @ self.inverse(g))


@slip("elements")
class NotANumberAtZero(lm.SO3):
    """sin(th)/th as it stands."""

    def exp(self, xi):
        th = sqrt(lm.dot(xi, xi))
        return lm.SO3().exp((sin(th) / th) / (sin(th) / th) * xi)


UNITS = pytest.mark.xfail(
    reason="the one small constant counts as a unit of its axis, in which the others are rounding"
)
MARKS = {"BracketWithoutJacobi": UNITS}


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ("group", "law", "hint"),
    [pytest.param(*one, marks=MARKS.get(type(one[0]).__name__, ()), id=type(one[0]).__name__) for one in SLIPS],
)
def test_a_slip_is_found_and_named(group: lm.LieGroup, law: str, hint: str) -> None:
    with pytest.raises(lm.errors.LawViolation) as found:
        check_group(group)
    name = type(group).__name__
    assert str(found.value).startswith(f"{name}() breaks the law of {law}: "), found.value
    assert hint in str(found.value)


def test_a_missing_obligation_is_named() -> None:
    @lm.record
    class Unfinished(lm.LieGroup):
        @property
        def algebra(self):
            return PlaneAlgebra()

    with pytest.raises(lm.errors.LawViolation, match="Unfinished must define `identity`"):
        check_group(Unfinished())


@pytest.mark.slow
def test_a_violation_tells_where_and_by_how_much() -> None:
    with pytest.raises(lm.errors.LawViolation) as found:
        check_group(CayleyWithoutHalf())
    text = str(found.value)
    for word in ("where", "xi = (", "defect", "expected  below", "roundings", "probably", "also broken", "dcayley"):
        assert word in text, text


def test_without_raising_the_report_has_every_broken_law() -> None:
    wrong = next(group for group, _, _ in SLIPS if type(group).__name__ == "WrongSignInDexpInv")
    report = check_group(wrong, raises=False)
    assert not report
    # the dual is made from the inverse
    assert [f.law for f in report.broken] == ["dexp_inv", "dexp_inv_dual"]
    assert report.verdict.endswith("fails: dexp_inv, dexp_inv_dual broken, 49 laws hold")


# ---------------------------------------------------------------- retractions


@lm.record
class NotARetraction(lm.Retraction):
    """Twice as fast."""

    def tau(self, group, xi):
        return group.exp(2.0 * xi)


@lm.record
class Unsymmetric(lm.Retraction):
    """exp(xi + a term of second order): not tau(-xi) = tau(xi)^-1."""

    def tau(self, group, xi):
        return group.exp(xi + vec(xi[0] * xi[1], 0.0, 0.0))


@lm.record
class WrongDifferential(CayleyOfQuaternions):
    def dtau(self, group, xi, eta):
        return group.dexp(xi, eta)


@lm.record
class WrongInverse(CayleyOfQuaternions):
    def dtau_inv(self, group, xi, eta):
        return group.algebra.dcayley_inv(-xi, eta)


@lm.record
class WrongResidual(CayleyOfQuaternions):
    def residual(self, group, xi, p, mu):
        return group.algebra.exp_residual(xi, p, mu)


@pytest.mark.parametrize(
    ("retraction", "law"),
    [
        (WrongResidual(), "residual"),
        (WrongDifferential(), "dtau by definition"),
        (WrongInverse(), "dtau_inv"),
        (NotARetraction(), "tau at zero"),
        (Unsymmetric(), "inverse of tau"),
    ],
    ids=lambda x: x if isinstance(x, str) else type(x).__name__,
)
def test_a_wrong_retraction_is_found(retraction: lm.Retraction, law: str) -> None:
    with pytest.raises(lm.errors.LawViolation, match=f"breaks the law of {law}: "):
        check_retraction(retraction, lm.SO3())


# ---------------------------------------------------------------- actions


@lm.record
class OnVectors(lm.Record):
    """Rotations turn vectors; on the sphere they stay."""

    group: lm.LieGroup = lm.SO3()

    def act(self, g, x):
        return g @ x

    def infinitesimal(self, xi, x):
        return lm.cross(xi, x)

    def exp_act(self, xi, x):
        return self.act(self.group.exp(xi), x)

    def defect(self, x):
        return abs(lm.dot(x, x) - 1.0)

    def random(self, rng):
        x = rng.normal(size=3)
        return x / np.linalg.norm(x)


@lm.record
class FromTheRight(OnVectors):
    def act(self, g, x):
        return g.T @ x


@lm.record
class SpinsBackwards(OnVectors):
    def infinitesimal(self, xi, x):
        return lm.cross(x, xi)


@lm.record
class LeavesTheSphere(OnVectors):
    def defect(self, x):
        return abs(lm.dot(x, x) - 1.1)


@lm.record
class ShortcutBackwards(OnVectors):
    def exp_act(self, xi, x):
        return self.act(self.group.exp(-xi), x)


@lm.record
class ShiftsAlways(OnVectors):
    def act(self, g, x):
        return g @ x + lm.vec(1e-9, 0.0, 0.0)


@lm.record
class GivesNoNumber(OnVectors):
    def act(self, g, x):
        return (g @ x) * float("nan")


def test_an_action_obeys_its_laws() -> None:
    assert check_action(OnVectors())
    assert check_action(OnVectors(), points=[[0.6, 0.0, 0.8]])
    with pytest.raises(lm.errors.InvalidInput, match="points"):
        check_action(OnVectors(), points=[])
    with pytest.raises(lm.errors.InvalidInput, match=r"points\[1\]\[1\] is nan"):
        check_action(OnVectors(), points=[[0.6, 0.0, 0.8], [0.6, np.nan, 0.8]])


@pytest.mark.parametrize(
    ("action", "law", "hint"),
    [
        (FromTheRight(), "compatibility", "right action"),
        (SpinsBackwards(), "infinitesimal action", "sign"),
        (LeavesTheSphere(), "points stay", ""),
        (ShortcutBackwards(), "exp_act", "sign"),
        (ShiftsAlways(), "neutral element", ""),
        (GivesNoNumber(), "moved points", "nan or infinity"),
    ],
    ids=lambda x: x.replace(" ", "-") if isinstance(x, str) else type(x).__name__,
)
def test_a_wrong_action_is_found(action: OnVectors, law: str, hint: str) -> None:
    with pytest.raises(lm.errors.LawViolation, match=f"breaks the law of {law}: ") as found:
        check_action(action)
    assert hint in str(found.value)


def turns(unit: float) -> np.ndarray:
    """so(3) with generators in units of 1/unit, 1 and unit."""
    return lm.SO3().algebra.basis * np.array([1.0 / unit, 1.0, unit])[:, None, None]


@lm.record
class HastyAlgebra(lm.MatrixLieAlgebra):
    def dexp_inv(self, xi, eta):
        return super().dexp_inv(-xi, eta)


@lm.record
class InUnlikeUnits(lm.MatrixLieGroup):
    unit: float

    @property
    def generators(self):
        return turns(self.unit)


@lm.record
class HastyInUnlikeUnits(InUnlikeUnits):
    algebra = property(HastyAlgebra)


@pytest.mark.slow
@pytest.mark.parametrize("unit", [1e3, 1e-6])
def test_unlike_units_neither_break_laws_nor_hide_faults(unit: float) -> None:
    """Vectors are compared in units in which they are of like sizes, and told in those given."""
    assert not lm.check_group(InUnlikeUnits(unit), raises=False).broken
    broken = lm.check_group(HastyInUnlikeUnits(unit), raises=False).broken
    assert [finding.law for finding in broken] == ["dexp_inv"]
    assert "it is the right-trivialised one" in broken[0].remark


def test_a_differential_is_that_of_its_own_point() -> None:
    """Also where the point before it is gone, and its address in use again."""
    group = lm.SO3()
    exp, at = Map(lm.Exponential(), group, group), sample_points(group, 1)[-1]
    for _ in range(20):
        at = replace(at, xi=0.9 * at.xi)
        assert np.array_equal(exp.differential(at, "right")[0], phi1(at.ad))
