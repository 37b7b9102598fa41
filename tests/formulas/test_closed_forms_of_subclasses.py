"""A subclass that writes another energy has the derivative of that energy: a closed form that it
inherits counts beside the formula that it abbreviates only.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidType, NotDefined
from liemech.formulas import Record, cos
from liemech.formulas.classes.derived import _function, _overruled, _reads, stale_forms
from liemech.formulas.vectors import Mat, Vec
from liemech.models.space.effectors import PoseInSpace
from liemech.rooms.sites.terms.terms import Site, site_class

for module in pkgutil.walk_packages(lm.__path__, "liemech."):
    if "__main__" not in module.name and not module.name.startswith("liemech.compiler"):  # which may be missing
        importlib.import_module(module.name)


def subclasses(cls: type) -> Iterator[type]:
    for one in cls.__subclasses__():
        if one.__module__.startswith("liemech."):
            yield one
            yield from subclasses(one)


READY = sorted(set(subclasses(Record)), key=lambda one: (one.__module__, one.__name__))


def forms() -> Iterator[tuple[type, str, tuple[str, ...]]]:
    """All ready classes with a closed form of their own: the class, the form, and what it abbreviates."""
    for cls in READY:
        for name, home, base in _overruled(cls):
            own = _function(vars(home)[name])
            sources = _reads(own if hasattr(own, "__sources__") or not base else _function(vars(base)[name]))
            if home is cls and not getattr(own, "__final__", False):
                yield cls, name, tuple(sorted(x for x in sources if callable(getattr(cls, x, None)) and x != name))


FORMS = [form for form in forms() if form[2]]


def test_there_are_closed_forms_in_every_room() -> None:
    kinds = {base for cls, _, _ in FORMS for base in cls.__mro__}
    assert kinds >= {
        lm.Hamiltonian, lm.Lagrangian, lm.Potential, lm.Term, lm.System, lm.LieGroup, lm.LieAlgebra, lm.Retraction,
        lm.PoissonStructure, lm.GroupAction, lm.Constraint, lm.models.ConservativeEffector, lm.models.MagneticField,
        lm.TimeScale, lm.Force,
    }  # fmt: skip
    assert len(FORMS) > 250


@pytest.mark.parametrize("cls", sorted({cls for cls, _, _ in FORMS}, key=lambda one: one.__qualname__), ids=str)
def test_of_a_subclass_that_writes_anew_what_it_abbreviates(cls: type) -> None:
    """Another formula in its place, for each of those that it abbreviates; and for a base beside it."""
    for owner, name, sources in FORMS:
        for source in sources if owner is cls else ():

            def another(self: Any, *args: Any) -> Any:
                return args

            for bases, own in ((cls,), {source: another}), ((type("Beside", (), {source: another}), cls), {}):
                try:
                    made = type("Mine", bases, {**own, "__module__": "mine"})
                except InvalidType as error:  # which the algebra has, or which may not be written anew
                    assert "belongs into the class of the algebra" in str(error) or "by way of" in str(error)
                    continue
                assert not list(stale_forms(made))
                member = next(vars(base)[name] for base in made.__mro__ if name in vars(base))
                assert member is not vars(cls)[name], (name, source)


@pytest.mark.slow
def test_a_class_of_the_library_keeps_its_closed_forms_in_a_subclass() -> None:
    for cls, name, _ in FORMS:
        made = type("Mine", (cls,), {"__module__": "mine"})
        assert name not in vars(made)


# ---------------------------------------------------------------- numbers


def more(factor: float, source: str) -> Any:
    """A subclass with the formula named `source` times a factor."""

    def subclass(one: Any) -> Any:
        inherited = getattr(type(one), source)

        def scaled(self: Any, *args: Any) -> Any:
            return factor * inherited(self, *args)

        cls = lm.record(type(type(one).__name__ + "Times", (type(one),), {source: scaled, "__module__": "mine"}))
        made = object.__new__(cls)
        for key, value in vars(one).items():
            object.__setattr__(made, key, value)
        return made

    return subclass


RNG = np.random.default_rng(5)
POSE = Mat.of(np.asarray(lm.SE3().exp([0.3, -0.2, 0.5, 0.4, 0.1, -0.6])).tolist())
NEXT = Mat.of(np.asarray(lm.SE3().exp([0.5, -0.1, 0.2, 0.9, 0.8, 0.7])).tolist())
TURN = Mat.of(np.asarray(lm.SO3().exp([0.3, -0.2, 0.5])).tolist())


def some(n: int, low: float = 0.3) -> Any:
    return Vec.of(RNG.uniform(low, low + 0.7, n).tolist())


def sites(*g: Any, **own: float) -> tuple[Any, ...]:
    kind = site_class(tuple(own)) if own else Site
    return tuple([kind(mu=some(len(x)), g=x, **own) if own else kind(mu=some(6), g=x) for x in g])


def flat(x: Any) -> np.ndarray:
    """All numbers of a result."""
    if isinstance(x, (tuple, list, Vec, Mat)):
        return np.concatenate([flat(one) for one in x]) if len(x) else np.zeros(0)
    return np.array([float(x)])


AWAY = Mat.of(np.asarray(lm.SE3().exp([0.5, -0.1, 0.2, 3.1, 0.8, 0.7])).tolist())


@lm.record
class Swelling(lm.DrivenKineticEnergy):
    """Moments that change with time."""

    def inertia(self, t: float) -> Any:
        return lm.vec(1.0 + t, 1.5, 2.0)


PLACE = PoseInSpace(some(3, 7.0), TURN, 750.0, some(3, 6.0))
M = lm.models
TOP, ROD = M.ReducedHeavyTop([1.0, 1.5, 2.0], 1.3, [0.1, 0.2, 0.9]), M.RodStrain(0.5, [1.0, 1.1, 1.2, 9.0, 8.0, 7.0])
CHAIN, POSES = lm.joints.chain(2, axis=[0.0, 1.0, 0.0]), Vec.of([*flat(POSE), *flat(NEXT)])
HINGE = lm.joints.RevoluteJoint(0, 1, [0.1, 0.2, 0.3], [0.4, 0.0, 0.1], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0])
SLIDER = lm.joints.PrismaticJoint(0, 1, [0.1, 0.2, 0.3], [0.4, 0.0, 0.1], [0.0, 0.6, 0.8], TURN)
TWO = sites(some(3), some(3), mass=1.3)
NUMBERS: dict[str, tuple[Any, str, str, tuple[Any, ...]]] = {
    "KineticEnergy.gradient": (lm.KineticEnergy([1.0, 1.5, 2.0]), "energy", "gradient", (some(3),)),
    "KineticEnergy.momentum": (lm.KineticEnergy([1.0, 1.5, 2.0]), "value", "momentum", (some(3),)),
    "DrivenKineticEnergy.gradient": (Swelling(), "energy", "gradient", (0.4, some(3))),
    "HeavyTopEnergy.gradient": (TOP.hamiltonian, "energy", "gradient", (some(6),)),
    "SpeciesEnergy.gradient": (M.LotkaVolterra().hamiltonian.parts[0], "energy", "gradient", (some(2),)),
    "FixedPointGravity.force": (M.FixedPointGravity(1.3, [0.6, 0.0, 0.8]), "energy", "force", (lm.SO3(), TURN)),
    "UniformGravity.force": (M.UniformGravity(1.3), "energy", "force", (lm.SE3(), POSE)),
    "Gravity.force": (M.Gravity(), "energy", "force", (lm.VectorSpace(3), 1, *TWO)),
    "Gravity.forces": (M.Gravity(), "energy", "forces", (lm.VectorSpace(3), *TWO)),
    "RodStrain.force": (ROD, "energy", "force", (lm.SE3(), 0, *sites(POSE, NEXT))),
    "RodStrain.forces": (ROD, "energy", "forces", (lm.SE3(), *sites(POSE, NEXT))),
    "RodStrain.stiffnesses": (ROD, "energy", "stiffnesses", (lm.SE3(), *sites(POSE, NEXT))),
    "SPC.forces": (M.SPC(), "between", "forces", (lm.SE3(), *sites(POSE, AWAY))),
    "SPC.force": (M.SPC(), "energy", "force", (lm.SE3(), 1, *sites(POSE, AWAY))),
    "Spring.effort": (lm.joints.Spring(0, 3.0, 0.2), "energy", "effort", (0.0, 0.8, 0.3)),
    "Stops.effort": (lm.joints.Stops(0, -0.3, 0.4, 50.0), "energy", "effort", (0.0, 0.8, 0.3)),
    "PointGravity.force": (M.PointGravity(7.5), "energy", "force", (PLACE,)),
    "GravityGradient.torque": (M.GravityGradient(7.5), "energy", "torque", (PLACE,)),
    "Oblateness.force": (M.Oblateness(7.5, 0.3, 6.0), "energy", "force", (PLACE,)),
    "Kepler.force": (lm.Kepler(), "potential", "force", (some(2), some(2))),
    "Kepler.velocity": (lm.Kepler(), "kinetic", "velocity", (some(2), some(2))),
    "Pendulum.force": (M.Pendulum(), "potential", "force", (some(1), some(1))),
    "HenonHeiles.force": (M.HenonHeiles(), "potential", "force", (some(2), some(2))),
    "DoublePendulum.velocity": (M.DoublePendulum(), "energy", "velocity", (some(2), some(2))),
    "DoublePendulum.force": (M.DoublePendulum(), "energy", "force", (some(2), some(2))),
    "NBody.force": (M.NBody([1.0, 0.7, 0.4]), "potential", "force", (some(9, -0.4), some(9))),
    "FermiPastaUlam.force": (M.FermiPastaUlam(4), "potential", "force", (some(4), some(4))),
    "SphericalPendulum.constraint_jacobian": (lm.SphericalPendulum(), "constraint", "constraint_jacobian", (some(3),)),
    "ChainPendulum.hidden_constraint": (M.ChainPendulum(), "constraint", "hidden_constraint", (some(6), some(6))),
    "OrthonormalFrame.force": (M.OrthonormalFrame(np.eye(3)[:, :2] + 0.2), "potential", "force", (some(6), some(6))),
    "MaxwellBlochStructure.sharp": (M.MaxwellBloch().structure, "matrix", "sharp", (some(3), some(3))),
    "FlaschkaStructure.sharp": (M.TodaLattice(3).structure, "matrix", "sharp", (some(5), some(5))),
    "Joints.jacobian": (CHAIN.constraint, "value", "jacobian", (lm.SE3() ** 2, POSES)),
    "RevoluteJoint.rows": (HINGE, "value", "rows", (POSE, NEXT)),
    "PrismaticJoint.rows": (SLIDER, "value", "rows", (POSE, NEXT)),
    "RevoluteJoint.motions": (HINGE, "coordinates", "motions", (NEXT @ HINGE.relative([0.7]), NEXT)),
    "PrismaticJoint.motions": (SLIDER, "coordinates", "motions", (NEXT @ SLIDER.relative([0.7]), NEXT)),
    "DistancePower.slope": (lm.time_scales.DistancePower(1.5), "value", "slope", (lm.Kepler(), some(2))),
}  # fmt: skip


@pytest.mark.parametrize("name", NUMBERS)
def test_the_derivative_of_another_energy(name: str) -> None:
    """Of 2.5 times the energy 2.5 times the closed form."""
    one, source, form, args = NUMBERS[name]
    closed, derived = getattr(one, form)(*args), getattr(more(2.5, source)(one), form)(*args)
    assert np.abs(flat(derived) - 2.5 * flat(closed)).max() <= 1e-9 * np.abs(flat(closed)).max()


@lm.record
class Steeper(lm.Kepler):
    """Not Kepler's potential."""

    def potential(self, q: Any) -> Any:
        return super().potential(q) + 0.3 * q[0] * q[0]


def test_no_exact_motion_of_another_energy() -> None:
    system = Steeper()
    start = system.state([0.8, 0.1], [0.1, 1.1])
    with pytest.raises(NotDefined, match=r"Steeper\.exact: Kepler knows it of its own formulas"):
        system.exact(start, 1.0)
    run = lm.integrate(system, lm.RKMK(order=8), start, h=0.05, steps=40)
    assert np.ptp(run.energy) < 1e-11 < abs(run.energy[0] - lm.Kepler().energy(start.q, start.p))


@lm.record
class Harmonic(M.NBody):
    """Masses in a harmonic trap beside."""

    def potential(self, q: Any) -> Any:
        return super().potential(q) + 0.3 * lm.dot(q, q)


@pytest.mark.slow
def test_many_masses_with_another_energy_are_moved_by_it() -> None:
    rng = np.random.default_rng(1)
    system = Harmonic(np.ones(8))
    start = system.state(3.0 * rng.normal(size=24), np.zeros(24))
    assert system.site_form is None
    run = lm.integrate(system, lm.RKMK(order=8), start, h=0.02, steps=10, compiled=False)
    assert np.ptp(run.energy) < 1e-10


@lm.record
class Quartic(lm.KineticEnergy):
    """A quartic beside the kinetic energy."""

    def energy(self, mu: Any) -> Any:
        return super().energy(mu) + 0.4 * mu[2] ** 4


def test_an_energy_beside_a_lagrangian_that_is_not_its_own() -> None:
    """No method moves by the inertia alone, or by the Lagrangian of the base."""
    system = lm.LiePoissonSystem(lm.SO3(), Quartic([1.0, 1.5, 2.0]))
    assert system.lagrangian is None
    for method in (lm.ExactFreeBody(), lm.ThreeRotations(), lm.CovariantVariational(), lm.GalerkinVariational()):
        with pytest.raises(IncompatibleSystem):
            method.require(system)
    start = system.state([0.8, -0.5, 0.6], np.eye(3))
    ends = [
        lm.integrate(system, method, start, h=0.01, steps=20, compiled=False).mu[-1]
        for method in (lm.RKMK(order=8), lm.LiePoissonHamiltonJacobi(4))
    ]
    assert np.abs(ends[0] - ends[1]).max() < 1e-9
    assert abs(system.energy(Vec.of(ends[0].tolist())) - system.energy(start.mu)) < 1e-12


@lm.record
class ByVelocity(lm.Hamiltonian):
    """An energy by way of its gradient."""

    inverse: lm.Vec

    def energy(self, mu: Any) -> Any:
        return 0.5 * lm.dot(mu, self.gradient(mu))

    def gradient(self, mu: Any) -> Any:
        return self.inverse * mu


def test_a_derivative_that_would_call_itself_is_refused() -> None:
    with pytest.raises(InvalidType, match="write `gradient` too"):

        class More(ByVelocity):
            def energy(self, mu: Any) -> Any:
                return super().energy(mu) + cos(mu[0])


def test_of_two_bases_the_derivative_of_the_energy_that_counts() -> None:
    @lm.record
    class Energy(lm.Kepler):
        def potential(self, q: Any) -> Any:
            return 2.0 * super().potential(q)

    @lm.record
    class Force(lm.Kepler):
        def force(self, q: Any, p: Any) -> Any:
            return super().force(q, p)

    q, p = some(2), some(2)
    for bases in ((Energy, Force), (Force, Energy)):
        both = lm.record(type("Both", bases, {"__module__": "mine"}))()
        assert np.allclose(np.array(both.force(q, p)), 2.0 * np.array(lm.Kepler().force(q, p)), rtol=1e-12)


def test_another_default_of_a_field_keeps_all_closed_forms() -> None:
    """Fields are parameters, for any values of which a closed form was written."""

    @lm.record
    class Heavier(lm.Kepler):
        attraction: float = 2.0

    assert not {"force", "exact", "period"} & set(vars(Heavier))
    system = Heavier()
    assert np.allclose(
        system.exact(system.state([1.0, 0.0], [0.0, 2.0**0.5]), 0.5).q, [np.cos(0.5**0.5), np.sin(0.5**0.5)]
    )


def test_masses_that_a_user_writes_leave_a_kinetic_energy_quadratic() -> None:
    @lm.record
    class Bead(lm.ConstrainedLagrangianSystem):
        degrees = 2

        def mass(self, q: Any) -> Any:
            return lm.mat(lm.vec(1.0 + q[0] ** 2, 0.0), lm.vec(0.0, 2.0))

        def potential(self, q: Any) -> Any:
            return q[1]

        def constraint(self, q: Any) -> Any:
            return lm.vec(lm.dot(q, q) - 1.0)

    assert Bead().linear_velocity


def doubled(formula: Any) -> Any:
    return lambda self, q: 2.0 * formula(self, q)


def by_function(one: Any, q: Any) -> Any:
    return 2.0 * one.strength(q) * q[0]


def by_alias(self: Any, q: Any) -> Any:
    me = self
    return 2.0 * me.strength(q) * q[0]


HELPED = {
    "alias": by_alias,
    "function": lambda self, q: by_function(self, q),
    "decorator": doubled(lambda self, q: self.strength(q) * q[0]),
    "class": lambda self, q: 2.0 * self.__class__.strength(self, q) * q[0],
    "type": lambda self, q: 2.0 * type(self).strength(self, q) * q[0],
    "getattr": lambda self, q: 2.0 * getattr(self, "strength")(q) * q[0],  # noqa: B009
    "arguments": lambda *args: 2.0 * args[0].strength(args[1]) * args[1][0],
}


@pytest.mark.parametrize("how", HELPED)
def test_a_helper_that_an_energy_calls_in_another_way(how: str) -> None:
    """Of V = 2 s(q) x with another s than the one of which the force was written."""

    def unit(self: Any, q: Any) -> Any:
        return 1.0

    def place(self: Any, q: Any) -> Any:
        return q[0]

    own = {"potential": HELPED[how], "strength": unit, "force": lambda self, q, p: lm.vec(-2.0, 0.0)}
    base = lm.record(type("Base", (lm.Kepler,), {**own, "__module__": "mine"}))
    mine = lm.record(type("Mine", (base,), {"strength": place, "__module__": "mine"}))
    assert np.allclose(np.array(mine().force(lm.vec(0.7, 0.4), lm.vec(0.0, 0.0))), [-2.8, 0.0])
