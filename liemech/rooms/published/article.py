"""Figure 1 of the article: a rigid body's momentum by RKMK and by the covariant method stays on its sphere."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...groups.retractions import Cayley
from ...integrators.rkmk import RKMK
from ...integrators.variational import CovariantVariational
from ...models.bodies.rigid_body import RigidBody
from ...simulation.integrate import integrate
from .compared import Compared

SOURCE = (
    "Geometric Numerical Methods with Lie Groups, sections 2 and 3, with J = diag(2/3, 1, 2), 200 steps of 0.5 s; the "
    "caption says that both lie exactly on the sphere"
)
MOMENTUM = np.cos(np.pi / 3), 0.0, np.sin(np.pi / 3)


def compared(full: bool) -> Iterator[Compared]:
    """The largest distance of the momentum from the unit sphere: more than 1e-13, the rounding of 200 steps, is a failure."""
    body = RigidBody([2.0 / 3.0, 1.0, 2.0])
    methods: dict[str, Any] = {"RKMK4": RKMK(order=4), "covariant method": CovariantVariational(Cayley())}
    for name, method in methods.items():
        run = integrate(body, method, body.state(MOMENTUM), h=0.5, steps=200, progress=False)
        distance = np.abs(np.linalg.norm(run.mu, axis=1) - 1.0).max()
        yield Compared(f"distance from the sphere, {name}", 0.0, float(distance), 1e-13)
