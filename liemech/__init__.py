"""liemech: mechanics on Lie groups, with integrators that keep the geometry.

    import liemech as lm

    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    run = lm.integrate(body, lm.RKMK(order=4), start, h=0.1, steps=10_000)

Spaces are objects, their elements arrays.  A method steps a system, `integrate` owns the loop, a `Trajectory` the samples.
"""

from typing import Any

from . import errors
from .groups.coadjoint import CoadjointAction, coadjoint
from .groups.lie_algebra import LieAlgebra
from .groups.lie_group import LieGroup
from .groups.so3 import SO3, SO3Algebra
from .integrate import integrate
from .integrators.method import Method
from .integrators.rkmk import RKMK
from .integrators.variational import CovariantVariational
from .models.rigid_body import RigidBody
from .native import Ambient, Element, Mat, Record, Vec, cross, derivative, dot, jacobian, mat, norm, outer, record, vec
from .retractions import Cayley, CayleyAdjoint, Exponential, Retraction
from .systems.group_equation import GroupEquation, LinearGroupEquation
from .systems.hamiltonian import Hamiltonian
from .systems.kinetic_energy import KineticEnergy
from .systems.lagrangian import Lagrangian
from .systems.lie_poisson import BodyState, LiePoissonSystem
from .systems.system import State, System
from .tableaus.tableau import ButcherTableau
from .trajectory import Trajectory


def __getattr__(name: str) -> Any:
    """`liemech.plots`, imported when first asked for."""
    if name != "plots":
        raise AttributeError(f"module 'liemech' has no attribute {name!r}")
    from importlib import import_module

    return import_module(".plots", __name__)


__version__ = "0.1.0"

__all__ = [
    "SO3",
    "Ambient",
    "BodyState",
    "ButcherTableau",
    "Cayley",
    "CayleyAdjoint",
    "CoadjointAction",
    "CovariantVariational",
    "Element",
    "Exponential",
    "GroupEquation",
    "Hamiltonian",
    "KineticEnergy",
    "Lagrangian",
    "LieAlgebra",
    "LieGroup",
    "LiePoissonSystem",
    "LinearGroupEquation",
    "Mat",
    "Method",
    "RKMK",
    "Record",
    "Retraction",
    "RigidBody",
    "SO3Algebra",
    "State",
    "System",
    "Trajectory",
    "Vec",
    "coadjoint",
    "cross",
    "derivative",
    "dot",
    "errors",
    "integrate",
    "jacobian",
    "mat",
    "norm",
    "outer",
    "record",
    "vec",
]
