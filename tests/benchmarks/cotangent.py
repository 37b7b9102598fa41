"""Energies of momentum and place: a step of each order beside the methods for bodies in fields; and a charged top to an
error, with what its energy does.

python tests/benchmarks/cotangent.py [--quick] [--out results.json]
"""

from typing import Any, ClassVar

import harness
import numpy as np
from stepping import Native, measure

import liemech as lm

MU, G, H, T = [0.5, 1.1, -0.4], lm.SO3().exp([0.3, -0.4, 0.5]), 0.1, 10.0
ERRORS = 1e-3, 1e-6, 1e-9
BODY = lm.RigidBody([1.0, 1.6, 2.3])
FREE = lm.MechanicalSystem(BODY, lm.NoPotential())
TOP = lm.MechanicalSystem(BODY, lm.models.FixedPointGravity(0.8, [0.1, 0.2, 1.0]))


@lm.record
class ChargedTop(lm.CotangentSystem):
    """A heavy charged body in a magnetic field along the vertical."""

    configurations: ClassVar[lm.LieGroup] = lm.SO3()

    inertia: lm.Vec
    charges: lm.Mat
    weight: lm.Vec
    field: float

    def energy(self, mu: lm.Vec, g: Any) -> float:
        v = mu - 0.5 * self.field * (self.charges @ g[2])
        return 0.5 * lm.dot(v, v / self.inertia) + lm.dot(self.weight, g[2])


@lm.record
class OfEnergy(lm.CotangentSystem):
    """The free body by its energy, as if it could depend on the place."""

    configurations: ClassVar[lm.LieGroup] = lm.SO3()

    inertia: lm.Vec

    def energy(self, mu: lm.Vec, g: Any) -> float:
        return 0.5 * lm.dot(mu, mu / self.inertia)


@lm.record
class OfLagrangian(lm.TangentSystem):
    """The free body by its Lagrangian, as if it could depend on the place."""

    configurations: ClassVar[lm.LieGroup] = lm.SO3()

    inertia: lm.Vec

    def lagrangian(self, xi: lm.Vec, g: Any) -> float:
        return 0.5 * lm.dot(xi, self.inertia * xi)


CHARGED = ChargedTop([1.0, 1.6, 2.3], [[1.1, 0.3, 0.0], [0.3, 0.7, 0.2], [0.0, 0.2, 1.3]], [0.08, 0.16, 0.8], 1.2)
ORDERS = [lm.SymplecticRKMK(order) for order in (2, 4, 6)]
PAIRS: dict[str, list[tuple[Any, Any]]] = {
    **{
        f"free body {how}": [(BODY, lm.CovariantVariational()), (system, ORDERS[0])]
        for how, system in (
            ("in no field", FREE),
            ("of an energy", OfEnergy([1.0, 1.6, 2.3])),
            ("of a Lagrangian", OfLagrangian([1.0, 1.6, 2.3])),
        )
    },
    "heavy top": [
        *[(TOP, lm.LieVerlet()), *[(TOP, lm.GalerkinVariational(k)) for k in (2, 4, 6)]],
        *[(TOP, method) for method in ORDERS],
    ],
    "charged top": [(CHARGED, lm.RKMK(order=4)), *[(CHARGED, method) for method in ORDERS]],
}


def runs_of(method: Any, true: Any) -> list[tuple[int, float, float]]:
    """Steps, microseconds and the error of momentum and attitude at T of runs, to the least of ERRORS."""
    points, start = [], CHARGED.state(MU, G)
    for steps in [round(2 ** (0.25 * k)) for k in range(12, 80)]:
        plan = lm.Plan(CHARGED, method, h=T / steps, every=steps, compiled=True, progress=False)
        try:
            end = plan.run(start, steps=steps).last
        except lm.errors.IntegrationFailure:  # too long a step
            continue
        error = max(np.abs(np.asarray(x) - np.asarray(y)).max() for x, y in ((end.mu, true.mu), (end.g, true.g)))
        points.append((steps, harness.cost(lambda: plan.run(start, steps=steps), 5, 1), float(error)))  # noqa: B023
        if error <= min(ERRORS):
            break
    return points


def main() -> None:
    out, timing = harness.options(__doc__, "cotangent_benchmark.json")
    rows = []
    for name, pairs in PAIRS.items():
        runs = {repr(method): Native(system, method, system.state(MU, G), H) for system, method in pairs}
        times = measure(runs, *timing)
        first = next(iter(times.values()))
        rows += [[name, method, timing.best, timing.over(first)] for method, timing in times.items()]
    harness.table("a step: ns, best; over the first of its kind", ["system", "method", "ns", "ratio"], rows)
    start = CHARGED.state(MU, G)
    true = lm.integrate(CHARGED, lm.RKMK(order=8), start, h=T / 4000, steps=4000, every=4000, progress=False).last
    methods = [*ORDERS, lm.Composition(ORDERS[0], order=4), lm.RKMK(order=4), lm.RKMK(order=8)]
    points = {repr(m): runs_of(m, true) for m in methods}
    works = [[m, *[x for e in ERRORS for x in harness.to_an_error(p, e)]] for m, p in points.items()]
    harness.table(f"to t = {T:g}", ["method", *[w for e in ERRORS for w in (f"steps, {e:g}", "us")]], works)
    harness.work_precision({"charged top": points}, out.with_suffix(".png"))
    harness.write(out, {"steps": rows, "to an error": works})


if __name__ == "__main__":
    main()
