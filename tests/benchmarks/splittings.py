"""Splittings in R^2n: a step beside plain C of the same step, and errors at equal numbers of forces.

python tests/benchmarks/splittings.py [--quick] [--out results.json]
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
from liemech.tableaus import KAHAN_LI6, KAHAN_LI8, SUZUKI4, TRIPLE_JUMP4, SplittingTableau

SOURCE = Path(__file__).with_name("splittings.c")
STEPS = {"StormerVerlet()": lm.StormerVerlet(), **{f"Splitting(order={p})": lm.Splitting(order=p) for p in (4, 6, 8)}}
PLANETS, GALAXY = lm.Kepler(), lm.models.HenonHeiles()
SYSTEMS = {
    "kepler": (PLANETS, PLANETS.pericentre(0.6), 0.01),
    "galaxy": (GALAXY, GALAXY.state([0.0, 0.1], [0.5, 0.0]), 0.1),
}


class C:
    """The C of a splitting, compiled for its coefficients."""

    def __init__(self, library: Any, name: str, start: Any, h: float) -> None:
        self.advance, self.h = getattr(library, f"advance_{name}"), ctypes.c_double(h)
        self.start = np.array([*start.q, *start.p])

    def __call__(self, steps: int) -> np.ndarray:
        state = self.start.copy()
        self.advance(ctypes.c_void_p(state.ctypes.data), ctypes.c_double(1.0), self.h, ctypes.c_long(steps))
        return state


def compiled(tableau: SplittingTableau, contraction: str, folder: Path) -> Any:
    """The C of a tableau; None without a compiler."""
    rows = {"KICKS": baseline.listed(tableau.kicks), "DRIFTS": baseline.listed(tableau.drifts)}
    defines = {"STAGES": len(tableau.drifts), "CARRIES": int(tableau.carries_force), **rows}
    return baseline.plain_c(SOURCE, defines, contraction, folder)


def steps_beside_c(repetitions: int, duration: float) -> list[dict[str, Any]]:
    """ns a step: liemech, and C without and with fused multiply-add."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for name, (system, start, h) in SYSTEMS.items():
            for method_name, method in STEPS.items():
                runs: dict[str, Any] = {"liemech": Native(system, method, start, h)}
                for contraction in ("off", "fast"):
                    library = compiled(method.tableau, contraction, Path(folder))
                    if library is not None:
                        runs[f"C {contraction}"] = C(library, name, start, h)
                agreeing(runs, 1e-11)
                times = measure(runs, repetitions, duration)
                rows.append(
                    {
                        "system": name,
                        "method": method_name,
                        "ns": {key: timing.best for key, timing in times.items()},
                        "ratios": {key: times["liemech"].over(t) for key, t in times.items() if key != "liemech"},
                    }
                )
    columns = ["system", "method", *rows[0]["ns"], *[f"ratio {key}" for key in rows[0]["ratios"]]]
    harness.table(
        "a step beside C: ns, best, wanted: at most 1.1 times C without contraction",
        columns,
        [[r["system"], r["method"], *r["ns"].values(), *r["ratios"].values()] for r in rows],
    )
    return rows


METHODS = {
    "StormerVerlet()": lm.StormerVerlet(),
    "Splitting(order=3)": lm.Splitting(order=3),
    "triple jump 4 of Strang": lm.Splitting(tableau=SplittingTableau.of(TRIPLE_JUMP4)),
    "Suzuki 4 of Strang": lm.Splitting(tableau=SplittingTableau.of(SUZUKI4)),
    "Splitting(order=4, quadratic=False)": lm.Splitting(order=4, quadratic=False),
    "Splitting(order=4)": lm.Splitting(order=4),
    "Kahan-Li 6 of Strang": lm.Splitting(tableau=SplittingTableau.of(KAHAN_LI6)),
    "Splitting(order=6, quadratic=False)": lm.Splitting(order=6, quadratic=False),
    "Splitting(order=6)": lm.Splitting(order=6),
    "Kahan-Li 8 of Strang": lm.Splitting(tableau=SplittingTableau.of(KAHAN_LI8)),
    "Splitting(order=8)": lm.Splitting(order=8),
}


def errors() -> list[dict[str, Any]]:
    """The largest energy error and the error of (q, p) at the end, at equal numbers of forces."""
    ends = {"kepler": (20 * np.pi, (4000, 16000)), "galaxy": (100.0, (2000, 8000))}
    fine = lm.integrate(GALAXY, lm.Taylor(20), SYSTEMS["galaxy"][1], h=0.01, steps=10_000, every=10_000, progress=False)
    references = {"kepler": PLANETS.exact(SYSTEMS["kepler"][1], ends["kepler"][0]), "galaxy": fine.last}
    rows = []
    for method_name, method in METHODS.items():
        row: dict[str, Any] = {"method": method_name, "forces": method.tableau.stages}
        for name, (system, start, _) in SYSTEMS.items():
            t_end, counts = ends[name]
            for forces in counts:
                steps = round(forces / method.tableau.stages)
                run = lm.integrate(system, method, start, h=t_end / steps, steps=steps, compiled=True, progress=False)
                end, exact = (np.array([*state.q, *state.p]) for state in (run.last, references[name]))
                miss = np.linalg.norm(end - exact)
                row[f"{name} {forces}"] = [float(np.abs(run.energy / run.energy[0] - 1.0).max()), float(miss)]
        rows.append(row)
    keys = [key for key in rows[0] if key not in ("method", "forces")]
    harness.table(
        "largest relative energy error, error at the end",
        ["method", "forces", *keys],
        [[r["method"], r["forces"], *[f"{r[k][0]:.0e}, {r[k][1]:.0e}" for k in keys]] for r in rows],
    )
    return rows


def main() -> None:
    out, timing = harness.options(__doc__, "splittings_benchmark.json")
    harness.write(out, {"steps": steps_beside_c(*timing), "errors": errors()})


if __name__ == "__main__":
    main()
