"""The groups, retractions, joints, models and methods that the library has, from which tables of tests draw.

A class that is in no list fails `test_shipped.py`, which says where to add it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import liemech as lm

PLANE = [[[0, -1, 0], [1, 0, 0], [0, 0, 0]], [[0, 0, 1], [0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 0, 1], [0, 0, 0]]]
"""Generators of the rigid motions of the plane."""

RIGID: tuple[Any, ...] = (
    lm.SO3(), lm.UnitQuaternions(), lm.SE2(), lm.SE3(), lm.SE23(), lm.SGal3(), lm.VectorSpace(3), lm.Heisenberg(1),
)  # fmt: skip
"""Groups with closed forms of their own."""

CLASSICAL: tuple[Any, ...] = (
    lm.SO(3), lm.SO(4), lm.SO(5), lm.SL(2), lm.SL(3), lm.GL(2), lm.SU(2), lm.SU(3), lm.U(2), lm.Sp(2), lm.Sp(4),
    lm.Heisenberg(2), lm.MatrixLieGroup.of(PLANE),
)  # fmt: skip
"""Groups of matrices, of which all follows from the generators."""

COMPOSED: tuple[Any, ...] = (
    lm.ProductGroup(lm.SO3(), lm.VectorSpace(2)), lm.ProductGroup(lm.SU(2), lm.SO3()), lm.SemidirectProduct(lm.SO3()),
    lm.SemidirectProduct(lm.UnitQuaternions()), lm.SemidirectProduct(lm.SE3(), lm.coadjoint(lm.SE3())),
    lm.OppositeGroup(lm.SE3()), lm.OppositeGroup(lm.SL(2)),
)  # fmt: skip
"""Groups put together from others."""

GROUPS = RIGID + CLASSICAL + COMPOSED

OF_SITES: tuple[Any, ...] = (lm.SO3() ** 2, lm.SO3() ** 2 * lm.SE2() ** 1)
"""Groups of the configurations of many sites, whose elements have an axis of sites."""

RETRACTIONS: tuple[Any, ...] = (lm.Exponential(), lm.Cayley(), lm.CayleyAdjoint())

A, B = [0.1, 0.2, 0.3], [0.3, -0.1, 0.2]
JOINTS: dict[str, tuple[Any, int]] = {
    "ball": (lm.joints.BallJoint(0, 1, A, B), 3),
    "fixed point": (lm.joints.BallJoint(1, None, A, [1.0, 2.0, 3.0]), 3),
    "revolute": (lm.joints.RevoluteJoint(0, 1, A, B, [1.0, 2.0, 3.0], [-1.0, 0.3, -0.2]), 1),
    "revolute to the ground": (lm.joints.RevoluteJoint(1, None, A, B, [1.0, 2.0, -3.0], [-1.0, 0.3, -0.2]), 1),
    "universal": (lm.joints.UniversalJoint(1, 0, A, B, [1.0, 2.0, 3.0], [-1.0, 0.3, 0.2]), 2),
    "universal to the ground": (lm.joints.UniversalJoint(1, None, A, B), 2),
    "prismatic": (lm.joints.PrismaticJoint(0, 1, A, B, [1.0, 2.0, 3.0], lm.SO3().exp([0.4, -1.0, 0.3])), 1),
    "planar": (lm.joints.PlanarJoint(0, 1, A, B, [1.0, 2.0, 3.0], [-1.0, 0.3, -0.2]), 3),
    "rod": (lm.joints.RigidRod(0, 1, A, B, 1.3), 5),
    "fixed": (lm.joints.FixedJoint(0, 1, A, B, lm.SO3().exp([0.4, -1.0, 0.3])), 0),
    "floating": (lm.joints.FloatingJoint(0, 1), 6),
    "strut": (lm.joints.Strut(0, 1, A, B), 6),
}
"""Joints with slanted axes, each with the freedoms that it leaves."""

TOP = {"inertia": [1.0, 1.5, 2.2], "weight": 1.3, "centre": [0.6, 0.0, 0.8]}
MODELS: tuple[Any, ...] = (
    lm.RigidBody([1.0, 1.5, 2.2]),
    lm.models.HeavyTop(**TOP),
    lm.models.LagrangeTop(transverse=1.2, axial=0.5, weight=2.0, length=0.7),
    lm.models.ReducedHeavyTop(**TOP),
    lm.models.PoissonTop([1.0, 1.5, 2.2], 1.3, [0.6, 0.0, 0.8]),
    lm.models.KirchhoffBody(np.diag([1.0, 1.6, 2.3, 1.0, 2.0, 3.0])),
    lm.models.ManakovBody([1.0, 1.3, 1.7, 2.2]),
    lm.models.OrthogonalBody([1.0, 1.5, 2.2]),
    lm.models.FallingBody([1.0, 1.5, 2.2], mass=1.7),
    lm.models.OrbitingBody([0.05, 0.08, 0.11], mass=1.7, attraction=1.0),
    lm.models.Spacecraft([900.0, 800.0, 600.0], 500.0, [lm.models.PointGravity(7.5)]),
    lm.joints.chain(2),
    lm.models.CosseratRod(lm.models.RodSection.round(0.01, 1e6, 1e3), 1.0, 4),
    lm.Field(lm.SO3(), lm.FieldDensity(lm.KineticEnergy([1.0, 1.5, 2.2]), lm.KineticEnergy([1.0, 2.0, 0.7])), 1.0, 3),
    lm.Kepler(),
    lm.models.HenonHeiles(),
    lm.models.NBody([1.0, 0.7, 0.4]),
    lm.models.PlanetarySystem([1.0, 0.001]),
    lm.models.GravitatingBodies([2.0, 0.7, 0.4], np.full((3, 3), 0.1)),
    lm.models.Pendulum(),
    lm.models.DoublePendulum(),
    lm.SphericalPendulum(),
    lm.models.ChainPendulum(),
    lm.models.FourBarLinkage(),
    lm.models.AndrewsMechanism(),
    lm.models.OrthonormalFrame([[0.0], [0.0], [9.8]]),
    lm.models.ParticleOnEllipsoid(),
    lm.models.FermiPastaUlam(4),
    lm.models.ChargedParticle(lm.models.TokamakField()),
    lm.models.GuidingCentre(lm.models.TokamakField(), 0.1),
    lm.models.LotkaVolterra(),
    lm.models.MaxwellBloch(),
    lm.models.TodaLattice(3),
    lm.models.TodaFlow(3),
    lm.models.BlochIserles([[0.0, 1.0, 0.2], [-1.0, 0.0, 0.5], [-0.2, -0.5, 0.0]]),
    lm.models.VonNeumann([1.0, 2.0]),
    lm.models.ZeitlinSphere(13),
    lm.models.MagneticSphere(13),
    lm.models.ViscousSphere(lm.models.ZeitlinSphere(13), 1e-3),
)
"""Ready systems, one of each class."""

BODY, MU, R, END = lm.RigidBody([1.0, 1.5, 2.2]), np.array([0.8, -0.5, 0.6]), lm.SO3().exp([0.3, 0.4, -0.2]), 0.24
"""A free body, from where and how long it moves, for methods that are fitted to a motion."""

METHODS: tuple[lm.Method, ...] = (
    lm.RKMK(order=4),
    lm.RKMK(order=2, retraction=lm.Cayley()),
    lm.CommutatorFree(order=4),
    lm.CrouchGrossman(order=3),
    lm.Taylor(4),
    lm.Magnus(order=4),
    lm.CovariantVariational(),
    lm.CovariantVariational(lagrangian=lm.QuadratureLagrangian()),
    lm.GalerkinVariational(order=2),
    lm.SymplecticRKMK(order=4),
    lm.LiePoissonHamiltonJacobi(2),
    lm.LiePoissonHamiltonJacobi(4),
    lm.FirstKindHamiltonJacobi(order=1, scale=1.0),
    lm.HamiltonJacobi(2),
    lm.SymmetricHamiltonJacobi(2),
    lm.MoserVeselov(),
    lm.ExactMoserVeselov.of(BODY, BODY.state(MU, R), END / 6),
    lm.ThreeRotations(),
    lm.ExactFreeBody(),
    lm.ImplicitMidpoint(),
    lm.SphericalMidpoint(),
    lm.Isospectral(2),
    lm.Composition(lm.ThreeRotations(), order=4),
    lm.Composition(lm.SphericalMidpoint(), order=4),
    lm.LieVerlet(),
    lm.KickDrift(),
    lm.KickDrift(lm.ThreeRotations()),
    lm.KickDrift(lm.SphericalMidpoint()),
    lm.StormerVerlet(),
    lm.SymplecticEuler(),
    lm.Splitting(order=4),
    lm.MultipleTimeSteps([2]),
    lm.RATTLE(),
    lm.ConstrainedEuler(),
    lm.LobattoPair(order=2),
    lm.GeodesicSplitting(order=2),
    lm.IndexReduction(lm.RKMK(order=4)),
    lm.LieRATTLE(),
    lm.LagrangeDAlembert(),
    lm.PoissonEuler(),
    lm.PoissonVerlet(),
    lm.PoissonHamiltonJacobi(order=4),
    lm.Boris(),
    lm.AdaptiveVerlet(),
    lm.ReversibleController(lm.StormerVerlet(), sigma=lambda q: lm.dot(q, q)),
    lm.ReversibleController(lm.LieVerlet(), sigma=lambda mu: 1.0 + lm.dot(mu, mu)),
    lm.DiscreteGradient(),
    lm.DissipativeSplitting(),
    lm.DissipativeSplitting(lm.ExactFreeBody()),
    lm.SublatticeSplitting(),
    lm.BondSplitting(),
    lm.WongZakai(lm.RKMK(order=4)),
    lm.WongZakai(lm.ExactFreeBody()),
    lm.WongZakai(lm.ThreeRotations()),
    lm.WongZakai(lm.ImplicitMidpoint()),
    lm.NinomiyaVictoir(lm.RKMK(order=4)),
    lm.NinomiyaVictoir(lm.ExactFreeBody()),
    lm.NinomiyaVictoir(lm.CommutatorFree(order=4)),
)
"""Methods: one of each class, and others of it that move systems in another way."""


def turning(groups: tuple[Any, ...] = GROUPS) -> list[Any]:
    """The groups whose first direction turns: their chart of the exponential ends at a full turn."""
    full = 6.2833
    return [G for G in groups if not G.algebra.is_exp_chart([full, *[0.0] * (G.dim - 1)])]
