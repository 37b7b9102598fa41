"""Can a Hamiltonian be differentiated as often as a method wants it?  This is found out once,
before a run.
"""

from __future__ import annotations

from typing import Any

from ...errors import IncompatibleSystem, InvalidInput
from ...formulas import cos, derivative, dot, norm, vec
from ...formulas.classes.remembered import Remembered
from ...formulas.numbers.bases import Pair
from ...formulas.vectors import Vec
from ...integrators.method import alternatives
from ...integrators.motion_series import motion
from ...systems.agreement import APART, ROUNDING, parts_in_units
from ...systems.in_time.driven import DrivenLiePoissonSystem
from ...systems.many.energies import moving

_derivable = Remembered()
"""The Hamiltonians that passed, each with its dimension."""


def require_derivatives(method: Any, system: Any) -> None:
    """Raise unless the formulas of the Hamiltonian can be differentiated twice and its gradient, if
    given, is that of the energy.

    Tried at one momentum in no special direction.  A kink elsewhere stays unseen: at a kink,
    Newton's method will not converge.
    Raises IncompatibleSystem if a formula does not bear numbers that carry a derivative,
    InvalidInput for wrong values.

    Source: Griewank and Walther, Evaluating Derivatives, 2nd ed., chapter 3 (forward mode).
    """
    if system.is_large:  # its terms were tried one by one
        return
    if isinstance(system, DrivenLiePoissonSystem):
        require_derivatives(method, system.at(0.0))
        _require_series(method, system)
        return
    if system.lie_poisson is None:
        raise IncompatibleSystem(f"{method!r} needs a Lie-Poisson system; got {system!r}. {alternatives(system)}")
    hamiltonian, n = system.hamiltonian, system.group.dim
    if hamiltonian.coupled:
        raise IncompatibleSystem(
            f"{method!r} does not step sites one by one that feel each other. {alternatives(system)}"
        )
    # a record never changes: it is tried once, not at every run
    if _derivable.get(hamiltonian) == n:
        return
    name = type(hamiltonian).__name__
    mu, onward = (vec(*[float(cos(start + k)) for k in range(n)]) for start in (1.0, 2.0))
    try:
        energy = hamiltonian.energy(mu)
        if isinstance(energy, Pair):  # a parameter carries a derivative; without it the system was tried before the run
            return
        if not isinstance(energy, (int, float)):
            raise InvalidInput(f"{name}.energy must return a number; it returned {energy!r}")
        xi = system.velocity(mu)
        change = derivative(lambda m: system.velocity(m), mu, onward)
        directions = parts_in_units(moving(hamiltonian, onward), system.unit_blocks)
        slopes = [derivative(lambda m: system.energy(m), mu, along) for along in directions]
    except InvalidInput:
        raise
    except Exception as error:
        raise IncompatibleSystem(
            f"{method!r} differentiates the Hamiltonian, and {name} does not bear it "
            f"({type(error).__name__}: {error}). Write its energy with + - * / ** and functions of "
            "liemech.formulas (sqrt, sin, exp, ...), or use RKMK with a gradient of yours"
        ) from error
    for vector in (xi, change):
        if not isinstance(vector, Vec) or len(vector) != n or not all(isinstance(c, (int, float)) for c in vector):
            raise InvalidInput(f"{name}.gradient must return a vector of {n} numbers; it returned {xi!r}")
    whole = norm(xi) * norm(onward)
    for direction, slope in zip(directions, slopes):
        along = dot(xi, direction)
        component = vec(*[x if d != 0.0 else 0.0 for x, d in zip(xi, direction)])
        if abs(along - slope) > max(APART * norm(component) * norm(direction), ROUNDING * whole):
            raise InvalidInput(
                f"{name}.gradient is not the gradient of its energy: at mu = {tuple(mu)}, along "
                f"{tuple(direction)}, {along:.6g} instead of {slope:.6g}. Leave it out and it is "
                "derived"
            )
    _derivable.set(hamiltonian, n)


def _require_series(method: Any, system: DrivenLiePoissonSystem) -> None:
    """Raise IncompatibleSystem unless K(t, mu) can be expanded in powers of time too."""
    mu = vec(*[float(cos(1.0 + k)) for k in range(system.group.dim)])
    try:
        for component in motion(system, 0.125, mu, 0.5)[0]:
            component.term(2)
    except (TypeError, AttributeError) as error:
        raise IncompatibleSystem(
            f"{method!r} expands the energy in powers of time, and "
            f"{type(system.hamiltonian).__name__} does not bear it ({error}). Write it with + - * "
            "/ ** and functions of liemech.formulas (sin, exp, ...), or use RKMK"
        ) from error
    except (ArithmeticError, ValueError):  # not in their domain
        pass
