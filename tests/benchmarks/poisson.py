"""Poisson integrators: a step on Lotka and Volterra's equations, and on so(3)*, beside plain C of the same step; and on seven
systems the time to an error of 1e-6 with what each method keeps.

python tests/benchmarks/poisson.py [--quick] [--out results.json]
"""

import ctypes
import tempfile
from pathlib import Path
from typing import Any, ClassVar

import baseline
import harness
import numpy as np
from stepping import Native, agreeing, measure

import liemech as lm
from liemech.formulas import log
from liemech.tableaus.splittings import STRANG

SOURCE = Path(__file__).with_name("poisson.c")
SPECIES = lm.models.LotkaVolterra()
START, H = SPECIES.state([1.5, 1.0]), 0.01
BODY = lm.RigidBody([1.0, 1.5, 2.0])
MOMENTA = lm.PoissonSystem(lm.coadjoint(lm.SO3()).poisson_structure, BODY.hamiltonian)
TURNING = MOMENTA.state([0.5, 0.0, 0.75**0.5])
VERLET = lm.PoissonVerlet()
STEPS: dict[str, tuple[str, Any]] = {
    "PoissonEuler()": ("euler", lm.PoissonEuler()),
    "PoissonVerlet()": ("verlet", VERLET),
    **{f"Composition(PoissonVerlet(), order={p})": ("verlet", lm.Composition(VERLET, order=p)) for p in (4, 6, 8)},
    **{f"Splitting(order={p})": ("splitting", lm.Splitting(order=p)) for p in (1, 2, 4, 6)},
    **{f"PoissonHamiltonJacobi({p})": ("hamilton_jacobi", lm.PoissonHamiltonJacobi(p)) for p in (2, 4)},
    **{f"PoissonHamiltonJacobi({p}), so(3)*": ("momenta", lm.PoissonHamiltonJacobi(p)) for p in (2, 4)},
}


def scene(name: str) -> tuple[Any, Any, float]:
    """The system that a C function steps, its start and the step."""
    return (MOMENTA, TURNING, 0.1) if name == "momenta" else (SPECIES, START, H)


class C:
    """The C of a step."""

    def __init__(self, library: Any, name: str) -> None:
        self.advance, (_, self.start, self.h) = getattr(library, name), scene(name)

    def __call__(self, steps: int) -> np.ndarray:
        state = np.array(self.start.y)
        numbers = map(ctypes.c_double, (1.0, 2.0, self.h))
        self.advance(ctypes.c_void_p(state.ctypes.data), *numbers, ctypes.c_long(steps))
        return state


def compiled(method: Any, contraction: str, folder: Path) -> Any:
    """The C of a method; None without a compiler."""
    gamma = method.tableau.gamma if isinstance(method, lm.Composition) else (1.0,)
    tableau = method.tableau_for(SPECIES) if isinstance(method, lm.Splitting) else STRANG
    rows = {"GAMMA": gamma, "KICKS": tableau.kicks, "DRIFTS": tableau.drifts}
    defines = {
        "ORDER": method.order,
        "STAGES": len(tableau.drifts),
        **{name: baseline.listed(row) for name, row in rows.items()},
    }
    return baseline.plain_c(SOURCE, defines, contraction, folder)


@lm.record
class SecondBracket(lm.PoissonStructure):
    """The cubic bracket of three species, Hairer, Lubich and Wanner, VII.2.3, with a, b, c = -2, -1, -1/2."""

    dim: ClassVar[int] = 3

    def matrix(self, y: lm.Vec) -> lm.Mat:
        u, v, w = -0.5 * y[0] * y[1] * (1.0 - 2.0 * y[2]), -0.5 * y[0] * y[2] * (y[1] - 1.0), y[0] * y[1] * y[2]
        return lm.mat(lm.vec(0.0, u, v), lm.vec(-u, 0.0, w), lm.vec(-v, -w, 0.0))


@lm.record
class Logarithms(lm.Hamiltonian):
    def energy(self, y: lm.Vec) -> float:
        return 2.0 * log(y[0]) + log(y[1]) + log(y[2])


ERROR, T = 1e-6, 4.0
TODA = lm.models.TodaLattice(3)
PARTICLE = lm.models.ChargedParticle(lm.models.AxialField())
TOGETHER: dict[str, tuple[Any, Any]] = {
    "two species": (SPECIES, START),
    "three species, first bracket": (
        system := lm.models.LotkaVolterra(
            [[0.0, -0.5, 0.5], [0.5, 0.0, -1.0], [-0.5, 1.0, 0.0]], [2.0, 1.0, 2.0], [0.0, 1.0, 1.0]
        ),
        system.state([1, 1.9, 0.5]),
    ),
    "three species, second bracket": (
        system := lm.PoissonSystem(SecondBracket(), Logarithms()),
        system.state([1, 1.9, 0.5]),
    ),
    "Toda": (TODA, TODA.state_of([0.3, -0.2, 0.1], [0.5, -0.3, 0.2])),
    "Maxwell-Bloch": (lm.models.MaxwellBloch(), lm.models.MaxwellBloch().state([1.0, 0.5, 0.3])),
    "charged particle": (PARTICLE, PARTICLE.state([0.0, 1.0, 0.1, 0.09, 0.55, 0.30])),
    "so(3)*": (MOMENTA, TURNING),
}
CONTENDERS = [
    *(lm.PoissonHamiltonJacobi(p) for p in (2, 4, 6)),
    *(lm.Splitting(order=p) for p in (2, 4, 6)),
    lm.RKMK(order=4),
    lm.RKMK(tableau=lm.tableaus.gauss(2)),
]


CHARTS: dict[str, Any] = {"two species": lm.charts.LogarithmicDarboux(SPECIES.structure), "so(3)*": lm.charts.Andoyer()}
"""Canonical coordinates."""


def to_an_error(
    of: Any, method: Any, begin: Any, true: np.ndarray, repetitions: int, chart: Any = None
) -> dict[str, Any] | None:
    """Steps, microseconds and errors at T of runs up to one within ERROR, and what the method keeps there; None if it does
    not step the system.  chart : a DarbouxChart in which it steps.
    """
    points = []
    system, start = (of, begin) if chart is None else chart.system(of, begin)

    def places(run: Any) -> np.ndarray:
        return np.asarray(run.y if chart is None else system.points(run.q, run.p))

    for steps in [round(2 ** (0.5 * k)) for k in range(4, 40)]:
        try:
            plan = lm.Plan(system, method, h=T / steps, every=steps, compiled=True, progress=False)
            end = places(plan.run(start, steps=steps))[-1]
        except (lm.errors.IncompatibleSystem, lm.errors.NotCompilable):
            return None
        except lm.errors.IntegrationFailure:  # too long a step
            continue
        us = harness.cost(lambda: plan.run(start, steps=steps), repetitions, 1)  # noqa: B023
        points.append((steps, us, float(np.abs(end - true).max())))
        if points[-1][2] <= ERROR:
            break
    far = lm.integrate(system, method, start, h=T / steps, steps=20 * steps, compiled=True, progress=False)
    constants = of.constants({"y": places(far)}).items()
    kept = {name: np.abs(x - x[0]).max() for name, x in constants if name.startswith(("energy", "Casimir"))}
    return {
        "steps": steps, "us": us, "points": points, "energy": kept.pop("energy"), "Casimirs": max(kept.values(), default=None),
        "defect": lm.poisson_defect(method, system, start, T / steps),
    }  # fmt: skip


def together(repetitions: int) -> list[dict[str, Any]]:
    """Every method on every system that it steps."""
    rows = []
    for name, (system, start) in TOGETHER.items():
        true = lm.integrate(system, lm.RKMK(order=8), start, h=T / 4000, steps=4000, every=4000, progress=False).last.y
        contenders = [(method, None) for method in CONTENDERS]
        if name in CHARTS:
            contenders = [*contenders, (lm.HamiltonJacobi(4), CHARTS[name])]
        for method, chart in contenders:
            told = to_an_error(system, method, start, true, repetitions, chart)
            if told is not None:
                where = "" if chart is None else f", {type(chart).__name__}"
                rows.append({"system": name, "method": repr(method) + where, "name": method.name + where, **told})
    columns = ["system", "method", "steps", "us", "energy", "Casimirs", "defect"]
    title = (
        f"to {ERROR:g} at t = {T:g}: steps, us; energy and Casimirs over 20 times that, defect of the bracket of a step"
    )
    harness.table(title, columns, [[row[c] for c in columns] for row in rows])
    return rows


def main() -> None:
    out, timing = harness.options(__doc__, "poisson_benchmark.json")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for method_name, (name, method) in STEPS.items():
            system, start, h = scene(name)
            runs: dict[str, Any] = {"liemech": Native(system, method, start, h)}
            for contraction in ("off", "fast"):
                library = compiled(method, contraction, Path(folder))
                if library is not None:
                    runs[f"C {contraction}"] = C(library, name)
            agreeing(runs, 1e-11)
            times = measure(runs, *timing)
            ratios = {key: times["liemech"].over(t) for key, t in times.items() if key != "liemech"}
            rows.append(
                {"method": method_name, "ns": {key: timing.best for key, timing in times.items()}, "ratios": ratios}
            )
    harness.table(
        "a step beside C: ns, best",
        ["method", *rows[0]["ns"], *[f"ratio {key}" for key in rows[0]["ratios"]]],
        [[r["method"], *r["ns"].values(), *r["ratios"].values()] for r in rows],
    )
    found = together(5 if timing[0] < 100 else 50)
    panels: dict[str, dict[str, Any]] = {}
    for row in found:
        panels.setdefault(row["system"], {})[row["name"]] = row["points"]
    shown = "two species", "three species, second bracket", "charged particle"
    harness.work_precision({name: panels[name] for name in shown}, out.with_suffix(".png"))
    harness.write(out, {"steps": rows, "together": found})


if __name__ == "__main__":
    main()
