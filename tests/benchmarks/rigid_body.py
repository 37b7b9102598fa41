"""Cost of a step: RKMK4, Algorithm 1 and its composition of order 4, Hamilton-Jacobi of order 4 on a free rigid body,
Lie-Verlet on a heavy top; momentum only and with attitude, one body and many, beside the best C++ of the same step and
plain Python; free bodies beside SciPy's DOP853 at equal error; and start-up times.

    python tests/benchmarks/rigid_body.py [--quick] [--out results.json] [--sweep] [--only NAME]
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import baseline
import harness
import numpy as np
import stepping

import liemech as lm

INERTIA = np.array([2 / 3, 1.0, 2.0])
LOAD = np.array([0.18, 0.0, 0.24])  # of the top: weight times centre
MU = np.array([0.5, 0.0, 0.75**0.5])
H = 0.1
BODIES = 960  # a multiple of every number of lanes
# another way to solve for the same step
SAME_STEP = {"Algorithm 1, Cayley, one unknown": "Algorithm 1, Cayley"}
REFERENCE = Path(__file__).with_name("rigid_body_steps.json")
BUDGETS = {"C++ off": 1.1, "C++ fast": 1.25}
COLUMNS = ["method", "records", "liemech", "C++", "ratio", "C++ fused", "ratio"]

with warnings.catch_warnings(action="ignore", category=lm.errors.InertiaWarning):
    BODY, TOP = lm.RigidBody(INERTIA), lm.models.HeavyTop(INERTIA, 1.0, LOAD)

ALGORITHM_1 = {"Cayley": lm.CovariantVariational(lm.Cayley()), "exp": lm.CovariantVariational(lm.Exponential())}
METHODS: dict[str, tuple[Any, lm.Method]] = {
    "RKMK4": (BODY, lm.RKMK(order=4)),
    **{f"Algorithm 1, {map}": (BODY, method) for map, method in ALGORITHM_1.items()},
    "Hamilton-Jacobi 4, exp": (BODY, lm.LiePoissonHamiltonJacobi(order=4)),
    **{f"Suzuki of Algorithm 1, {map}": (BODY, lm.Composition(method)) for map, method in ALGORITHM_1.items()},
    **{f"Lie-Verlet, {map}": (TOP, lm.LieVerlet(method.retraction)) for map, method in ALGORITHM_1.items()},
}
"""The systems and methods of the library by the names of the C++ steps."""


def integrate(
    name: str, mu: np.ndarray, g: np.ndarray | None, h: float, steps: int, compiled: bool
) -> tuple[np.ndarray, np.ndarray | None]:
    """Momentum and attitude at the end of a whole call."""
    system, method = METHODS[name]
    start, record = system.state(mu=mu, g=g), ("mu",) if g is None else ("mu", "g")
    run: Any = lm.integrate(system, method, start, h=h, steps=steps, every=steps, record=record, compiled=compiled)
    return run.mu[-1], None if g is None else run.g[-1]


def attitudes(mu: np.ndarray) -> np.ndarray:
    return np.broadcast_to(np.eye(3), (*mu.shape[:-1], 3, 3)).copy()


def random_momenta(n: int) -> np.ndarray:
    mu = np.random.default_rng(1).normal(size=(n, 3))
    return mu / np.linalg.norm(mu, axis=1, keepdims=True)


def compiled_cpp(
    cpp: baseline.Baseline, method: int, lanes: int, mu: np.ndarray, attitude: bool, h: float, steps: int
) -> tuple[np.ndarray, np.ndarray | None, float]:
    """Run the C++ kernel from momenta (n, 3); final mu (n, 3), g (n, 3, 3) and Newton solves per step."""
    p = np.array(mu.T, order="C")  # a copy: the kernel works in place
    g = np.array(attitudes(mu).reshape(-1, 9).T, order="C") if attitude else None
    solves = cpp.advance(method, lanes, p, g, np.concatenate([INERTIA, LOAD]), h, steps)
    return p.T, None if g is None else g.T.reshape(-1, 3, 3), solves


def forms(method: int, lanes: int) -> list[tuple[int, bool]]:
    """In which numbers of lanes a C++ step exists, and with what records."""
    return [
        (n, g)
        for n in {1, lanes if method < baseline.ALONE else 1}
        for g in (False, True)
        if g or method < baseline.TOP
    ]


def validate(cpp: baseline.Baseline) -> None:
    """Every kernel against the methods in 45-digit arithmetic, momentum and attitude, to 1e-13."""
    reference = json.loads(REFERENCE.read_text())
    for name, method in baseline.METHODS.items():
        for lanes, attitude in forms(method, cpp.lanes()):
            for sample in reference["steps"][SAME_STEP.get(name, name)]:
                mu, g, _ = compiled_cpp(
                    cpp, method, lanes, np.tile(reference["mu"], (lanes, 1)), attitude, reference["h"], sample["n"]
                )
                error = max(np.abs(mu - sample["mu"]).max(), 0 if g is None else np.abs(g - sample["g"]).max())
                if error > 1e-13:
                    raise SystemExit(
                        f"C++ {name}, {lanes} lanes, contraction {cpp.contraction}: error "
                        f"{error:.1e} after {sample['n']} steps"
                    )


def validate_library() -> None:
    """The library makes the same steps, alone and in an ensemble: momentum and attitude to 1e-13."""
    reference = json.loads(REFERENCE.read_text())
    for name, samples in reference["steps"].items():
        for start in (np.array(reference["mu"]), np.tile(reference["mu"], (3, 1))):
            for sample in samples:
                mu, g = integrate(name, start, attitudes(start), reference["h"], sample["n"], compiled=True)
                error = max(np.abs(mu - sample["mu"]).max(), np.abs(g - sample["g"]).max())
                if error > 1e-13:
                    raise SystemExit(f"liemech {name}: error {error:.1e} after {sample['n']} steps")


def steps_table(cpps: dict[str, baseline.Baseline], only: str, repetitions: int) -> list[dict[str, Any]]:
    """ns per step of one body, without the call, by ordinary sums as in C++: every method, momentum only and with
    attitude.

    Beside them the step as `integrate` takes it, with compensated sums, and a composition in steps of its base.
    """
    results: list[dict[str, Any]] = []
    for name, method in baseline.METHODS.items():
        for _, attitude in forms(method, 1)[: None if only in name else 0]:
            runs: dict[str, Callable[[int], Any]] = {}
            solves = None
            if name in METHODS:
                system, ours = METHODS[name]
                start = system.state(mu=MU, g=np.eye(3) if attitude else None)
                runs["liemech"] = stepping.Native(system, ours, start, H)
                if ours.symmetric:
                    runs["compensated"] = stepping.Native(system, ours, start, H, compensate=None)
                if isinstance(ours, lm.Composition):
                    runs["one stage"] = stepping.Native(system, ours.base, start, H)
            for contraction, cpp in cpps.items():
                runs[f"C++ {contraction}"] = run = partial(compiled_cpp, cpp, method, 1, MU[None], attitude, H)
                solves = run(2000)[2] or None
            times = stepping.measure(runs, repetitions, 0.002)
            ns = {key: timing.as_dict() for key, timing in times.items()}
            if name in METHODS:
                plain = partial(integrate, name, MU, np.eye(3) if attitude else None, H, compiled=False)
                ns |= {"plain": harness.measure({"": plain}, repetitions=3, duration=0.03)[""].as_dict()}
            ratios = {key: times["liemech"].over(times[key]) for key in BUDGETS if key in times and "liemech" in times}
            stages = times["liemech"].over(times["one stage"]) if "one stage" in times else None
            row = {
                "method": name,
                "attitude": attitude,
                "newton_solves": solves,
                "stages": stages,
                "ns": ns,
                "ratios": ratios,
            }
            results.append(row)
    harness.table(
        f"ns per step, best, h = {H}; wanted: at most {BUDGETS['C++ off']} times C++, "
        f"{BUDGETS['C++ fast']} times C++ fused",
        [*COLUMNS, "solves", "plain Python", "budget", "compensated", "stages"],
        [[*_row(r), r["ns"].get("compensated", {}).get("best"), r["stages"]] for r in results],
    )
    return results


def _row(r: dict[str, Any]) -> list[object]:
    best = {key: ns["best"] for key, ns in r["ns"].items()}
    met = (
        None if not r["ratios"] else "met" if all(r["ratios"][key] <= BUDGETS[key] for key in r["ratios"]) else "MISSED"
    )
    cells = [best.get("liemech"), *[cell for key in BUDGETS for cell in (best.get(key), r["ratios"].get(key))]]
    return [r["method"], "mu, g" if r["attitude"] else "mu", *cells, r["newton_solves"], best.get("plain"), met]


def ensembles_table(
    cpps: dict[str, baseline.Baseline], only: str, repetitions: int, duration: float
) -> list[dict[str, Any]]:
    """ns per step of one body among many, the call included."""
    mu = random_momenta(BODIES)
    results: list[dict[str, Any]] = []
    for name, method in baseline.METHODS.items():
        if method >= baseline.ALONE or only not in name:
            continue
        for attitude in (False, True):
            runs: dict[str, harness.Run] = {
                f"C++ {contraction}": partial(compiled_cpp, cpp, method, cpp.lanes(), mu, attitude, H)
                for contraction, cpp in cpps.items()
            }
            if name in METHODS:
                runs["liemech"] = partial(integrate, name, mu, attitudes(mu) if attitude else None, H, compiled=True)
            times = harness.measure(runs, bodies=BODIES, repetitions=repetitions, duration=duration)
            ours = times.get("liemech")
            ratios = {key: ours.over(timing) for key, timing in times.items() if ours and key != "liemech"}
            ns = {key: timing.as_dict() for key, timing in times.items()}
            results.append({"method": name, "attitude": attitude, "ns": ns, "ratios": ratios})
    harness.table(
        f"ns per step of one body among {BODIES}, best, the call included, h = {H}",
        COLUMNS,
        [_row({**r, "newton_solves": None})[:7] for r in results],
    )
    return results


def sweep_table(repetitions: int, duration: float) -> list[dict[str, Any]]:
    """C++ only: every number of lanes, and Newton with a fixed number of steps."""
    cpps, mu = baseline.build(sweep=True), random_momenta(BODIES)
    results: list[dict[str, Any]] = []
    for name, method in {**baseline.METHODS, **baseline.FIXED_NEWTON}.items():
        if name in METHODS and method >= baseline.ALONE:
            continue
        for attitude in (False, True):
            runs = {
                f"{cpp.lanes(groups)} {contraction}": partial(
                    compiled_cpp, cpp, method, cpp.lanes(groups), mu, attitude, H
                )
                for groups in (1, 2, 3, 4)
                for contraction, cpp in cpps.items()
            }
            times = harness.measure(runs, bodies=BODIES, repetitions=repetitions, duration=duration)
            results.append(
                {"method": name, "attitude": attitude, **{key: value.as_dict() for key, value in times.items()}}
            )
    keys = [key for key in results[0] if key not in ("method", "attitude")] if results else []
    harness.table(
        "C++ ensembles, ns per step of one body, by lanes and contraction",
        ["method", "records", *keys],
        [[r["method"], "mu, g" if r["attitude"] else "mu", *[r[key]["best"] for key in keys]] for r in results],
    )
    return results


def equal_error_table(cpps: dict[str, baseline.Baseline], quick: bool) -> list[dict[str, Any]]:
    """Milliseconds to t = 100 at equal error of the momentum: SciPy's DOP853 at its loosest sufficient tolerance."""
    from scipy.integrate import solve_ivp

    t_end, steps = 100.0, 1000

    def dop853(rtol: float) -> np.ndarray:
        return solve_ivp(
            lambda t, mu: np.cross(mu, mu / INERTIA), (0, t_end), MU, "DOP853", [t_end], rtol=rtol, atol=1e-3 * rtol
        ).y[:, -1]

    def milliseconds(run: Callable[[], object]) -> float:
        return 1e3 * min(harness.seconds(lambda _: run(), 1) for _ in range(2 if quick else 5))

    exact = dop853(3e-14)
    errors = {
        rtol: float(np.abs(dop853(rtol) - exact).max()) for rtol in 10.0 ** np.arange(-2, -11, -1.0 if quick else -0.25)
    }
    results = []
    for name, (system, _) in METHODS.items():
        if system is not BODY:
            continue
        method = baseline.METHODS[name]
        run_cpp = partial(compiled_cpp, cpps["off"], method, 1, MU[None], False, t_end / steps, steps) if cpps else None
        run = partial(integrate, name, MU, None, t_end / steps, steps, compiled=True)
        error = float(np.abs(run()[0] - exact).max())
        rtol = max((r for r, e in errors.items() if e <= error), default=min(errors))
        results.append(
            {
                "method": name,
                "error": error,
                "rtol": rtol,
                "dop853_error": errors[rtol],
                "dop853_ms": milliseconds(partial(dop853, rtol)),
                "liemech_ms": milliseconds(run),
                "cpp_ms": milliseconds(run_cpp) if run_cpp else None,
            }
        )
    harness.table(
        f"milliseconds to t = {t_end:g} at equal error of the momentum (calls included), h = {t_end / steps}",
        ["method", "error", "DOP853 error", "DOP853", "liemech", "C++", "DOP853/liemech"],
        [
            [
                r["method"],
                r["error"],
                r["dop853_error"],
                r["dop853_ms"],
                r["liemech_ms"],
                r["cpp_ms"],
                r["dop853_ms"] / r["liemech_ms"],
            ]
            for r in results
        ],
    )
    return results


FIRST_RUN = """
import liemech as lm, numpy as np
body = lm.RigidBody([2/3, 1, 2])
start = body.state(mu=[0.5, 0, 0.75**0.5], g=np.eye(3))
lm.integrate(body, {method}, start, h=0.1, steps=1000, every=1000, compiled=True)
"""


def start_up_table(repetitions: int) -> list[dict[str, Any]]:
    """Seconds of whole processes, interleaved; the compiler's cache is in a folder of its own, a new one if cold."""

    def process(*arguments: str, cache: str | None = None) -> float:
        environment = os.environ | ({"XDG_CACHE_HOME": cache, "LIEMECH_CACHE_DIR": cache} if cache else {})
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its byte code
        begin = time.perf_counter()
        subprocess.run(
            [sys.executable, "-W", "ignore", *arguments], check=True, stdout=subprocess.DEVNULL, env=environment
        )
        return time.perf_counter() - begin

    def first_run(script: str, cache: str | None = None) -> float:
        return process("-c", script, cache=cache or tempfile.mkdtemp(dir=folder))

    with tempfile.TemporaryDirectory() as folder:
        commands: dict[str, Callable[[], float]] = {"python -c 'import numpy'": lambda: process("-c", "import numpy")}
        commands["python -c 'import liemech'"] = lambda: process("-c", "import liemech")
        commands["python -m liemech --quiet"] = lambda: process("-m", "liemech", "--quiet", "--out", folder)
        for name, method in {
            "RKMK4": "lm.RKMK(order=4)",
            "Algorithm 1, exp": "lm.CovariantVariational(lm.Exponential())",
        }.items():
            script, warm = FIRST_RUN.format(method=method), tempfile.mkdtemp(dir=folder)
            process("-c", script, cache=warm)
            commands[f"first compiled run, cold cache: {name}"] = partial(first_run, script)
            commands[f"first compiled run, warm cache: {name}"] = partial(first_run, script, warm)
        spent: dict[str, list[float]] = {name: [] for name in commands}
        for _ in range(repetitions):
            for name, command in commands.items():
                spent[name].append(command())
    numpy_alone = np.array(next(iter(spent.values())))
    results = [
        {
            "command": name,
            "best": min(s),
            "median": float(np.median(s)),
            "over_numpy": float(np.median(np.array(s) / numpy_alone)),
        }
        for name, s in spent.items()
    ]
    harness.table(
        "start-up, seconds of a new process",
        ["command", "best", "median", "/ import numpy"],
        [list(r.values()) for r in results],
    )
    return results


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="smoke run: seconds instead of minutes, rough numbers")
    parser.add_argument(
        "--sweep",
        action="store_true",
        help="also compare C++ ensembles by number of lanes and with fixed Newton counts",
    )
    parser.add_argument("--only", default="", help="the steps of methods whose name contains this, and nothing else")
    parser.add_argument("--out", type=Path, default=Path("rigid_body_benchmark.json"), help="where the JSON goes")
    parser.add_argument("--short", action="store_true", help="no comparison at equal error, which takes long")
    options = parser.parse_args()
    repetitions, duration = (3, 0.004) if options.quick else (15, 0.03)

    cpps = baseline.build()
    if not cpps:
        print("g++ was not found: the C++ columns stay empty")
    for cpp in cpps.values():
        validate(cpp)
    validate_library()
    results: dict[str, Any] = {
        "h": H,
        "steps": steps_table(cpps, options.only, 10 if options.quick else 250),
        "ensembles": ensembles_table(cpps, options.only, repetitions, duration),
    }
    if not options.only:
        if not options.short:
            results["equal_error"] = equal_error_table(cpps, options.quick)
        results["start_up"] = start_up_table(2 if options.quick else 9)
    if cpps:
        results["instructions"] = {contraction: cpp.packed() for contraction, cpp in cpps.items()}
        rows = [[name, *count.values()] for name, count in cpps["off"].packed().items()]
        harness.table(
            "packed arithmetic in the C++ ensemble kernels, no contraction", ["kernel", "zmm", "ymm", "scalar"], rows
        )
        if options.sweep:
            results["sweep"] = sweep_table(repetitions, duration)
    harness.write(options.out, results)


if __name__ == "__main__":
    main()
