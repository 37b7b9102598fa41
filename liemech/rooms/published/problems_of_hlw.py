"""The pendulum, Kepler's ellipse and the outer Solar System of Hairer, Lubich and Wanner, to where their programs end."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...integrators.composition import Composition
from ...integrators.separable import StormerVerlet
from ...models.planets.kepler import Kepler
from ...models.planets.n_body import NBody
from ...models.swinging.pendulums import Pendulum
from ...simulation.integrate import integrate
from .compared import Compared

SOURCE = (
    "Hairer, Lubich and Wanner, Geometric Numerical Integration, I.1 and I.2; ends of the motions in the programs for the "
    "illustrations of the monograph (gni-codes, problem.f, comparison/cal_comp.f)"
)
PENDULUM = -0.443944662290259, 0.897846803312944
BODIES = "Sun", "Jupiter", "Saturn", "Uranus", "Neptune", "Pluto"
PLANETS = (
    (3.084118473380683, -1.227726356581642, -0.6162537634647217),
    (7.766584086800482, 0.2531065754551048, -0.09410571402013185),
    (-5.564967162844037, 1.674849740822012, 0.9767232069533176),
    (19.63899572895227, 8.95850455228646, 3.611839157057347),
    (24.93570870305177, 17.69518676153705, 6.583785164549242),
    (31.78592511375764, 38.63618958160644, 3.192794169732889),
)


def compared(full: bool) -> Iterator[Compared]:
    """After 2 pi from q = 0, p = 1; after 200 revolutions at e = 0.6; and after 500,000 days from 5 September 1994."""
    method, T = Composition(StormerVerlet(), order=8), 2.0 * np.pi

    def end(system: Any, start: Any, h: float, steps: int) -> np.ndarray:
        run = integrate(system, method, start, h=h, steps=steps, every=steps, progress=False)
        return np.concatenate([run.q[-1], run.p[-1]])

    pendulum, kepler = Pendulum(gravity=1.0), Kepler()
    for name, value, computed in zip("qp", PENDULUM, end(pendulum, pendulum.state([0.0], [1.0]), T / 100, 100)):
        yield Compared(f"pendulum, {name}", value, float(computed), 1e-14)
    ellipse = 0.4, 0.0, 0.0, 2.0
    after = end(kepler, kepler.state(ellipse[:2], ellipse[2:]), T / 400, 80_000)
    for name, value, computed in zip(("q1", "q2", "p1", "p2"), ellipse, after):
        yield Compared(f"Kepler, {name}", value, float(computed), 1e-9)
    system, start = NBody.outer_solar_system(barycentric=False)
    places = end(system, start, 25.0, 20_000)[:18].reshape(6, 3)
    for body, values, place in zip(BODIES, PLANETS, places):
        for name, value, computed in zip("xyz", values, place):
            yield Compared(f"{body}, {name}, AU", value, float(computed), 1e-11)
