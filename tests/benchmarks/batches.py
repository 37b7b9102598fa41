"""Public methods called with many rows: against plain C++ loops over the same rows, and against SciPy's rotations.

    python tests/benchmarks/batches.py [--quick] [--rows N] [--out FILE]

Each figure is nanoseconds per row of a whole call: the checks of the arguments (finite, group elements) and a fresh
array for the result are included in ours.  C++ has no checks and writes into an array that is there already ("C++"), or
fresh as well ("fresh").
"""

import argparse
import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from baseline import FLAGS
from harness import Run, measure, table, write
from scipy.spatial import transform

import liemech as lm

Rotation = transform.Rotation
Calls = dict[str, Callable[[], Any]]
Cases = dict[str, tuple[Callable[..., Any], str, tuple[np.ndarray, ...], Calls]]
Rigid = getattr(transform, "RigidTransform", None)

SOURCE = Path(__file__).with_name("batches.cpp")
GOAL = 3.0  # times the C++ loop


def build() -> ctypes.CDLL | None:
    """The loops of `batches.cpp`, compiled for this processor; None without g++."""
    compiler = os.environ.get("CXX") or shutil.which("g++")
    if not compiler:
        return None
    command = [compiler, *FLAGS, "-ffp-contract=off", str(SOURCE)]
    processor = Path("/proc/cpuinfo").read_text().split("\n\n")[0] if Path("/proc/cpuinfo").exists() else ""
    native = [line for line in processor.splitlines() if line.startswith(("model", "flags"))]
    version = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout
    key = hashlib.sha256("\n".join([version, *native, *command, SOURCE.read_text()]).encode()).hexdigest()[:16]
    folder = Path(tempfile.gettempdir()) / f"liemech-benchmarks-{os.getuid() if hasattr(os, 'getuid') else 0}"
    folder.mkdir(mode=0o700, exist_ok=True)
    path = folder / f"batches-{key}.so"
    if not path.exists():
        unfinished = path.with_suffix(f".{os.getpid()}")
        subprocess.run([*command, "-o", str(unfinished)], check=True)
        unfinished.replace(path)
    return ctypes.CDLL(str(path))


def call(loop: Any, *arguments: np.ndarray, result: np.ndarray) -> np.ndarray:
    """Run a loop of C++ over rows."""
    loop(*(ctypes.c_void_p(a.ctypes.data) for a in (*arguments, result)), ctypes.c_size_t(len(result)))
    return result


def repeated(function: Callable[..., Any], *arguments: Any) -> Run:
    def run(times: int) -> None:
        for _ in range(times):
            function(*arguments)

    return run


def cases(n: int) -> Cases:
    """Our method, the loop in C++, the arguments, and what SciPy does."""
    so3, rng = lm.SO3(), np.random.default_rng(1)
    w, v, mu = rng.normal(size=(3, n, 3))
    g, h = so3.exp(w), so3.exp(v)
    a, b = Rotation.from_matrix(g), Rotation.from_matrix(h)
    small = 0.1 * w

    def scipy_product() -> np.ndarray:
        return (Rotation.from_matrix(g) * Rotation.from_matrix(h)).as_matrix()

    def exponentials(x: np.ndarray) -> Calls:
        return {"scipy": lambda: Rotation.from_rotvec(x).as_matrix()}

    return {
        "SO(3) exp, |w| about 1.6": (so3.exp, "so3_exp", (w,), exponentials(w)),
        "SO(3) exp, |w| about 0.16": (so3.exp, "so3_exp", (small,), exponentials(small)),
        "SO(3) log": (
            so3.log, "so3_log", (g,), {"scipy": lambda: Rotation.from_matrix(g).as_rotvec(), "inside": lambda: a.as_rotvec()},
        ),
        "SO(3) compose": (so3.compose, "so3_compose", (g, h), {"scipy": scipy_product, "inside": lambda: a * b}),
        "SO(3) Ad*": (
            so3.Ad_star, "so3_Ad_star", (g, mu),
            {"scipy": lambda: Rotation.from_matrix(g).inv().apply(mu), "inside": lambda: a.inv().apply(mu)},
        ),
    } | motions(n)  # fmt: skip


def motions(n: int) -> Cases:
    """The same for rigid motions, which SciPy knows from 1.16 on; it has no Ad*."""
    se3, rng = lm.SE3(), np.random.default_rng(2)
    xi, eta, mu = rng.normal(size=(3, n, 6))
    g, h = se3.exp(xi), se3.exp(eta)
    exp: Calls = {}
    log: Calls = {}
    compose: Calls = {}
    if Rigid is not None:
        a, b = Rigid.from_matrix(g), Rigid.from_matrix(h)
        exp = {"scipy": lambda: Rigid.from_exp_coords(xi).as_matrix()}
        log = {"scipy": lambda: Rigid.from_matrix(g).as_exp_coords(), "inside": lambda: a.as_exp_coords()}
        compose = {"scipy": lambda: (Rigid.from_matrix(g) * Rigid.from_matrix(h)).as_matrix(), "inside": lambda: a * b}
    return {
        "SE(3) exp": (se3.exp, "se3_exp", (xi,), exp),
        "SE(3) log": (se3.log, "se3_log", (g,), log),
        "SE(3) compose": (se3.compose, "se3_compose", (g, h), compose),
        "SE(3) Ad*": (se3.Ad_star, "se3_Ad_star", (g, mu), {}),
    }


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--quick", action="store_true", help="fewer rows and repetitions")
    options.add_argument("--rows", type=int, help="10^6, or 10^5 with --quick, unless given")
    options.add_argument("--out", type=Path, help="write all timings as JSON")
    chosen = options.parse_args()
    library, n = build(), chosen.rows or (10**5 if chosen.quick else 10**6)
    lines, kept = [], {}
    for name, (method, loop, arguments, scipy) in cases(n).items():
        ours = method(*arguments)
        runs = {"ours": repeated(method, *arguments)}
        if library is not None:
            function, there = getattr(library, loop), np.zeros_like(ours)
            theirs = call(function, *arguments, result=there)
            if not np.abs(ours - theirs).max() < 1e-13 * max(1.0, np.abs(ours).max()):
                raise AssertionError(f"{name}: C++ and liemech differ by {np.abs(ours - theirs).max()}")

            def fresh(f: Any = function, shape: tuple[int, ...] = ours.shape, given: Any = arguments) -> None:
                call(f, *given, result=np.empty(shape))

            runs |= {
                "C++": repeated(lambda f=function, a=arguments, r=there: call(f, *a, result=r)),
                "fresh": repeated(fresh),
            }
        if scipy and not np.allclose(scipy["scipy"](), ours, rtol=0.0, atol=1e-12):
            raise AssertionError(f"{name}: SciPy and liemech differ")
        runs |= {key: repeated(f) for key, f in scipy.items()}
        times = measure(runs, bodies=n, repetitions=5 if chosen.quick else 15, duration=0.02)
        kept[name] = {key: t.as_dict() for key, t in times.items()}
        cell = {key: times[key].median if key in times else None for key in ("ours", "C++", "fresh", "scipy", "inside")}
        ratios = [
            times["ours"].over(times[key]) if key in times else None for key in ("C++", "fresh", "scipy", "inside")
        ]
        lines.append([name, *cell.values(), *ratios])
    columns = ["", "liemech", "C++", "fresh", "SciPy", "its own", "/ C++", "/ fresh", "/ SciPy", "/ its own"]
    table(
        f"nanoseconds per row, {n} rows (SciPy: from matrices to matrices, and with Rotation objects of its own)",
        columns,
        lines,
    )
    print(f"  goal: at most {GOAL} times C++, and not slower than SciPy")
    if chosen.out:
        write(chosen.out, {"rows": n, "cases": kept})


if __name__ == "__main__":
    main()
