"""Cosserat rods: chains of frames on SE(3), whose elements stretch, shear, bend and twist."""

from __future__ import annotations

import itertools
from dataclasses import field
from functools import cached_property
from typing import Any

import numpy as np

from ...errors import InvalidInput, require
from ...formulas import Mat, Vec, check_finite, dot, real_array, record, vec
from ...formulas.classes.derived import closed_form_of
from ...formulas.classes.of_each import Each, each
from ...groups.retractions import Exponential, Retraction
from ...groups.rigid.se3 import SE3, join
from ...rooms.fields.cell import CellTerm
from ...rooms.fields.density import FieldDensity, StrainEnergy
from ...rooms.fields.in_cells import FieldInCells
from ...rooms.sites.terms.terms import PerSite, Term
from ...systems.kinetic_energy import KineticEnergy, times
from ...systems.potential import Force
from ..input_checks import check_positive
from .rod_section import RodSection
from .rod_statics import balance, equilibrium

ENDS = "clamped", "hinged", "free"

STRAIGHT = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
"""The strain of a straight rod along e3: no curvature, and every metre is a metre."""


@record
class RodStrain(CellTerm):
    """The energy of an element of a rod between two frames, a term of two on SE(3):

        W = (l/2) e . K e,   e = tau^-1(g_a^-1 g_b)/l - u_0

    l : the length of the element.  stiffness : K, (6,), of curvatures about e1, e2, of twist, of
    shear along e1, e2 and of stretch; a matrix (6, 6) couples them.  rest : u_0, the strain without
    force, (6,), in rad/m and 1.
    retraction : tau.  With Exponential() an element is the piece of a helix whose curvatures, twist,
    shear and stretch are constant; Cayley() and CayleyAdjoint() differ from it by l^2/12 of the
    squared curvature, and cost less.

    The forces on the ends are m carried to each, (dtau^-1_x)* m, x = tau^-1(g_a^-1 g_b), m = K e.

    Source: Sonneville, Cardona and Bruls, Comput. Methods Appl. Mech. Eng. 268 (2014), 451
    (elements of constant strain on SE(3)); Simo, ibid. 49 (1985), 55.
    """

    length: float
    stiffness: Vec | Mat
    rest: Vec = Vec(*STRAIGHT)
    retraction: Retraction = Exponential()

    @property
    def on(self) -> SE3:
        """SE(3)."""
        return SE3()

    def strain(self, a: Any, b: Any) -> Vec:
        """e, (6,): what curvatures, twist, shear and stretch are beyond those at rest."""
        return (1.0 / self.length) * self.displacement(a, b) - self.rest

    def stored(self, eta: Vec) -> float:
        """(u - u_0) . K (u - u_0)/2."""
        return 0.5 * dot(eta - self.rest, self.stress(eta))

    def stress(self, eta: Vec) -> Vec:
        """m = K (u - u_0), moment and force in the element."""
        return times(self.stiffness, eta - self.rest)

    def moduli(self, eta: Vec) -> Mat | Vec:
        return self.stiffness


@record
class DeadForce(Term):
    """A force in space that pulls at a frame, such as its weight: V = -F . p.

    force : F, (3,), in N.
    Source: Goldstein, Classical Mechanics, 3rd ed., section 1.3.
    """

    pull: Vec

    def energy(self, a: Any) -> float:
        """The potential -F . p of a force F in space."""
        return -dot(self.pull, vec(a.g[0, 3], a.g[1, 3], a.g[2, 3]))

    def force(self, group: Any, k: int, *sites: Any) -> Vec:
        """The torque and the force in the frame, (0, R^T F)."""
        return join(vec(0.0, 0.0, 0.0), turned_back(sites[0].g, self.pull))


@record
class RodLoad(Force):
    """A wrench that turns with the frame, a moment in space, and drag: F = w + (R^T M, 0) - c J xi.

    following : w, (6,), moment and force in the axes of the frame.  moment : M, (3,), in N m.
    drag : c J, (6,).
    Source: Antman, Nonlinear Problems of Elasticity, 2nd ed., section 8.2 (following and dead loads).
    """

    following: Vec
    moment: Vec
    drag: Vec

    def covector(self, t: float, xi: Vec, g: Any) -> Vec:
        """w + (R^T M, 0) - c J xi."""
        moment = turned_back(g, self.moment)
        return (self.following + join(moment, vec(0.0, 0.0, 0.0))) - self.drag * xi


def turned_back(g: Any, a: Vec) -> Vec:
    """The vector R^T a in the frame's axes."""
    return vec(*[a[0] * g[0, j] + a[1] * g[1, j] + a[2] * g[2, j] for j in range(3)])


@record
class CosseratRod(FieldInCells):
    """An elastic rod that stretches, shears, bends and twists as far as it likes, in `elements` of
    constant strain between frames on SE(3).

        H = sum_k mu_k . J_k^-1 mu_k/2 + sum_k (l/2) e_k . K e_k - sum_k F_k . p_k,   e_k = tau^-1(g_k^-1 g_k+1)/l - u_0

    section : a RodSection, stiffness K and inertia per length.  length : in m, without force.
    elements : N, with N + 1 frames, each with the mass and the rotary inertia of half of the
    elements at it; e3 points along the rod.
    ends : "clamped", "hinged" or "free", of the first frame and the last.  closed : the last element
    leads back to the first of N frames; there are no ends.
    gravity : in m/s^2, downwards along e3 of space.
    tip_force, tip_moment : in space, on the last frame, (3,).  following : (6,), moment and force
    on it in its own axes.  Moments and following loads have no potential.
    damping : c, in 1/s: every frame is slowed by the force -c J xi.
    rest : the strain without force, (6,) or (N, 6), as `strains` gives it; left out, straight.
    retraction : tau, of `RodStrain`.

    Configurations are those of SE3() ** (N + 1): mu, (N + 1, 6), in the axes of each frame, g,
    (N + 1, 4, 4), as `straight` and `along` make them.  Steps are KickDrift()'s; of a stiff rod
    GalerkinVariational(order=2), which solves for all frames together.

    Source: Simo, Comput. Methods Appl. Mech. Eng. 49 (1985), 55; Simo and Vu-Quoc, ibid. 58 (1986),
    79 and 66 (1988), 125; Sonneville, Cardona and Bruls, ibid. 268 (2014), 451; Demoures et al.,
    Numer. Math. 130 (2015), 73 (variational integrators of beams).
    """

    section: RodSection = field(repr=False)
    length: float
    elements: int
    ends: tuple[str, str] = ("clamped", "free")
    closed: bool = False
    gravity: float = 0.0
    tip_force: Vec = Vec(0.0, 0.0, 0.0)
    tip_moment: Vec = Vec(0.0, 0.0, 0.0)
    following: Vec = Vec(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    damping: float = 0.0
    rest: Any = Vec(*STRAIGHT)
    retraction: Retraction = Exponential()

    def _check(self) -> None:
        name = type(self).__name__
        require(
            f"{name}: section", self.section, RodSection, "a RodSection, such as RodSection.round(0.01, 1e6, 1000.0)"
        )
        require(f"{name}: retraction", self.retraction, Retraction, "Exponential()")
        least = 3 if self.closed else 1
        if type(self.elements) is not int or self.elements < least:
            raise InvalidInput(f"{name}: elements must be a whole number from {least} on; got {self.elements!r}")
        ends: Any = self.ends
        if not isinstance(ends, (tuple, list)) or len(ends) != 2 or not {*ends} <= {*ENDS}:
            raise InvalidInput(f"{name}: ends are two of {ENDS}; got {ends!r}")
        object.__setattr__(self, "ends", tuple(ends))
        check_positive(self, "length")
        for what, shape in (
            ("gravity", ()), ("damping", ()), ("tip_force", (3,)), ("tip_moment", (3,)), ("following", (6,)),
        ):  # fmt: skip
            value = real_array(getattr(self, what), f"{name}: {what}")
            check_finite(value, f"{name}: {what}")
            if value.shape != shape:
                raise InvalidInput(f"{name}: {what} has shape {value.shape}; give {shape}")
        if self.damping < 0.0:
            raise InvalidInput(f"{name}: damping is not negative; got {self.damping:g}")
        if not isinstance(self.rest, Each):
            strain = real_array(self.rest, f"{name}: rest")
            check_finite(strain, f"{name}: rest")
            if strain.shape not in ((6,), (self.elements, 6)):
                raise InvalidInput(
                    f"{name}: rest is a strain, (6,), or one for each element, ({self.elements}, 6); "
                    f"got shape {strain.shape}"
                )
            object.__setattr__(self, "rest", Vec.of(strain) if strain.ndim == 1 else each(strain))
        if self.closed and (any(self.tip_force) or any(self.tip_moment) or any(self.following)):
            raise InvalidInput(f"{name}: a closed rod has no tip to load")

    # ---------------------------------------------------------------- as a field

    @property
    def target(self) -> SE3:
        """SE(3), the group of the frames."""
        return SE3()

    @property
    def cells(self) -> int:
        """The number of elements of the rod."""
        return self.elements

    @cached_property
    def density(self) -> FieldDensity:
        """xi . J xi/2 - (u - u_0) . K (u - u_0)/2."""
        section = self.section
        return FieldDensity(KineticEnergy(section.inertia), StrainEnergy(section.stiffness, self.rest))

    @cached_property
    def element(self) -> RodStrain:
        """The energy of an element."""
        return RodStrain(self.length / self.elements, self.section.stiffness, self.rest, self.retraction)

    def held(self) -> tuple[list[int], list[int]]:
        """The frames that are clamped, and those that are hinged."""
        ends = [*zip((0, self.elements), () if self.closed else self.ends)]
        clamped, hinged = ([node for node, end in ends if end == what] for what in ENDS[:2])
        return clamped, hinged

    def others(self) -> tuple[list[Any], Any]:
        pull, M, w = self.loads
        load = None
        if self.damping or w.any() or M.any():
            load = PerSite(RodLoad(each(w), each(M), each(self.damping * self.inertias)))
        return [DeadForce(each(pull)).over()] if pull.any() else [], load

    @property
    def frames(self) -> int:
        """The number of frames of the rod."""
        return self.nodes

    @property
    def inertias(self) -> np.ndarray:
        """The inertias of the frames, (frames, 6): at each frame half of the elements beside it."""
        return np.asarray(self.parts[:, None] * np.array(self.section.inertia))

    @property
    def loads(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Forces and moments in space, (frames, 3) each, and those that turn with the frames, (frames, 6)."""
        pull, moment = np.zeros((2, self.frames, 3))
        following = np.zeros((self.frames, 6))
        pull[:, 2] = -self.gravity * self.inertias[:, 5]
        pull[-1] += np.array(self.tip_force)
        moment[-1], following[-1] = np.array(self.tip_moment), np.array(self.following)
        return pull, moment, following

    @property
    def free(self) -> np.ndarray:
        """Which components of the displacements of the frames the ends leave free, (6 frames,)."""
        free = np.ones((self.frames, 6), dtype=bool)
        for k, end in zip((0, -1), () if self.closed else self.ends):
            free[k, {"clamped": 0, "hinged": 3, "free": 6}[end] :] = False
        return free.ravel()

    @property
    def rest_strain(self) -> np.ndarray:
        """u_0 of the elements, (6,) or (N, 6)."""
        strain: Any = self.element.rest
        return strain.values if isinstance(strain, Each) else np.array(strain)

    # ---------------------------------------------------------------- shapes

    def along(self, curve: Any, twist: float = 0.0) -> np.ndarray:
        """Frames along a curve, (frames, 4, 4), with e3 along it, and e1, e2 turning about it by
        `twist` rad in all.

        curve : a function of the arc s in m that gives a place, (3,), or the places of the frames,
        (frames, 3).  Without twist the frames do not turn about the curve; those of a closed rod
        turn evenly so that they meet.
        Source: Wang, Juettler, Zheng and Liu, ACM Trans. Graph. 27 (2008) (double reflection).
        """
        name, l = f"{type(self).__name__}.along", self.length / self.elements
        if callable(curve):
            near = 0.01 * l * np.array([[-2.0], [-1.0], [0.0], [1.0], [2.0]])
            x = np.array([[curve(s) for s in row] for row in self.arc + near], dtype=float)
            t, x = (x[0] - x[4]) + 8.0 * (x[3] - x[1]), x[2]
        else:
            x = real_array(curve, f"{name}: curve")
            if x.shape != (self.frames, 3):
                raise InvalidInput(f"{name}: curve is ({self.frames}, 3); got shape {x.shape}")
            ends = [x[-1], x[0]] if self.closed else [2.0 * x[0] - x[1], 2.0 * x[-1] - x[-2]]
            t = np.concatenate([x[1:], ends[1:]]) - np.concatenate([ends[:1], x[:-1]])
        check_finite(x, f"{name}: curve")
        sizes = np.linalg.norm(t, axis=1)[:, None]
        if not (sizes > 0.0).all():
            raise InvalidInput(f"{name}: two places of the curve are the same")
        t = t / sizes
        first = np.eye(3)[np.abs(t[0]).argmin()]
        across = [np.cross(np.cross(t[0], first), t[0])]
        order = [*range(self.frames), *([0] if self.closed else [])]
        for i, k in itertools.pairwise(order):
            v = x[k] - x[i]
            mirror = 2.0 * v / (v @ v)
            r, u = across[-1] - (mirror @ across[-1]) * v, t[i] - (mirror @ t[i]) * v
            w = t[k] - u
            size = w @ w
            across.append(r if size == 0.0 else r - (2.0 * (w @ r) / size) * w)
        turn = twist * self.arc / self.length
        if self.closed:
            off = np.arctan2(t[0] @ np.cross(across[-1], across[0]), across[-1] @ across[0])
            turn = (twist + off) * self.arc / self.length
        e1 = np.array(across[: self.frames])
        e1 = e1 / np.linalg.norm(e1, axis=1)[:, None]
        e2 = np.cross(t, e1)
        c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
        frames = np.tile(np.eye(4), (self.frames, 1, 1))
        frames[:, :3, :3] = np.stack([c * e1 + s * e2, c * e2 - s * e1, t], axis=-1)
        frames[:, :3, 3] = x
        return frames

    # ---------------------------------------------------------------- what one asks of a rod

    def between(self, g: Any, pieces: int) -> np.ndarray:
        """The frames and others between them, `pieces` to an element: g_a tau(s tau^-1(g_a^-1 g_b)), the
        shape of an element of constant strain.  g : (..., frames, 4, 4); (..., N pieces + 1, 4, 4).

        Source: Sonneville, Cardona and Bruls, Comput. Methods Appl. Mech. Eng. 268 (2014), 451.
        """
        first, second, x = self._displacements("between", g)
        s = np.arange(pieces)[:, None] / pieces
        moved = np.asarray(self.retraction.tau(SE3(), s * x[..., None, :]))
        frames = SE3().compose(first[..., None, :, :], moved)
        frames = frames.reshape(*first.shape[:-3], -1, 4, 4)
        return np.concatenate([frames, second[..., -1:, :, :]], axis=-3)

    @closed_form_of("element")
    def wrenches(self, g: Any) -> np.ndarray:
        """Moment and force in the elements, K (u - u_0), (..., N, 6), in N m and N, in their own
        axes.  g : (..., frames, 4, 4).
        """
        return self.stresses(g)

    def stiffness(self, g: Any) -> Any:
        """How the forces on all frames fall as these move, -df/dzeta with g exp(zeta): a sparse
        matrix of SciPy, (6 frames, 6 frames).  g : (frames, 4, 4).

        Where forces balance, the roots of its eigenvalues beside `inertias` are the frequencies of
        small oscillations, for the components that `free` names.
        """
        return balance(self, self._frames("stiffness", g))[1]

    def equilibrium(self, g: Any = None, stages: int = 10) -> np.ndarray:
        """Frames at which all forces balance, (frames, 4, 4), by Newton's method, with the loads put
        on in equal stages.

        g : frames near by, (frames, 4, 4); those without force if left out.  A rod with a load that
        nothing holds has none.  Raises NoConvergence.
        """
        near = self.shape() if g is None else self._frames("equilibrium", g)
        return equilibrium(self, near, stages)

    def _frames(self, name: str, g: Any) -> np.ndarray:
        frames = real_array(g, f"{type(self).__name__}.{name}: g")
        if frames.shape != (self.frames, 4, 4):
            raise InvalidInput(f"{type(self).__name__}.{name}: g is ({self.frames}, 4, 4); got shape {frames.shape}")
        return frames

    def momenta_of_sites(self, states: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """The total momentum of a rod that nothing holds and pulls at, angular and linear."""
        momenta = super().momenta_of_sites(states).values()
        return {
            name: total[..., k : k + 3] for total in momenta for name, k in (("angular momentum", 0), ("momentum", 3))
        }
