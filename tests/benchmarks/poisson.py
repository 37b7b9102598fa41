"""Poisson integrators of Lotka and Volterra's equations: a step beside plain C of the same step.

python tests/benchmarks/poisson.py [--quick] [--out results.json]
"""

import ctypes
import tempfile
from pathlib import Path
from typing import Any

import baseline
import harness
import numpy as np
from stepping import Native, agreeing, measure

import liemech as lm
from liemech.tableaus.splittings import STRANG

SOURCE = Path(__file__).with_name("poisson.c")
SPECIES = lm.models.LotkaVolterra()
START, H = SPECIES.state([1.5, 1.0]), 0.01
VERLET = lm.PoissonVerlet()
STEPS: dict[str, tuple[str, Any]] = {
    "PoissonEuler()": ("euler", lm.PoissonEuler()),
    "PoissonVerlet()": ("verlet", VERLET),
    **{f"Composition(PoissonVerlet(), order={p})": ("verlet", lm.Composition(VERLET, order=p)) for p in (4, 6, 8)},
    **{f"Splitting(order={p})": ("splitting", lm.Splitting(order=p)) for p in (1, 2, 4, 6)},
    **{f"PoissonHamiltonJacobi({p})": ("hamilton_jacobi", lm.PoissonHamiltonJacobi(p)) for p in (2, 4)},
}


class C:
    """The C of a step."""

    def __init__(self, library: Any, name: str) -> None:
        self.advance = getattr(library, name)

    def __call__(self, steps: int) -> np.ndarray:
        state = np.array(START.y)
        numbers = map(ctypes.c_double, (1.0, 2.0, H))
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


def main() -> None:
    out, timing = harness.options(__doc__, "poisson_benchmark.json")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for method_name, (name, method) in STEPS.items():
            runs: dict[str, Any] = {"liemech": Native(SPECIES, method, START, H)}
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
    harness.write(out, {"steps": rows})


if __name__ == "__main__":
    main()
