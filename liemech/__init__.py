"""liemech: mechanics on Lie groups, with integrators that keep the geometry.

    import liemech as lm

    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    run = lm.integrate(body, lm.RKMK(order=4), start, h=0.1, steps=10_000)

Spaces are objects, their elements arrays.  A method steps a system, `integrate` owns the loop, a
`Trajectory` the samples.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from . import errors
from .formulas import (
    Ambient,
    Element,
    Mat,
    Record,
    Vec,
    batches,
    cross,
    derivative,
    dot,
    gradient,
    jacobian,
    mat,
    norm,
    outer,
    record,
    sum,
    vec,
)

if TYPE_CHECKING:
    from . import plots as plots
    from . import tableaus
    from . import viewer as viewer
    from .checks import (
        check_action,
        check_group,
        check_method,
        check_poisson,
        check_poisson_field,
        check_retraction,
        check_system,
        poisson_defect,
    )
    from .groups.actions import (
        GroupAction,
        LeftMultiplication,
        LinearAction,
        SphereAction,
        TranslationAction,
    )
    from .groups.classical import GL, SL, SO, SU, Sp, U
    from .groups.coadjoint import CoadjointAction, coadjoint
    from .groups.heisenberg import Heisenberg
    from .groups.lie_algebra import LieAlgebra
    from .groups.lie_group import LieGroup
    from .groups.matrix_algebra import MatrixLieAlgebra
    from .groups.matrix_group import MatrixLieGroup
    from .groups.opposite import OppositeGroup
    from .groups.poisson_structure import (
        Canonical,
        ConstantStructure,
        LiePoissonStructure,
        LogCanonical,
        PoissonStructure,
    )
    from .groups.product import ProductGroup
    from .groups.representations import AdjointAction, Representation, RotationAction
    from .groups.se2 import SE2
    from .groups.se3 import SE3
    from .groups.se23 import SE23, SE23Algebra
    from .groups.semidirect import SemidirectProduct
    from .groups.sgal3 import SGal3, SGal3Algebra
    from .groups.so3 import SO3, SO3Algebra
    from .groups.unit_quaternions import UnitQuaternions
    from .groups.vector_space import VectorSpace
    from .integrators.adaptive_verlet import AdaptiveVerlet
    from .integrators.boris import Boris
    from .integrators.class_functions import CayleySquare, ClassFunction, InvariantForm, TraceOfAd
    from .integrators.commutator_free import CommutatorFree, CrouchGrossman
    from .integrators.composition import Composition
    from .integrators.darboux_lie import DarbouxLieChart
    from .integrators.discrete_lagrangian import (
        DiscreteLagrangian,
        GroupLagrangian,
        QuadratureLagrangian,
    )
    from .integrators.exact_free_body import ExactFreeBody
    from .integrators.galerkin import GalerkinVariational
    from .integrators.geodesic_splitting import GeodesicSplitting
    from .integrators.hamilton_jacobi import HamiltonJacobi, SymmetricHamiltonJacobi
    from .integrators.index_reduction import IndexReduction
    from .integrators.kick_drift import KickDrift
    from .integrators.lie_poisson_first_kind import FirstKindHamiltonJacobi
    from .integrators.lie_poisson_hj import LiePoissonHamiltonJacobi
    from .integrators.lie_rattle import LieRATTLE
    from .integrators.lie_verlet import LieVerlet
    from .integrators.lobatto_pair import LobattoPair
    from .integrators.magnus import Magnus
    from .integrators.method import Method
    from .integrators.midpoint import ImplicitMidpoint, Isospectral, SphericalMidpoint
    from .integrators.moser_veselov import ExactMoserVeselov, MoserVeselov
    from .integrators.multiple_time_steps import MultipleTimeSteps
    from .integrators.nonholonomic import LagrangeDAlembert
    from .integrators.poisson_euler import PoissonEuler, PoissonVerlet
    from .integrators.rattle import RATTLE, ConstrainedEuler
    from .integrators.reversible_controller import ReversibleController
    from .integrators.rkmk import RKMK
    from .integrators.separable import Splitting, StormerVerlet, SymplecticEuler
    from .integrators.splitting import ThreeRotations
    from .integrators.taylor import Taylor
    from .integrators.variational import CovariantVariational
    from .models.andrews import AndrewsMechanism
    from .models.charged_particle import (
        AxialField,
        ChargedParticle,
        GuidingCentre,
        MagneticField,
        TokamakField,
        UniformField,
    )
    from .models.constrained_pendulums import ChainPendulum, FourBarLinkage, SphericalPendulum
    from .models.fermi_pasta_ulam import FermiPastaUlam
    from .models.frames import OrthonormalFrame
    from .models.gravity import CentralGravity, FixedPointGravity, UniformGravity
    from .models.heavy_top import HeavyTop, LagrangeTop, ReducedHeavyTop
    from .models.henon_heiles import HenonHeiles
    from .models.joints import (
        BallJoint,
        FixedPoint,
        PrismaticJoint,
        RevoluteJoint,
        RigidRod,
        UniversalJoint,
    )
    from .models.kepler import Kepler
    from .models.kirchhoff import KirchhoffBody
    from .models.linkage import Link, Linkage, chain
    from .models.lotka_volterra import LotkaVolterra
    from .models.maxwell_bloch import MaxwellBloch
    from .models.n_body import NBody
    from .models.orthogonal_body import OrthogonalBody
    from .models.pendulums import DoublePendulum, Pendulum
    from .models.planetary_system import PlanetarySystem
    from .models.poisson_top import PoissonTop
    from .models.rigid_body import RigidBody
    from .models.rolling import Blade, Rolling, Suslov
    from .models.space_bodies import FallingBody, OrbitingBody
    from .models.surfaces import ParticleOnEllipsoid
    from .models.toda import TodaLattice
    from .retractions import Cayley, CayleyAdjoint, Exponential, Retraction
    from .simulation.integrate import integrate
    from .simulation.plan import Plan
    from .simulation.trajectory import Trajectory
    from .systems.canonical import CanonicalState, HamiltonianSystem
    from .systems.canonical_transformation import CanonicalTransformation
    from .systems.constrained import (
        Constrained,
        ConstrainedLagrangianSystem,
        ConstrainedSystem,
        SeparableConstrainedSystem,
        Surface,
    )
    from .systems.constrained_body import ConstrainedBody, NonholonomicBody
    from .systems.constrained_parts import ConstrainedPart, SplitConstrainedSystem
    from .systems.constraint import Constraint, VelocityConstraint
    from .systems.darboux import (
        Andoyer,
        DarbouxChart,
        InDarbouxChart,
        LinearDarboux,
        LogarithmicDarboux,
    )
    from .systems.driven import DrivenHamiltonian, DrivenHamiltonianSystem, DrivenLiePoissonSystem
    from .systems.group_equation import GroupEquation, LinearGroupEquation
    from .systems.hamiltonian import Hamiltonian
    from .systems.homogeneous_equation import HomogeneousEquation
    from .systems.kinetic_energy import KineticEnergy
    from .systems.lagrangian import Lagrangian
    from .systems.lie_poisson import BodyState, LiePoissonSystem
    from .systems.local_coordinates import InducedStructure, LocalChart, in_coordinates
    from .systems.mechanical import MechanicalSystem
    from .systems.multirate import MultirateSystem
    from .systems.parts import OfCoordinate, Part, SplitHamiltonian, Straight
    from .systems.poisson import PoissonState, PoissonSystem
    from .systems.potential import Force, NoPotential, Potential
    from .systems.separable import SeparableSystem
    from .systems.sundman import SundmanTransformed
    from .systems.system import State, System
    from .systems.tabulated import PiecewisePolynomial
    from .systems.time_scales import DistancePower, EqualArc, EqualChange, EqualPath, TimeScale
    from .systems.time_transformed import LogarithmicHamiltonian, TimeTransformed
    from .systems.vector_field import SplitField, VectorField
    from .tableaus.tableau import ButcherTableau

_LATER = {
    "checks": (
        *(
            "check_action",
            "check_group",
            "check_method",
            "check_poisson",
            "check_poisson_field",
            "check_retraction",
            "check_system",
        ),
        "poisson_defect",
    ),
    "groups.actions": (
        "GroupAction",
        "LeftMultiplication",
        "LinearAction",
        "SphereAction",
        "TranslationAction",
    ),
    "groups.classical": ("GL", "SL", "SO", "SU", "Sp", "U"),
    "groups.coadjoint": ("CoadjointAction", "coadjoint"),
    "groups.heisenberg": ("Heisenberg",),
    "groups.lie_algebra": ("LieAlgebra",),
    "groups.lie_group": ("LieGroup",),
    "groups.matrix_algebra": ("MatrixLieAlgebra",),
    "groups.matrix_group": ("MatrixLieGroup",),
    "groups.opposite": ("OppositeGroup",),
    "groups.poisson_structure": (
        "Canonical",
        "ConstantStructure",
        "LiePoissonStructure",
        "LogCanonical",
        "PoissonStructure",
    ),
    "groups.product": ("ProductGroup",),
    "groups.representations": ("AdjointAction", "Representation", "RotationAction"),
    "groups.se2": ("SE2",),
    "groups.se23": ("SE23", "SE23Algebra"),
    "groups.se3": ("SE3",),
    "groups.semidirect": ("SemidirectProduct",),
    "groups.sgal3": ("SGal3", "SGal3Algebra"),
    "groups.so3": ("SO3", "SO3Algebra"),
    "groups.unit_quaternions": ("UnitQuaternions",),
    "groups.vector_space": ("VectorSpace",),
    "integrators.adaptive_verlet": ("AdaptiveVerlet",),
    "integrators.boris": ("Boris",),
    "integrators.class_functions": ("CayleySquare", "ClassFunction", "InvariantForm", "TraceOfAd"),
    "integrators.commutator_free": ("CommutatorFree", "CrouchGrossman"),
    "integrators.composition": ("Composition",),
    "integrators.darboux_lie": ("DarbouxLieChart",),
    "integrators.discrete_lagrangian": (
        "DiscreteLagrangian",
        "GroupLagrangian",
        "QuadratureLagrangian",
    ),
    "integrators.exact_free_body": ("ExactFreeBody",),
    "integrators.galerkin": ("GalerkinVariational",),
    "integrators.geodesic_splitting": ("GeodesicSplitting",),
    "integrators.hamilton_jacobi": ("HamiltonJacobi", "SymmetricHamiltonJacobi"),
    "integrators.index_reduction": ("IndexReduction",),
    "integrators.kick_drift": ("KickDrift",),
    "integrators.lie_poisson_first_kind": ("FirstKindHamiltonJacobi",),
    "integrators.lie_poisson_hj": ("LiePoissonHamiltonJacobi",),
    "integrators.lie_rattle": ("LieRATTLE",),
    "integrators.lie_verlet": ("LieVerlet",),
    "integrators.lobatto_pair": ("LobattoPair",),
    "integrators.magnus": ("Magnus",),
    "integrators.method": ("Method",),
    "integrators.midpoint": ("ImplicitMidpoint", "Isospectral", "SphericalMidpoint"),
    "integrators.moser_veselov": ("ExactMoserVeselov", "MoserVeselov"),
    "integrators.multiple_time_steps": ("MultipleTimeSteps",),
    "integrators.nonholonomic": ("LagrangeDAlembert",),
    "integrators.poisson_euler": ("PoissonEuler", "PoissonVerlet"),
    "integrators.rattle": ("RATTLE", "ConstrainedEuler"),
    "integrators.reversible_controller": ("ReversibleController",),
    "integrators.rkmk": ("RKMK",),
    "integrators.separable": ("Splitting", "StormerVerlet", "SymplecticEuler"),
    "integrators.splitting": ("ThreeRotations",),
    "integrators.taylor": ("Taylor",),
    "integrators.variational": ("CovariantVariational",),
    "models.andrews": ("AndrewsMechanism",),
    "models.charged_particle": (
        "AxialField",
        "ChargedParticle",
        "GuidingCentre",
        "MagneticField",
        "TokamakField",
        "UniformField",
    ),
    "models.constrained_pendulums": ("ChainPendulum", "FourBarLinkage", "SphericalPendulum"),
    "models.fermi_pasta_ulam": ("FermiPastaUlam",),
    "models.frames": ("OrthonormalFrame",),
    "models.gravity": ("CentralGravity", "FixedPointGravity", "UniformGravity"),
    "models.heavy_top": ("HeavyTop", "LagrangeTop", "ReducedHeavyTop"),
    "models.henon_heiles": ("HenonHeiles",),
    "models.joints": (
        "BallJoint",
        "FixedPoint",
        "PrismaticJoint",
        "RevoluteJoint",
        "RigidRod",
        "UniversalJoint",
    ),
    "models.kepler": ("Kepler",),
    "models.kirchhoff": ("KirchhoffBody",),
    "models.linkage": ("Link", "Linkage", "chain"),
    "models.lotka_volterra": ("LotkaVolterra",),
    "models.maxwell_bloch": ("MaxwellBloch",),
    "models.n_body": ("NBody",),
    "models.orthogonal_body": ("OrthogonalBody",),
    "models.pendulums": ("DoublePendulum", "Pendulum"),
    "models.planetary_system": ("PlanetarySystem",),
    "models.poisson_top": ("PoissonTop",),
    "models.rigid_body": ("RigidBody",),
    "models.rolling": ("Blade", "Rolling", "Suslov"),
    "models.space_bodies": ("FallingBody", "OrbitingBody"),
    "models.surfaces": ("ParticleOnEllipsoid",),
    "models.toda": ("TodaLattice",),
    "plots": ("plots",),
    "retractions": ("Cayley", "CayleyAdjoint", "Exponential", "Retraction"),
    "simulation.integrate": ("integrate",),
    "simulation.plan": ("Plan",),
    "simulation.trajectory": ("Trajectory",),
    "systems.canonical": ("CanonicalState", "HamiltonianSystem"),
    "systems.canonical_transformation": ("CanonicalTransformation",),
    "systems.constrained": (
        "Constrained",
        "ConstrainedLagrangianSystem",
        "ConstrainedSystem",
        "SeparableConstrainedSystem",
        "Surface",
    ),
    "systems.constrained_body": ("ConstrainedBody", "NonholonomicBody"),
    "systems.constrained_parts": ("ConstrainedPart", "SplitConstrainedSystem"),
    "systems.constraint": ("Constraint", "VelocityConstraint"),
    "systems.darboux": (
        "Andoyer",
        "DarbouxChart",
        "InDarbouxChart",
        "LinearDarboux",
        "LogarithmicDarboux",
    ),
    "systems.driven": ("DrivenHamiltonian", "DrivenHamiltonianSystem", "DrivenLiePoissonSystem"),
    "systems.group_equation": ("GroupEquation", "LinearGroupEquation"),
    "systems.hamiltonian": ("Hamiltonian",),
    "systems.homogeneous_equation": ("HomogeneousEquation",),
    "systems.kinetic_energy": ("KineticEnergy",),
    "systems.lagrangian": ("Lagrangian",),
    "systems.lie_poisson": ("BodyState", "LiePoissonSystem"),
    "systems.local_coordinates": ("InducedStructure", "LocalChart", "in_coordinates"),
    "systems.mechanical": ("MechanicalSystem",),
    "systems.multirate": ("MultirateSystem",),
    "systems.parts": ("OfCoordinate", "Part", "SplitHamiltonian", "Straight"),
    "systems.poisson": ("PoissonState", "PoissonSystem"),
    "systems.potential": ("Force", "NoPotential", "Potential"),
    "systems.separable": ("SeparableSystem",),
    "systems.sundman": ("SundmanTransformed",),
    "systems.system": ("State", "System"),
    "systems.tabulated": ("PiecewisePolynomial",),
    "systems.time_scales": ("DistancePower", "EqualArc", "EqualChange", "EqualPath", "TimeScale"),
    "systems.time_transformed": ("LogarithmicHamiltonian", "TimeTransformed"),
    "systems.vector_field": ("SplitField", "VectorField"),
    "tableaus": ("tableaus",),
    "tableaus.tableau": ("ButcherTableau",),
    "viewer": ("viewer",),
}
"""What is imported when it is first asked for, module by module, so that a script pays for what it
uses.
"""

_HOMES = {name: module for module, names in _LATER.items() for name in names}


def _evaluate_rows(batch: batches.Batch) -> Any:
    """Methods called with many rows may be compiled: formulas do not know the compiler, the package
    does.
    """
    from .compiler.batch import evaluate_rows

    return evaluate_rows(batch)


batches.evaluate_rows = _evaluate_rows


def __getattr__(name: str) -> Any:
    """A public name, imported now."""
    if name not in _HOMES:
        import difflib

        message, public = (
            f"module 'liemech' has no attribute {name!r}",
            {n.lower(): n for n in __all__},
        )
        near = difflib.get_close_matches(name.lower().replace("_", ""), public, 1)
        hint = f". Did you mean liemech.{public[near[0]]}?" if near else ""
        raise AttributeError(message + hint)
    module = import_module(f".{_HOMES[name]}", __name__)
    value = module if name == _HOMES[name] else getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


__version__ = "0.1.0"

__all__ = [
    "GL",
    "RATTLE",
    "RKMK",
    "SE2",
    "SE23",
    "SE23Algebra",
    "SE3",
    "SL",
    "SO",
    "SGal3",
    "SGal3Algebra",
    "SO3",
    "SU",
    "U",
    "AdaptiveVerlet",
    "SymmetricHamiltonJacobi",
    "DrivenLiePoissonSystem",
    "DrivenHamiltonianSystem",
    "DrivenHamiltonian",
    "QuadratureLagrangian",
    "GroupLagrangian",
    "DiscreteLagrangian",
    "AdjointAction",
    "Ambient",
    "Andoyer",
    "AndrewsMechanism",
    "AxialField",
    "BallJoint",
    "Blade",
    "BodyState",
    "Boris",
    "ButcherTableau",
    "Canonical",
    "CanonicalState",
    "CanonicalTransformation",
    "Cayley",
    "CayleyAdjoint",
    "CayleySquare",
    "CentralGravity",
    "ChainPendulum",
    "ChargedParticle",
    "ClassFunction",
    "CoadjointAction",
    "CommutatorFree",
    "Composition",
    "Constrained",
    "ConstrainedEuler",
    "ConstrainedLagrangianSystem",
    "ConstrainedSystem",
    "ConstrainedBody",
    "ConstrainedPart",
    "Constraint",
    "CovariantVariational",
    "CrouchGrossman",
    "DistancePower",
    "ConstantStructure",
    "DarbouxChart",
    "DarbouxLieChart",
    "DoublePendulum",
    "Element",
    "EqualArc",
    "EqualChange",
    "EqualPath",
    "ExactFreeBody",
    "ExactMoserVeselov",
    "Exponential",
    "FallingBody",
    "FermiPastaUlam",
    "FirstKindHamiltonJacobi",
    "FixedPoint",
    "FixedPointGravity",
    "Force",
    "FourBarLinkage",
    "GalerkinVariational",
    "GeodesicSplitting",
    "GroupAction",
    "GroupEquation",
    "GuidingCentre",
    "HamiltonJacobi",
    "Hamiltonian",
    "HamiltonianSystem",
    "HeavyTop",
    "Heisenberg",
    "HenonHeiles",
    "HomogeneousEquation",
    "ImplicitMidpoint",
    "IndexReduction",
    "InDarbouxChart",
    "InducedStructure",
    "InvariantForm",
    "Isospectral",
    "Kepler",
    "KickDrift",
    "KineticEnergy",
    "KirchhoffBody",
    "LagrangeDAlembert",
    "LagrangeTop",
    "Lagrangian",
    "LeftMultiplication",
    "LieAlgebra",
    "LieGroup",
    "LiePoissonHamiltonJacobi",
    "LiePoissonStructure",
    "LiePoissonSystem",
    "LieRATTLE",
    "LieVerlet",
    "LinearAction",
    "LinearDarboux",
    "LinearGroupEquation",
    "LobattoPair",
    "LogarithmicHamiltonian",
    "LocalChart",
    "LogCanonical",
    "LogarithmicDarboux",
    "LotkaVolterra",
    "MagneticField",
    "Link",
    "Linkage",
    "Magnus",
    "Mat",
    "MatrixLieAlgebra",
    "MatrixLieGroup",
    "MaxwellBloch",
    "MechanicalSystem",
    "Method",
    "MoserVeselov",
    "MultipleTimeSteps",
    "MultirateSystem",
    "NoPotential",
    "NonholonomicBody",
    "OfCoordinate",
    "OrbitingBody",
    "OppositeGroup",
    "OrthogonalBody",
    "OrthonormalFrame",
    "ParticleOnEllipsoid",
    "NBody",
    "Part",
    "Pendulum",
    "PlanetarySystem",
    "PoissonEuler",
    "PoissonState",
    "PoissonStructure",
    "PoissonSystem",
    "PoissonTop",
    "PoissonVerlet",
    "Potential",
    "PrismaticJoint",
    "ProductGroup",
    "Record",
    "ReducedHeavyTop",
    "Representation",
    "Retraction",
    "ReversibleController",
    "RevoluteJoint",
    "RigidBody",
    "RigidRod",
    "Rolling",
    "RotationAction",
    "SO3Algebra",
    "SemidirectProduct",
    "SeparableConstrainedSystem",
    "SeparableSystem",
    "Sp",
    "SphereAction",
    "SphericalMidpoint",
    "SphericalPendulum",
    "SplitConstrainedSystem",
    "SplitField",
    "SplitHamiltonian",
    "Splitting",
    "State",
    "StormerVerlet",
    "Straight",
    "Surface",
    "SundmanTransformed",
    "Suslov",
    "SymplecticEuler",
    "System",
    "Taylor",
    "ThreeRotations",
    "TimeScale",
    "TimeTransformed",
    "TodaLattice",
    "TokamakField",
    "TraceOfAd",
    "PiecewisePolynomial",
    "Plan",
    "Trajectory",
    "TranslationAction",
    "UniformField",
    "UniformGravity",
    "UnitQuaternions",
    "UniversalJoint",
    "Vec",
    "VectorField",
    "VectorSpace",
    "VelocityConstraint",
    "chain",
    "check_action",
    "check_group",
    "check_method",
    "check_poisson",
    "check_poisson_field",
    "check_retraction",
    "check_system",
    "coadjoint",
    "cross",
    "derivative",
    "dot",
    "errors",
    "gradient",
    "in_coordinates",
    "integrate",
    "jacobian",
    "mat",
    "norm",
    "outer",
    "plots",
    "poisson_defect",
    "record",
    "sum",
    "tableaus",
    "vec",
    "viewer",
]
