"""Three equal masses follow each other on a figure of eight, and are back after the published period."""

from __future__ import annotations

from collections.abc import Iterator

from ...integrators.composition import Composition
from ...integrators.separable import StormerVerlet
from ...models.planets.n_body import NBody
from ...simulation.integrate import integrate
from .compared import Compared

SOURCE = "Chenciner and Montgomery, Annals of Mathematics 152 (2000), 881: data of C. Simo, eight digits"
PERIOD, PLACE, VELOCITY = 6.32591398, (0.97000436, -0.24308753), (-0.93240737, -0.86473146)


def compared(full: bool) -> Iterator[Compared]:
    """Where the first mass and the third are after the period, to what eight digits of the start allow."""
    (x, y), (u, v) = PLACE, VELOCITY
    system = NBody([1.0, 1.0, 1.0], dimension=2)
    start = system.state([x, y, -x, -y, 0.0, 0.0], [-0.5 * u, -0.5 * v, -0.5 * u, -0.5 * v, u, v])
    method = Composition(StormerVerlet(), order=8)
    run = integrate(system, method, start, h=PERIOD / 1000, steps=1000, every=1000, progress=False)
    q, p = run.q[-1], run.p[-1]
    for name, published, computed in zip(("x1", "y1", "x3'", "y3'"), (x, y, u, v), (q[0], q[1], p[4], p[5])):
        yield Compared(f"{name} after the period", published, float(computed), 1e-7)
