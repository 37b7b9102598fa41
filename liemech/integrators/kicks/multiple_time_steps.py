"""Multiple time steps: kicks by slow forces seldom, by fast ones often."""

from __future__ import annotations

import math
from typing import Any, ClassVar

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput, InvalidType
from ...formulas import Vec, gradient, jacobian, plain, record, vectors
from ...formulas.classes.records import with_fields
from ...formulas.vectors import small
from ...systems.canonical import CanonicalState
from ...systems.lie_poisson import BodyState
from ...systems.many.energies import OfManySites
from ...systems.many.site_state import StateOfSites
from ...systems.mechanical import MechanicalSystem
from ...systems.potential import OneTerm
from ...systems.separable import MultirateSystem
from ...systems.vector_field import SplitField, has_flow, recognised_field
from ..memory import Memory, Remembering
from ..method import Method, alternatives
from .kick_drift import KickDrift

NEAR = 0.1
"""How near h w may come to a multiple of pi, as a part of pi, before a resonance is warned of."""

LOOKED_AT = 8
"""Members of an ensemble that are looked at for a warning, the first ones."""


FAST = KickDrift()
"""The fastest steps of bodies in a field."""


@record
class MultipleTimeSteps(Remembering):
    """The impulse method (Verlet-I, r-RESPA): half a kick by the slow force, fast steps without it,
    half a kick.

        Phi_h = slow(h/2) o (fast(h/N))^N o slow(h/2),   fast(h) = the method of Stormer and Verlet, or again of this kind

    Of a MechanicalSystem whose potential is `Terms`, such as many bodies, the parts are its terms,
    the fastest first; fast(h) is KickDrift.
    Of a Linkage with a `potential` the slow force is that of the potential, and fast(h) is LieRATTLE
    with all others, such as stiff springs at joints: one ratio.
    Of a SplitField, y' = f_1(y) + ... + f_m(y), fastest part first, slow(h) and fast(h) are the
    motions of its parts, or steps of any symmetric `methods`.

    ratios : for a MultirateSystem of m parts, m - 1 whole numbers: how many steps with the first
    part there are in one with the second, and so on; (5, 2) makes ten steps with the fastest part,
    two with the second, one with the slowest.
    mollified : takes the slow potential at the mean A(q) of the positions that the fast motion goes
    through from rest in q, in a time h; its force is (dA/dq)^T f(A(q)), by differentiation.  For
    two parts of a MultirateSystem.
    methods : for a SplitField, one for each part, None for its own motion: symmetric ones, such as
    Splitting(order=2) of a part that is a sum again, or RKMK(tableau=tableaus.gauss(1)).

    Order 2, symmetric, symplectic; one slow force a step.  Where h w is near a multiple of pi, w a
    frequency of the fast part, the kicks are in resonance with it and the energy grows: a
    StepWarning says so of a MultirateSystem.  There the mollified force vanishes.

    Source: Grubmueller, Heller, Windemuth, Schulten, Mol. Simul. 6 (1991), 121; Tuckerman, Berne,
    Martyna, J. Chem. Phys. 97 (1992), 1990; mollified Garcia-Archilla, Sanz-Serna, Skeel, SIAM J.
    Sci. Comput. 20 (1998), 930; Hairer, Lubich, Wanner, VIII.4 and XIII.1; the slides, (3.10) and
    (3.11).
    """

    order: ClassVar[int] = 2
    symmetric: ClassVar[bool] = True
    symplectic: ClassVar[bool] = True

    ratios: tuple[int, ...] = (10,)
    mollified: bool = False
    methods: tuple[Method | None, ...] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.ratios, tuple | list):
            raise InvalidType(
                f"MultipleTimeSteps: ratios is a tuple of whole numbers, such as (10,); got {self.ratios!r}"
            )
        if not self.ratios or any(type(n) is not int or n < 1 for n in self.ratios):
            raise InvalidInput(
                f"MultipleTimeSteps: ratios are whole numbers of at least 1, such as (10,); got {self.ratios!r}"
            )
        if type(self.mollified) is not bool:
            raise InvalidType(f"MultipleTimeSteps: mollified is True or False; got {self.mollified!r}")
        if self.mollified and len(self.ratios) != 1:
            raise InvalidInput(f"MultipleTimeSteps: mollified is for two parts, with one ratio; got {self.ratios!r}")
        if self.methods is not None:
            self._check_methods(self.methods)
        super().__post_init__()

    def _check_methods(self, methods: Any) -> None:
        if not isinstance(methods, tuple) or len(methods) != len(self.ratios) + 1:
            raise InvalidInput(
                f"MultipleTimeSteps: methods is a tuple, for {len(self.ratios)} ratios of "
                f"{len(self.ratios) + 1}, None for the motion of a part itself; got {methods!r}"
            )
        if self.mollified:
            raise InvalidInput("MultipleTimeSteps: mollified is for a MultirateSystem, methods for a SplitField")
        for method in methods:
            if method is not None and not isinstance(method, Method):
                raise InvalidType(f"MultipleTimeSteps: methods are Methods or None; got {method!r}")
            if method is not None and (method.fictive or not method.symmetric_on(None)):
                raise InvalidInput(
                    f"MultipleTimeSteps: {method!r} is not symmetric with fixed steps, and "
                    "so the whole would not be. Splitting(order=2) is, and on R^n "
                    "RKMK(tableau=tableaus.gauss(1))"
                )

    @property
    def name(self) -> str:
        return f"{'Mollified impulse' if self.mollified else 'Impulse'} {':'.join(map(str, self.ratios))}"

    def require(self, system: Any) -> None:
        """A multirate system, or a sum of fields, with one more part than there are ratios."""
        if isinstance(system, SplitField):
            self._require_fields(system)
            return
        if isinstance(system, MechanicalSystem) and isinstance(system.potential, OfManySites):
            self._require_terms(system)
            return
        if _is_jointed(system):
            self._require_links(system)
            return
        if self.methods is not None:
            raise IncompatibleSystem(
                f"{self!r}: methods are for the parts of a SplitField; got {system!r}. Leave them "
                "out for a MultirateSystem"
            )
        if not isinstance(system, MultirateSystem):
            raise IncompatibleSystem(
                f"{self!r} needs a MultirateSystem, whose potential is a sum of fast and slow "
                f"parts, bodies in a field of Terms, or a SplitField; got {system!r}. "
                f"{alternatives(system)}"
            )
        if len(system.parts) != len(self.ratios) + 1:
            raise IncompatibleSystem(
                f"{self!r} has {len(self.ratios)} ratios, for {len(self.ratios) + 1} parts; "
                f"{system!r} has {system.parts}"
            )
        super().require(system)

    def _require_terms(self, system: MechanicalSystem) -> None:
        """A term for each rate, and no load."""
        if self.methods is not None or self.mollified or system.load is not None:
            raise IncompatibleSystem(f"{self!r}: bodies in a field take ratios alone, and no load; got {system!r}")
        parts: Any = system.potential
        if len(parts.parts) != len(self.ratios) + 1:
            raise IncompatibleSystem(
                f"{self!r} has {len(self.ratios)} ratios, for {len(self.ratios) + 1} terms, the fastest "
                f"first; {system!r} has {len(parts.parts)}"
            )
        FAST.require(system)

    def _require_links(self, system: Any) -> None:
        """One ratio, and a potential that is slow."""
        if self.methods is not None or self.mollified or len(self.ratios) != 1:
            raise IncompatibleSystem(
                f"{self!r}: a linkage takes one ratio, for its potential and all other forces; got {system!r}"
            )
        if system.potential is None:
            raise IncompatibleSystem(
                f"{self!r}: the slow force is that of the `potential` of a linkage, and {system!r} has none"
            )

    def _require_fields(self, system: SplitField) -> None:
        """A sum of as many fields, each with a motion or a method."""
        if len(system.parts) != len(self.ratios) + 1:
            raise IncompatibleSystem(
                f"{self!r} has {len(self.ratios)} ratios, for {len(self.ratios) + 1} parts; "
                f"{system!r} has {len(system.parts)}"
            )
        if self.mollified:
            raise IncompatibleSystem(f"{self!r}: mollified is for a MultirateSystem; got {system!r}")
        for k, part in enumerate(system.parts):
            method = None if self.methods is None else self.methods[k]
            if method is None and not has_flow(part):
                raise IncompatibleSystem(f"{self!r}: {recognised_field(part)}; or give it one of `methods`")
            if method is not None:
                method.require(part)
                if not method.symmetric_on(part):
                    raise IncompatibleSystem(
                        f"{self!r}: {method!r} is not symmetric on {part!r}, and so the whole would not be"
                    )
        super().require(system)

    def step_warning(self, system: Any, start: Any, h: float) -> str | None:
        """A warning of resonance or of unstable fast steps, by the frequencies at the start of all
        parts but the slowest.
        """
        if isinstance(system, (SplitField, MechanicalSystem)) or _is_jointed(system):
            return None
        if isinstance(start, StateOfSites):  # more numbers than have a matrix
            return None
        if start.bodies is None:
            return self._caution(system, start.q, start.p, h)
        for q, p in zip(start.q[:LOOKED_AT], start.p[:LOOKED_AT], strict=True):
            doubt = self._caution(system, small(q), small(p), h)
            if doubt is not None:
                return doubt
        return None

    def _caution(self, system: Any, q: Vec, p: Vec, h: float) -> str | None:
        """The warning for one body; None where the forces have no derivative."""
        last = len(self.ratios)
        try:
            by_p = np.array(jacobian(lambda x: system.velocity(q, x), p))
            hessian = np.array(jacobian(lambda x: vectors.sum([system.part_force(k, x) for k in range(last)]), q))
            squares = np.real(np.linalg.eigvals(-by_p @ hessian))
        # LinAlgError, for entries that are not finite, is a ValueError
        except (ArithmeticError, ValueError):
            return None
        frequencies = np.sqrt(np.maximum(squares, 0.0))
        phases = abs(h) * frequencies
        steps = math.prod(self.ratios)
        if phases.max() >= 2.0 * steps:
            return (
                f"{self!r}: the fast steps h/{steps} = {h / steps:g} are unstable for the "
                f"frequency {frequencies.max():.3g} of the fast part; try ratios whose product is "
                f"{math.ceil(phases.max())} or more"
            )
        near = [
            w
            for w, phase in zip(frequencies, phases)
            if phase > (1.0 - NEAR) * math.pi and abs(phase / math.pi - round(phase / math.pi)) < NEAR
        ]
        if near and not self.mollified:
            return (
                f"{self!r}: h = {h:g} is in resonance with the frequency {near[0]:.3g} of the fast "
                "part, h w being near a multiple of pi; the energy may grow. Try h = "
                f"{0.8 * math.pi / frequencies.max():.3g}, or mollified=True"
            )
        return None

    # ---------------------------------------------------------------- one step

    def at_node(self, system: Any, state: Any, h: float) -> Any:
        """The force of each part, None for a mollified one; nothing of fields."""
        if isinstance(system, SplitField):
            return None
        if _is_jointed(system):
            raise IncompatibleSystem(
                f"{self!r}: a linkage steps this way by loops over bodies and joints, in runs of fixed steps, "
                "without inputs that jump and without rotors (armature=)"
            )
        if isinstance(system, MechanicalSystem):
            fastest, *slower = self._parts(system)
            forces = [part.force(state.g) for part in slower]
            return FAST.at_node(fastest, state, h), tuple(forces)
        q, parts = plain(state.q), len(self.ratios)
        slowest = None if self.mollified else system.part_force(parts, q)
        return (*[system.part_force(k, q) for k in range(parts)], slowest)

    def beginning(self, system: Any, state: Any, h: float) -> Any:
        """The past of the fastest steps of bodies; empty otherwise."""
        if not isinstance(system, MechanicalSystem):
            return ()
        for ratio in self.ratios:
            h = h / ratio
        return FAST.beginning(self._parts(system)[0], state, h)

    def step(self, system: Any, t: float, memory: Memory, h: float) -> Memory:
        """Kicks at all rates, each half before and half after those that are faster."""
        state, forces = memory.state, memory.node
        if isinstance(system, SplitField):
            return Memory(self._of_fields(system, len(self.ratios), state, h), None, ())
        if isinstance(system, MechanicalSystem):
            before = Memory(state, forces[0], memory.past)
            parts = self._parts(system)
            after, slow = self._of_terms(parts, len(self.ratios), t, before, forces[1], h)
            return Memory(after.state, (after.node, slow), after.past)
        if not self.mollified:
            return Memory(*self._advanced(system, len(self.ratios), state, forces, h), ())
        fast = (forces[0],)
        kicked = CanonicalState(state.q, state.p + (0.5 * h) * self._mollified(system, plain(state.q), h))
        for _ in range(self.ratios[0]):
            kicked, fast = self._advanced(system, 0, kicked, fast, h / self.ratios[0])
        slow = self._mollified(system, plain(kicked.q), h)
        return Memory(CanonicalState(kicked.q, kicked.p + (0.5 * h) * slow), (fast[0], None), ())

    def _advanced(
        self, system: Any, k: int, state: CanonicalState, forces: Any, h: float
    ) -> tuple[CanonicalState, Any]:
        """A step of length h with the parts 0 to k: the state, and the forces there."""
        state = CanonicalState(state.q, state.p + (0.5 * h) * forces[k])
        faster = forces[:k]
        if k == 0:
            state = CanonicalState(state.q + h * system.velocity(plain(state.q), plain(state.p)), state.p)
        else:
            for _ in range(self.ratios[k - 1]):
                state, faster = self._advanced(system, k - 1, state, faster, h / self.ratios[k - 1])
        force = system.part_force(k, plain(state.q))
        return CanonicalState(state.q, state.p + (0.5 * h) * force), (*faster, force)

    def _parts(self, system: Any) -> list[Any]:
        """The bodies in the field of each term alone."""
        return [with_fields(system, potential=OneTerm(system.potential, k)) for k in range(len(self.ratios) + 1)]

    def _of_terms(
        self, parts: list[Any], k: int, t: float, memory: Memory, forces: Any, h: float
    ) -> tuple[Memory, Any]:
        """A step of length h with the terms 0 to k: the memory of the fastest steps, and the forces of the others."""
        if k == 0:
            return FAST.step(parts[0], t, memory, h), ()
        memory, faster = _kicked(memory, (0.5 * h) * forces[k - 1]), forces[: k - 1]
        s = h / self.ratios[k - 1]
        for i in range(self.ratios[k - 1]):
            memory, faster = self._of_terms(parts, k - 1, t + i * s, memory, faster, s)
        force = parts[k].force(memory.state.g)
        return _kicked(memory, (0.5 * h) * force), (*faster, force)

    def _of_fields(self, system: Any, k: int, state: Any, h: float) -> Any:
        """A step of length h of the fields 0 to k."""
        if k == 0:
            return self._moved(system, 0, state, h)
        state = self._moved(system, k, state, 0.5 * h)
        for _ in range(self.ratios[k - 1]):
            state = self._of_fields(system, k - 1, state, h / self.ratios[k - 1])
        return self._moved(system, k, state, 0.5 * h)

    def _moved(self, system: Any, k: int, state: Any, h: float) -> Any:
        """The motion of one field for the time h, or a step of its method."""
        method = None if self.methods is None else self.methods[k]
        if method is None:
            return system.in_turn(state, [(k, h)])
        part = system.parts[k]
        return method.observe(method.step(part, 0.0, method.start(part, state, h), h))

    # ---------------------------------------------------------------- the mollified force

    def _mollified(self, system: Any, q: Vec, h: float) -> Vec:
        """-d/dq of the slow potential at the mean position."""
        return -gradient(lambda x: system.part(1, self._mean(system, x, h)), q)

    def _mean(self, system: Any, q: Vec, h: float) -> Vec:
        """The mean over a step of the positions of the fast motion that starts at q at rest, by the
        fast steps and trapezoids.
        """
        n = self.ratios[0]
        s = h / n
        x, p, total = q, 0.0 * q, 0.5 * q
        for i in range(n):
            p = p + ((0.5 if i == 0 else 1.0) * s) * system.part_force(0, x)
            x = x + s * system.velocity(x, p)
            total = total + (0.5 if i == n - 1 else 1.0) * x
        return (1.0 / n) * total


def _kicked(memory: Memory, kick: Vec) -> Memory:
    """The memory of a method, with another momentum."""
    state = memory.state
    return Memory(BodyState(state.mu + kick, state.g), memory.node, memory.past)


def _is_jointed(system: Any) -> bool:
    """Whether the system is a linkage that is stepped by loops over bodies and joints."""
    return system.site_form is not None and system.site_form.jointed
