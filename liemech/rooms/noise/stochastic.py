"""Noise on coadjoint orbits: Lie-Poisson systems whose velocity has white noise in it."""

from __future__ import annotations

import math
from dataclasses import field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, InvalidType
from ...formulas import Record, Vec, dot, record, vectors
from ...formulas.classes.fields import frozen_array
from ...formulas.classes.records import with_fields
from ...formulas.numbers.philox import LARGEST
from ...groups.composed.power import PowerGroup
from ...groups.composed.species import SpeciesGroup
from ...groups.lie_group import LieGroup
from ...groups.retractions import Retraction
from ...systems.hamiltonian import Hamiltonian
from ...systems.lie_poisson import BodyState, LiePoissonMotion, LiePoissonSystem
from ...systems.many.energies import moving
from ...systems.many.site_state import NoisySites, SiteState
from .double_bracket import DoubleBracket


@record
class NoisyState(BodyState):
    """A body with the number of the path that its noise takes.

    mu, g : as for a body.  path : a whole number, or (bodies,) of them.
    """

    path: Any = None


@record
class ConstantField(Hamiltonian):
    """The energy whose velocity is the same everywhere: H(mu) = mu . direction.

    direction : in the algebra, (dim,).
    """

    direction: Vec

    def energy(self, mu: Vec) -> float:
        """mu . direction.  mu : (dim,)."""
        return dot(mu, self.direction)

    def gradient(self, mu: Vec) -> Vec:
        """The direction.  mu : (dim,)."""
        return self.direction


@record
class AlongStep(Record):
    """Weights of an energy and of noise fields, which are constant along a step; abstract."""

    drift: Any
    fields: tuple[Hamiltonian, ...]
    share: float
    weights: Vec

    def weighted(self, own: Any, of_field: Any) -> Any:
        """share own + sum_i weights_i of_field(field_i)."""
        return vectors.sum(
            [self.share * own, *[weight * of_field(field) for weight, field in zip(self.weights, self.fields)]]
        )


@record
class NoisyEnergy(AlongStep, Hamiltonian):
    """The energy along a step: share H + sum_i weights_i H_i."""

    @property
    def coupled(self) -> bool:  # type: ignore[override]
        """Is it that of one of many sites?  As that of the drift is."""
        return bool(self.drift.coupled)

    def energy(self, mu: Vec) -> float:
        """share H(mu) + sum_i weights_i H_i(mu).  mu : (dim,)."""
        return self.weighted(self.drift.energy(mu), lambda field: field.energy(mu))

    def gradient(self, mu: Vec) -> Vec:
        """The velocity.  mu : (dim,)."""
        return moving(self.drift, self.weighted(self.drift.gradient(mu), lambda field: field.gradient(mu)))


@record
class NoisyMotion(AlongStep, LiePoissonMotion):
    """The motion along a step where the drift has no energy alone: share xi + sum_i weights_i xi_i."""

    along_orbits: ClassVar[bool] = True

    @property
    def group(self) -> Any:
        return self.drift.group

    @property
    def hamiltonian(self) -> Any:
        """The energy of the drift."""
        return self.drift.hamiltonian

    def velocity(self, mu: Vec) -> Vec:
        """The velocity.  mu : (dim,)."""
        total = self.weighted(self.drift.velocity(mu), lambda field: field.gradient(mu))
        return moving(self.drift.hamiltonian, total)

    def rate(self, t: float, state: BodyState) -> Vec:
        """The body velocity at the momentum of the state, (dim,)."""
        return self.velocity(state.mu)


@record
class Stochastic(LiePoissonMotion):
    """Motion on coadjoint orbits under white noise, in the sense of Stratonovich: every path keeps the Casimirs.

        dmu = ad*_xi mu dt + sum_i ad*_xi_i mu o dW_i,   xi_i = dH_i/dmu,   g^-1 dg = xi dt + sum_i xi_i o dW_i

    system : the drift, a LiePoissonSystem or, with damping, a DoubleBracket.
    fields : the H_i, Hamiltonians; or directions in the algebra, (dim,), which stand for H_i = mu . direction.
    xi_i has the unit of a velocity times the root of the time.  An Ito equation has another drift, which leaves
    the orbits.
    seed : of the noise, a whole number.  The noise of a step is a function of the seed, the path of the body
    and the number of the step, and of nothing else.

    It is stepped by `WongZakai` or `NinomiyaVictoir` around a method for the drift.
    Raises InvalidType for a drift that leaves orbits, InvalidInput for fields of another dimension and for
    `calculus="ito"`.
    Source: Lazaro-Cami and Ortega, Stochastic Hamiltonian dynamical systems, Rep. Math. Phys. 61 (2008); Malham and
    Wiese, Stochastic Lie group integrators, SIAM J. Sci. Comput. 30 (2008).
    """

    noisy: ClassVar[bool] = True
    small: ClassVar[int] = 0  # many sites are never written out: each has the noise of its path
    alternatives: ClassVar[str] = "WongZakai(RKMK(order=4)) steps it, and NinomiyaVictoir() steps it in mean"

    system: LiePoissonSystem | DoubleBracket
    fields: tuple[Any, ...]
    seed: float = 0.0
    calculus: str = "stratonovich"
    motion: Any = field(init=False, repr=False)  # along a step

    def __post_init__(self) -> None:
        name, drift = type(self).__name__, self.system
        if not isinstance(drift, (LiePoissonSystem, DoubleBracket)):
            raise InvalidType(
                f"{name}: system must be a LiePoissonSystem, or a DoubleBracket, whose motion stays on coadjoint orbits; "
                f"got {drift!r}"
            )
        if self.calculus != "stratonovich":
            raise InvalidInput(
                f"{name}: calculus is 'stratonovich'; got {self.calculus!r}. By Ito's the same fields leave the "
                "coadjoint orbits: add -1/2 sum_i ad*_xi_i (ad*_xi_i mu) to the drift of an Ito equation to write it so"
            )
        if isinstance(drift.group, (PowerGroup, SpeciesGroup)) and (
            drift.site_form is None or isinstance(drift.group, SpeciesGroup)
        ):
            raise InvalidInput(
                f"{name}: the energy of many sites must be Terms on a power of one group, so that each has noise of its "
                f"own; got {drift!r:.90}"
            )
        require_whole(f"{name}: seed", np.asarray(self.seed))
        fields = tuple([_field(name, x, one_of(drift).dim) for x in self.fields])
        object.__setattr__(self, "fields", fields)
        zero_noise = 1.0, Vec.of([0.0] * len(fields))
        if drift.site_form is not None:
            motion: Any = drift  # of which the steps are those of its sites
        elif isinstance(drift, LiePoissonSystem):
            energy = NoisyEnergy(drift.hamiltonian, fields, *zero_noise)
            motion = LiePoissonSystem(drift.group, energy)
        else:
            motion = NoisyMotion(drift, fields, *zero_noise)
        object.__setattr__(self, "motion", motion)
        super().__post_init__()

    def __repr__(self) -> str:
        return f"Stochastic({self.system!r}, {list(self.fields)!r}, seed={self.seed:.0f})"

    @property
    def group(self) -> LieGroup:
        """The group of the drift."""
        return self.system.group

    @cached_property
    def site_form(self) -> Stochastic | None:
        """The noise of one of many sites, on a path of its own; None for one body."""
        site: Any = self.system.site_form
        return None if site is None else Stochastic(site, self.fields, self.seed)

    def _written_out(self, state: Any) -> Any:
        """The state of one body; raises IncompatibleSystem for many sites."""
        if isinstance(state, NoisySites):
            raise IncompatibleSystem(
                f"the noise of many sites is that of each, by h and steps, with samples at ends of steps; {self!r:.90} has "
                "no other runs"
            )
        return state

    def along(self, share: float, weights: Any) -> Any:
        """The motion by share xi + sum_i weights_i xi_i, without noise."""
        motion = self.motion
        if isinstance(motion, NoisyMotion):
            return with_fields(motion, share=share, weights=weights)
        energy = with_fields(motion.hamiltonian, share=share, weights=weights)
        return with_fields(motion, hamiltonian=energy)

    def energy(self, mu: Vec) -> float:
        """H(mu), of the drift.  mu : (dim,)."""
        return self.system.energy(mu)

    def essential_part(self, state: NoisyState) -> NoisyState:  # type: ignore[override]
        """Momentum and path, without the attitude."""
        return NoisyState(state.mu, None, state.path)

    def displaced(  # type: ignore[override]
        self, retraction: Retraction, state: NoisyState, omega: Vec
    ) -> NoisyState:
        body = self.motion.displaced(retraction, BodyState(state.mu, state.g), omega)
        return NoisyState(body.mu, body.g, state.path)

    def state(self, mu: Any = None, g: Any = None, *, xi: Any = None, path: Any = None) -> NoisyState:
        """A start for `integrate`, as `LiePoissonSystem.state` has it, and the paths of the noise.

        mu, xi : (dim,), or (bodies, dim) for an ensemble;  g : an element, or one for each body.
        path : a whole number from 0 to below 2^53, or (bodies,); None: 0, or 0, 1, 2, ... for the bodies of an ensemble.
        Bodies of one path have the same noise.
        Raises InvalidInput as that does, and for paths that are no such numbers.
        """
        name = f"{type(self).__name__}.state: path"
        body: Any = self.system.state(mu, g, xi=xi)
        bodies = body.bodies
        if isinstance(body, SiteState):
            shape = body.mu.shape[:-1]
            site_paths = np.arange(math.prod(shape)).reshape(shape) if path is None else np.asarray(path)
            require_whole(name, site_paths)
            if site_paths.shape != shape:
                raise InvalidInput(f"{name} has shape {site_paths.shape}; the sites have shape {shape}")
            return self._vouched(NoisySites(body.mu, body.g, frozen_array(site_paths.astype(float), "array")))
        numbers = np.asarray((0.0 if bodies is None else np.arange(bodies)) if path is None else path)
        require_whole(name, numbers)
        if numbers.shape not in ((), () if bodies is None else (bodies,)):
            raise InvalidInput(
                f"{name} has shape {numbers.shape}; there {'is one body' if bodies is None else f'are {bodies} bodies'}"
            )
        if bodies is None:
            paths: Any = float(numbers)
        else:
            paths = frozen_array(np.broadcast_to(numbers.astype(float), (bodies,)), "array")
        return self._vouched(NoisyState(body.mu, body.g, paths))


def require_whole(name: str, numbers: np.ndarray) -> None:
    """Raise InvalidInput unless these are whole numbers from 0 to below 2^53."""
    if (
        numbers.dtype.kind not in "iuf"
        or not ((numbers >= 0) & (numbers < LARGEST) & (numbers == np.floor(numbers))).all()
    ):
        raise InvalidInput(f"{name} is a whole number from 0 to below 2^53; got {numbers!r}")


def _field(name: str, field: Any, dim: int) -> Hamiltonian:
    """A noise field as a Hamiltonian; InvalidInput or InvalidType where it is none."""
    if not isinstance(field, Hamiltonian):
        try:
            direction = np.asarray(field, dtype=float)
        except (TypeError, ValueError):
            raise InvalidType(
                f"{name}: a field is a Hamiltonian H_i(mu), whose noise stays on the coadjoint orbits, or a direction "
                f"in the algebra, ({dim},); got {field!r}"
            ) from None
        if direction.shape != (dim,) or not np.isfinite(direction).all():
            raise InvalidInput(f"{name}: a direction of noise has {dim} finite components here; got {field!r:.90}")
        return ConstantField(Vec.of(direction.tolist()))
    shape = field._shape("mu", "Vec")
    if shape not in (None, (dim,)):
        raise InvalidInput(f"{name}: {field!r} takes vectors of {shape[0]} components, not {dim}")
    return field


def thermal_bath(system: LiePoissonSystem, damping: float, temperature: float, seed: float = 0.0) -> Stochastic:
    """A system in a bath: double-bracket damping, and noise of every direction in balance with it.

        d mu = ad*_(xi + damping ad*_xi mu) mu dt + sqrt(2 damping temperature) sum_i ad*_e_i mu o dW_i

    In the long run the momenta on an orbit have Boltzmann's distribution, exp(-H/temperature) times the
    invariant measure of the orbit.

    system : without damping.  damping : not negative.  temperature : k_B T, in the unit of the energy, not negative.
    seed : of the noise.
    Raises InvalidInput for negative numbers.
    Source: Brown, Thermal fluctuations of a single-domain particle, Phys. Rev. 130 (1963), for spins; Arnaudon,
    De Castro, Holm, Noise and dissipation on coadjoint orbits, J. Nonlinear Sci. 28 (2018), section 4.
    """
    number = np.asarray(temperature)
    if number.ndim or number.dtype.kind not in "iuf" or not 0.0 <= number < np.inf:
        raise InvalidInput(
            f"thermal_bath: temperature is a finite number, not negative; got {temperature!r}. Bodies with temperatures of "
            "their own are a list of baths"
        )
    damped = DoubleBracket(system, damping)
    strength, group = math.sqrt(2.0 * damping * temperature), one_of(system)
    return Stochastic(damped, tuple((strength * np.eye(group.dim)).tolist()), seed)


def one_of(system: Any) -> LieGroup:
    """The group of one of many sites; of a single body that of the system."""
    group: Any = system.group
    return group if system.site_form is None else group.base
