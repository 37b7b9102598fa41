"""Constrained systems with starts and references that several test files share."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

import liemech as lm
from liemech.formulas import derivative, vec

REFERENCES = Path(__file__).parent.parent / "reference"


def reference(name: str) -> dict[str, Any]:
    """The digits of a file as floats, its texts as they are."""

    def numbers(x: Any) -> Any:
        if isinstance(x, dict):
            return {key: numbers(value) for key, value in x.items()}
        if isinstance(x, list):
            return [numbers(value) for value in x]
        try:
            return float(x)
        except ValueError:
            return x

    found: dict[str, Any] = numbers(json.loads((REFERENCES / f"{name}.json").read_text()))
    return found


SPHERE = reference("spherical_pendulum")
PENDULUM = lm.SphericalPendulum(gravity=SPHERE["g"])
SWINGING = PENDULUM.state(SPHERE["q0"], SPHERE["v0"])

DOUBLE = reference("double_pendulum")
CHAIN = lm.models.ChainPendulum([DOUBLE["m1"], DOUBLE["m2"]], [DOUBLE["l1"], DOUBLE["l2"]], DOUBLE["g"], dimension=2)
MASSES = np.repeat([DOUBLE["m1"], DOUBLE["m2"]], 2)
HANGING = CHAIN.state(DOUBLE["q0"], MASSES * DOUBLE["v0"])


@lm.record
class Stretching(lm.ConstrainedSystem):
    """A particle on the unit sphere whose mass depends on where it is: not separable, and no derivative is written."""

    degrees: ClassVar[int] = 3

    def energy(self, q: lm.Vec, p: lm.Vec) -> float:
        return (1.0 + 0.5 * q[0] * q[0]) * lm.dot(p, p) / 2.0 + q[2]

    def constraint(self, q: lm.Vec) -> lm.Vec:
        return vec(lm.dot(q, q) - 1.0)


STRETCHING = Stretching()
MOVING = STRETCHING.state([0.6, 0.0, -0.8], [0.4, 0.9, 0.3])


def plain(system: lm.System, method: lm.Method, start: lm.State, h: float, steps: int, **options: Any) -> lm.Trajectory:
    """A run in plain Python, without compensation: the bare formulas."""
    return lm.integrate(
        system, method, start, h=h, steps=steps, compiled=False, compensated=False, progress=False, **options
    )


def end_of(run: lm.Trajectory) -> np.ndarray:
    """Positions and momenta at the end."""
    return np.concatenate([run.q[-1], run.p[-1]])


def stepped(method: Any, system: Any, h: float, y: Any) -> lm.Vec:
    """One step from y = (q, p) to the next."""
    n = len(y) // 2
    start = lm.CanonicalState(vec(*[y[i] for i in range(n)]), vec(*[y[n + i] for i in range(n)]))
    after = method.observe(method.step(system, 0.0, method.start(system, start, h), h))
    return vec(*after.q, *after.p)


def tangents(system: Any, y: np.ndarray) -> np.ndarray:
    """A basis of the tangent space of the manifold at y = (q, p), as rows."""
    n = system.degrees

    def both(z: Any) -> Any:
        q, p = vec(*[z[i] for i in range(n)]), vec(*[z[n + i] for i in range(n)])
        return vec(*system.constraint(q), *system.hidden_constraint(q, p))

    rows = np.array(lm.jacobian(both, vec(*y.tolist())))
    return np.linalg.svd(rows)[2][len(rows) :]


def two_form_defect(method: Any, system: Any, start: Any, h: float) -> float:
    """The largest change of dq dp on pairs of tangent vectors, by exact derivatives of one step."""
    y = np.array([*start.q, *start.p])
    before = tangents(system, y)
    after = [
        np.array(derivative(lambda z: stepped(method, system, h, z), vec(*y.tolist()), u.tolist())) for u in before
    ]
    n, (U, V) = system.degrees, (np.array(before), np.array(after))
    forms = [X[:, :n] @ X[:, n:].T - X[:, n:] @ X[:, :n].T for X in (U, V)]
    return float(np.abs(forms[1] - forms[0]).max())
