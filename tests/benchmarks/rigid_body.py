"""Free rigid body: cost of a step of RKMK4 and of Algorithm 1 (Cayley, exp), momentum only and with attitude, one body
and many, beside the best C++ of the same step, plain Python, and SciPy's DOP853 at equal error; and start-up times.

    python tests/benchmarks/rigid_body.py [--quick] [--out results.json] [--sweep]
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

INERTIA = np.array([2 / 3, 1.0, 2.0])
MU = np.array([0.5, 0.0, 0.75**0.5])
H = 0.1
BODIES = 960  # a multiple of every number of lanes
SAME_STEP = {"Algorithm 1, Cayley, one unknown": "Algorithm 1, Cayley"}  # another way to solve for the same step
REFERENCE = Path(__file__).with_name("rigid_body_steps.json")

Integrate = Callable[..., tuple[np.ndarray, np.ndarray | None]]


def library() -> Integrate | None:
    """The one place that knows liemech: integrate(method, mu, g, h, steps, compiled) -> final mu, g; or None."""
    try:
        import liemech as lm

        with warnings.catch_warnings(action="ignore", category=lm.errors.InertiaWarning):
            body = lm.RigidBody(INERTIA)
        methods = {
            "RKMK4": lm.RKMK(order=4),
            "Algorithm 1, Cayley": lm.CovariantVariational(lm.Cayley()),
            "Algorithm 1, exp": lm.CovariantVariational(lm.Exponential()),
        }
    except (ImportError, AttributeError) as error:
        print(f"liemech does not run here ({error}): its columns stay empty")
        return None

    def integrate(
        method: str, mu: np.ndarray, g: np.ndarray | None, h: float, steps: int, compiled: bool
    ) -> tuple[np.ndarray, np.ndarray | None]:
        start = body.state(mu=mu) if g is None else body.state(mu=mu, g=g)
        record = ("mu",) if g is None else ("mu", "g")
        run = lm.integrate(
            body, methods[method], start, h=h, steps=steps, every=steps, record=record, compiled=compiled
        )
        return _last(run.mu, mu, 1), None if g is None else _last(run.g, g, 2)

    return integrate


def _last(series: np.ndarray, start: np.ndarray, rank: int) -> np.ndarray:
    """Last sample of a series whose time axis is first, (times, ...), or just before the `rank` axes of one element."""
    series = np.asarray(series)
    return series[-1] if series.shape[1:] == start.shape else np.take(series, -1, axis=-1 - rank)


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
    solves = cpp.advance(method, lanes, p, g, INERTIA, h, steps)
    return p.T, None if g is None else g.T.reshape(-1, 3, 3), solves


def validate(cpp: baseline.Baseline) -> None:
    """Every kernel against the methods in 45-digit arithmetic, momentum and attitude, to 1e-13."""
    reference = json.loads(REFERENCE.read_text())
    for name, method in baseline.METHODS.items():
        for lanes in (1, cpp.lanes()):
            for sample in reference["steps"][SAME_STEP.get(name, name)]:
                for attitude in (False, True):
                    mu, g, _ = compiled_cpp(
                        cpp, method, lanes, np.tile(reference["mu"], (lanes, 1)), attitude, reference["h"], sample["n"]
                    )
                    error = max(np.abs(mu - sample["mu"]).max(), 0 if g is None else np.abs(g - sample["g"]).max())
                    if error > 1e-13:
                        raise SystemExit(
                            f"C++ {name}, {lanes} lanes, contraction {cpp.contraction}: "
                            f"error {error:.1e} after {sample['n']} steps"
                        )


def validate_library(integrate: Integrate) -> None:
    """The library makes the same steps, alone and in an ensemble: momentum and attitude to 1e-13."""
    reference = json.loads(REFERENCE.read_text())
    for name, samples in reference["steps"].items():
        for start in (np.array(reference["mu"]), np.tile(reference["mu"], (3, 1))):
            for sample in samples:
                mu, g = integrate(name, start, attitudes(start), reference["h"], sample["n"], compiled=True)
                error = max(np.abs(mu - sample["mu"]).max(), np.abs(g - sample["g"]).max())
                if error > 1e-13:
                    print(f"warning: liemech {name}, start {start.shape}: error {error:.1e} after {sample['n']} steps")


def steps_table(
    cpps: dict[str, baseline.Baseline], integrate: Integrate | None, repetitions: int, duration: float
) -> list[dict[str, Any]]:
    """ns per step of one body, every method, momentum only and with attitude, one body and an ensemble."""
    results: list[dict[str, Any]] = []
    for many in (False, True):
        mu = random_momenta(BODIES) if many else MU
        for name, method in baseline.METHODS.items():
            for attitude in (False, True):
                g = attitudes(mu) if attitude else None
                runs: dict[str, harness.Run] = {}
                solves = None
                for contraction, cpp in cpps.items():
                    lanes = cpp.lanes() if many else 1
                    run = partial(compiled_cpp, cpp, method, lanes, np.atleast_2d(mu), attitude, H)
                    runs[f"C++ {contraction}"], solves = run, run(2000)[2]
                if integrate and name not in SAME_STEP:
                    runs["liemech"] = partial(integrate, name, mu, g, H, compiled=True)
                    if not many:
                        runs["plain"] = partial(integrate, name, mu, g, H, compiled=False)
                times = (
                    harness.measure(runs, bodies=BODIES if many else 1, repetitions=repetitions, duration=duration)
                    if runs
                    else {}
                )
                ours = times.get("liemech")
                results.append(
                    {
                        "bodies": BODIES if many else 1,
                        "method": name,
                        "attitude": attitude,
                        "newton_solves": solves,
                        **{key: value.as_dict() for key, value in times.items()},
                        "ratios": {key: ours.over(value) for key, value in times.items() if ours and key != "liemech"},
                    }
                )
    for many in (False, True):
        rows = [_row(r) for r in results if (r["bodies"] != 1) == many]
        harness.table(
            f"ns per step{f' of one body among {BODIES}' if many else ', one body'}: best (median), h = {H}",
            [
                "method",
                "records",
                "liemech",
                "C++",
                "C++ fma",
                "plain Python",
                "liemech/C++",
                "liemech/C++ fma",
                "Newton solves",
            ],
            rows,
        )
    return results


def _row(r: dict[str, Any]) -> list[object]:
    def time_of(key: str) -> str | None:
        return f"{r[key]['best']:.1f} ({r[key]['median']:.1f})" if key in r else None

    return [
        r["method"],
        "mu, g" if r["attitude"] else "mu",
        time_of("liemech"),
        time_of("C++ off"),
        time_of("C++ fast"),
        time_of("plain"),
        r["ratios"].get("C++ off"),
        r["ratios"].get("C++ fast"),
        r["newton_solves"] or None,
    ]


def sweep_table(repetitions: int, duration: float) -> list[dict[str, Any]]:
    """C++ only: every number of lanes, and Newton with a fixed number of steps."""
    cpps, mu = baseline.build(sweep=True), random_momenta(BODIES)
    results: list[dict[str, Any]] = []
    for name, method in {**baseline.METHODS, **baseline.FIXED_NEWTON}.items():
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


def equal_error_table(
    cpps: dict[str, baseline.Baseline], integrate: Integrate | None, quick: bool
) -> list[dict[str, Any]]:
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
    for name, method in baseline.METHODS.items():
        run_cpp = partial(compiled_cpp, cpps["off"], method, 1, MU[None], False, t_end / steps, steps) if cpps else None
        ours = integrate and name not in SAME_STEP
        run_lib = (
            partial(integrate, name, MU, None, t_end / steps, steps, compiled=True) if integrate and ours else None
        )
        run = run_lib or run_cpp
        if run is None:
            continue
        error = float(np.abs(run()[0] - exact).max())
        rtol = max((r for r, e in errors.items() if e <= error), default=min(errors))
        results.append(
            {
                "method": name,
                "error": error,
                "rtol": rtol,
                "dop853_error": errors[rtol],
                "dop853_ms": milliseconds(partial(dop853, rtol)),
                "liemech_ms": milliseconds(run_lib) if run_lib else None,
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
                r["dop853_ms"] / r["liemech_ms"] if r["liemech_ms"] else None,
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


def start_up_table(integrate: Integrate | None, repetitions: int) -> list[dict[str, Any]]:
    """Seconds of whole processes, interleaved; the compiler's cache is in a folder of its own, a new one if cold."""

    def process(*arguments: str, cache: str | None = None) -> float:
        environment = os.environ | ({"XDG_CACHE_HOME": cache, "LIEMECH_CACHE_DIR": cache} if cache else {})
        environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its byte code
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-W", "ignore", *arguments], check=True, stdout=subprocess.DEVNULL, env=environment)
        return time.perf_counter() - begin

    def first_run(script: str, cache: str | None = None) -> float:
        return process("-c", script, cache=cache or tempfile.mkdtemp(dir=folder))

    with tempfile.TemporaryDirectory() as folder:
        commands: dict[str, Callable[[], float]] = {"python -c 'import numpy'": lambda: process("-c", "import numpy")}
        if integrate:
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
    parser.add_argument("--out", type=Path, default=Path("rigid_body_benchmark.json"), help="where the JSON goes")
    options = parser.parse_args()
    repetitions, duration = (3, 0.004) if options.quick else (15, 0.03)

    cpps = baseline.build()
    if not cpps:
        print("g++ was not found: the C++ columns stay empty")
    for cpp in cpps.values():
        validate(cpp)
    integrate = library()
    if integrate:
        validate_library(integrate)
    results: dict[str, Any] = {
        "h": H,
        "steps": steps_table(cpps, integrate, repetitions, duration),
        "equal_error": equal_error_table(cpps, integrate, options.quick),
        "start_up": start_up_table(integrate, 2 if options.quick else 9),
    }
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
