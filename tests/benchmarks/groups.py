"""What generality costs: a step on SE(3) beside the best C++ of the same step; a tableau as data
beside the stages written out; groups from generators alone beside closed forms; a user's energy,
with and without its gradient, beside the built-in one.

    python tests/benchmarks/groups.py [--quick] [--out results.json]
"""

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import baseline
import harness
import numpy as np
from stepping import Native, agreeing, measure

import liemech as lm
from liemech.tableaus import DORMAND_PRINCE5, RK4

SOURCE = Path(__file__).with_name("groups.cpp")
H = 0.1
METHODS = {
    "RKMK4": lm.RKMK(order=4),
    "Algorithm 1, Cayley": lm.CovariantVariational(lm.Cayley()),
    "Algorithm 1, exp": lm.CovariantVariational(lm.Exponential()),
}

J3, MU3 = np.array([2 / 3, 1.0, 2.0]), np.array([0.5, 0.0, 0.75**0.5])
J6, MU6 = np.array([1.0, 1.5, 2.0, 1.2, 1.6, 2.1]), np.array([0.5, 0.3, 0.4, 0.2, -0.3, 0.6])
# added mass is no diagonal matrix
COUPLED = np.diag(J6) + 0.05 * np.sin(np.add.outer(np.arange(6.0), np.arange(6.0)))
TOP = np.array([1.0, 1.0, 0.5, 0.0, 0.0, 0.8])  # moments of inertia, and weight times lever
MU_TOP = np.array([0.3, 0.0, 2.0, 0.0, np.sin(0.4), np.cos(0.4)])


# ------------------------------------------------------------------ a user's energies, groups and methods


@lm.record
class EnergyOnly(lm.Hamiltonian):
    """The energy of a free body; its gradient is derived."""

    inverse: lm.Vec

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * lm.dot(mu, self.inverse * mu)


@lm.record
class WithGradient(EnergyOnly):
    """The same, its gradient given."""

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        return self.inverse * mu


@lm.record
class HeavyTop(lm.Hamiltonian):
    """Pi.J^-1 Pi/2 + Gamma.chi for momenta (Pi, Gamma)."""

    inverse: lm.Vec
    chi: lm.Vec

    def energy(self, mu: lm.Vec) -> float:
        Pi, Gamma = lm.vec(*mu[:3]), lm.vec(*mu[3:])
        return 0.5 * lm.dot(Pi, self.inverse * Pi) + lm.dot(Gamma, self.chi)

    def gradient(self, mu: lm.Vec) -> lm.Vec:
        return lm.vec(*(self.inverse * lm.vec(*mu[:3])), *self.chi)


class Rotations(lm.MatrixLieGroup):
    """SO(3) from generators alone."""

    generators = np.array(lm.SO3().algebra.hat(np.eye(3)))


class RigidMotions(lm.MatrixLieGroup):
    """SE(3) from generators alone."""

    generators = np.array(lm.SE3().algebra.hat(np.eye(6)))


@lm.record
class ByHand(lm.Method):
    """What the methods below share: displacements of momentum and attitude, velocities in the chart."""

    def velocity(self, system: Any, mu: lm.Vec, omega: lm.Vec, terms: int) -> lm.Vec:
        xi = system.hamiltonian.gradient(system.group.exp_Ad_star(omega, mu))
        return system.group.algebra.dexp_inv_series(omega, xi, terms)

    def displaced(self, system: Any, state: Any, omega: lm.Vec) -> Any:
        g = None if state.g is None else system.group.compose_exp(state.g, omega)
        return lm.BodyState(system.group.exp_Ad_star(omega, state.mu), g)


@lm.record
class ClassicalByHand(ByHand):
    """RKMK4, its four stages written out."""

    order = 4

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        half, mu = 0.5 * h, state.mu
        k1 = system.hamiltonian.gradient(mu)
        k2 = self.velocity(system, mu, half * k1, 2)
        k3 = self.velocity(system, mu, half * k2, 2)
        k4 = self.velocity(system, mu, h * k3, 2)
        return self.displaced(system, state, (h / 6.0) * k1 + (h / 3.0) * k2 + (h / 3.0) * k3 + (h / 6.0) * k4)


@lm.record
class DormandPrinceByHand(ByHand):
    """The six stages of Dormand and Prince that a fixed step needs, written out."""

    order = 5

    def step(self, system: Any, t: float, state: Any, h: float) -> Any:
        mu = state.mu
        k1 = system.hamiltonian.gradient(mu)
        k2 = self.velocity(system, mu, (h / 5) * k1, 3)
        k3 = self.velocity(system, mu, (h * 3 / 40) * k1 + (h * 9 / 40) * k2, 3)
        k4 = self.velocity(system, mu, (h * 44 / 45) * k1 - (h * 56 / 15) * k2 + (h * 32 / 9) * k3, 3)
        k5 = self.velocity(
            system,
            mu,
            (h * 19372 / 6561) * k1 - (h * 25360 / 2187) * k2 + (h * 64448 / 6561) * k3 - (h * 212 / 729) * k4,
            3,
        )
        k6 = self.velocity(
            system,
            mu,
            (h * 9017 / 3168) * k1
            - (h * 355 / 33) * k2
            + (h * 46732 / 5247) * k3
            + (h * 49 / 176) * k4
            - (h * 5103 / 18656) * k5,
            3,
        )
        omega = (
            (h * 35 / 384) * k1
            + (h * 500 / 1113) * k3
            + (h * 125 / 192) * k4
            - (h * 2187 / 6784) * k5
            + (h * 11 / 84) * k6
        )
        return self.displaced(system, state, omega)


# ------------------------------------------------------------------ runs


def native(system: Any, method: lm.Method, mu: np.ndarray, g: np.ndarray | None) -> Native:
    return Native(system, method, system.state(mu=mu, g=g), H)


class Cpp:
    """The C++ of the same step; kind 0: an inertia (6,), 1: (6, 6), 2: the top."""

    def __init__(
        self, library: Any, method: int, kind: int, mu: np.ndarray, g: np.ndarray | None, data: np.ndarray
    ) -> None:
        self.library, self.method, self.kind, self.solves = library, method, kind, 0.0
        inverse = np.linalg.inv(data) if kind == 1 else data
        self.mu, self.g, self.data, self.inverse = (mu, g, data.ravel().copy(), inverse.ravel().copy())

    def __call__(self, steps: int) -> np.ndarray:
        mu, g, void = self.mu.copy(), None if self.g is None else self.g.copy(), ctypes.c_void_p
        arrays = [None if a is None else void(a.ctypes.data) for a in (mu, g, self.data, self.inverse)]
        solves = self.library.advance_se3(self.method, self.kind, *arrays, ctypes.c_double(H), ctypes.c_long(steps))
        self.solves = solves / steps
        return mu if g is None else np.concatenate([mu, g.ravel()])


def build() -> dict[str, Any]:
    """The C++ in each contraction mode; empty without a compiler.  Kept in the temporary folder."""
    compiler = os.environ.get("CXX") or shutil.which("g++")
    if not compiler:
        print("g++ was not found: the C++ columns stay empty")
        return {}
    folder = Path(tempfile.gettempdir()) / f"liemech-benchmarks-{os.getuid() if hasattr(os, 'getuid') else 0}"
    folder.mkdir(mode=0o700, exist_ok=True)
    libraries = {}
    for contraction in baseline.CONTRACTIONS:
        command = [compiler, *baseline.FLAGS, f"-ffp-contract={contraction}", str(SOURCE)]
        key = hashlib.sha256(
            "\n".join([*command, SOURCE.read_text(), str(harness.machine()["cpu"])]).encode()
        ).hexdigest()[:16]
        path = folder / f"groups-{contraction}-{key}.so"
        if not path.exists():
            unfinished = path.with_suffix(f".{os.getpid()}")
            subprocess.run([*command, "-o", str(unfinished)], check=True)
            unfinished.replace(path)
        libraries[f"C++ {contraction}"] = ctypes.CDLL(str(path))
        libraries[f"C++ {contraction}"].advance_se3.restype = ctypes.c_long
    return libraries


def compared(
    title: str, cases: Mapping[tuple[str, str], Mapping[str, Callable[[int], Any]]], budget: float | None, *timing: Any
) -> list[dict[str, Any]]:
    """One row for each case: ns of every run, and the ratios of the others to the first, or of the first to C++."""
    results: list[dict[str, Any]] = []
    for (what, records), runs in cases.items():
        times = measure(runs, *timing)
        first, *others = times
        against_cpp = any(name.startswith("C++") for name in others)
        ratios = {o: times[first].over(times[o]) if against_cpp else times[o].over(times[first]) for o in others}
        solves = next((run.solves for run in runs.values() if isinstance(run, Cpp) and run.solves), None)
        results.append(
            {
                "what": what,
                "records": records,
                "ns": {name: timing.as_dict() for name, timing in times.items()},
                "ratios": ratios,
                "newton_solves": solves,
                "in_budget": {name: ratio <= budget for name, ratio in ratios.items()} if budget else None,
            }
        )
    names, others = list(results[0]["ns"]), list(results[0]["ratios"])
    wanted = f", wanted: at most {budget:g}" if budget else ""
    harness.table(
        f"{title}: ns per step, best{wanted}",
        [
            "step",
            "records",
            *names,
            *[f"ratio {o}" if len(others) > 1 else "ratio" for o in others],
            *["budget"] * bool(budget),
        ],
        [
            [
                f"{r['what']}{', {:.2f} solves'.format(r['newton_solves']) if r['newton_solves'] else ''}",
                r["records"],
                *[r["ns"][name]["best"] for name in names],
                *[r["ratios"][name] for name in others],
                *(["met" if all(r["in_budget"].values()) else "MISSED"] if budget else []),
            ]
            for r in results
        ],
    )
    return results


# ------------------------------------------------------------------ the four questions


def records(n: int) -> dict[str, np.ndarray | None]:
    return {"mu": None, "mu, g": np.eye(n)}


def rigid_motions(libraries: Mapping[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
    """SE(3) beside C++: a body in a fluid, with principal axes and with a full matrix, and the heavy top."""
    inverse, chi = lm.Vec.of(1.0 / TOP[:3]), lm.Vec.of(TOP[3:])
    bodies = {
        "body, J diagonal": (0, lm.KineticEnergy(lm.Vec.of(J6)), MU6, J6),
        "body, J full": (1, lm.KineticEnergy(lm.Mat.of(COUPLED.tolist())), MU6, COUPLED),
        "heavy top": (2, HeavyTop(inverse, chi), MU_TOP, TOP),
    }
    cases: dict[tuple[str, str], dict[str, Any]] = {}
    for m, (name, method) in enumerate(METHODS.items()):
        for body, (kind, energy, mu, data) in bodies.items():
            if kind == 2 and m:
                continue  # it has no Lagrangian
            for record, g in records(4).items():
                runs: dict[str, Any] = {"liemech": native(lm.LiePoissonSystem(lm.SE3(), energy), method, mu, g)}
                runs |= {cpp: Cpp(library, m, kind, mu, g, data) for cpp, library in libraries.items()}
                agreeing(runs)
                cases[f"{name}, {body}", record] = runs
    return cases


def tableaus() -> dict[tuple[str, str], dict[str, Any]]:
    """The tableau as data beside the stages written out."""
    cases: dict[tuple[str, str], dict[str, Any]] = {}
    so3 = lm.LiePoissonSystem(lm.SO3(), lm.KineticEnergy(lm.Vec.of(J3)))
    se3 = lm.LiePoissonSystem(lm.SE3(), lm.KineticEnergy(lm.Vec.of(J6)))
    for name, data, hand in (
        ("RKMK4", lm.RKMK(tableau=RK4), ClassicalByHand()),
        ("Dormand-Prince 5", lm.RKMK(tableau=DORMAND_PRINCE5), DormandPrinceByHand()),
    ):
        for system, mu, n in ((so3, MU3, 3), (se3, MU6, 4)):
            for record, g in records(n).items():
                runs = {"by hand": native(system, hand, mu, g), "as data": native(system, data, mu, g)}
                agreeing(runs)
                cases[f"{name}, {system.group!r}", record] = runs
    return cases


def generators(closed: lm.LieGroup, others: Mapping[str, lm.LieGroup], n: int) -> dict[tuple[str, str], dict[str, Any]]:
    """Groups from generators alone beside closed forms."""
    J, mu = (J3, MU3) if closed.dim == 3 else (J6, MU6)
    energy = lm.KineticEnergy(lm.Vec.of(J))
    cases: dict[tuple[str, str], dict[str, Any]] = {}
    for name, method in METHODS.items():
        for record, g in records(n).items():
            groups = {repr(closed): closed, **others}
            runs = {key: native(lm.LiePoissonSystem(group, energy), method, mu, g) for key, group in groups.items()}
            # another group, for comparison of costs
            agreeing({key: run for key, run in runs.items() if key != "SO(4)"})
            cases[name, record] = runs
    return cases


def energies() -> dict[tuple[str, str], dict[str, Any]]:
    """A user's energy beside the built-in one."""
    cases: dict[tuple[str, str], dict[str, Any]] = {}
    for group, J, mu, n in ((lm.SO3(), J3, MU3, 3), (lm.SE3(), J6, MU6, 4)):
        for record, g in records(n).items():
            inverse = lm.Vec.of(1.0 / J)
            hamiltonians = {
                "KineticEnergy": lm.KineticEnergy(lm.Vec.of(J)),
                "gradient given": WithGradient(inverse),
                "derived": EnergyOnly(inverse),
            }
            runs = {
                key: native(lm.LiePoissonSystem(group, energy), METHODS["RKMK4"], mu, g)
                for key, energy in hamiltonians.items()
            }
            agreeing(runs)
            cases[f"RKMK4, {group!r}", record] = runs
    return cases


def main() -> None:
    out, timing = harness.options(__doc__, "groups_benchmark.json")
    results = {
        "h": H,
        "rigid_motions": compared("SE(3) beside C++", rigid_motions(build()), None, *timing),
        "tableaus": compared("tableau as data", tableaus(), 1.1, *timing),
        "generators_so3": compared(
            "SO(3) from generators", generators(lm.SO3(), {"SO(3)": lm.SO(3), "a class": Rotations()}, 3), 3.0, *timing
        ),
        "generators_se3": compared(
            "six dimensions from generators",
            generators(lm.SE3(), {"generators": RigidMotions(), "SO(4)": lm.SO(4)}, 4),
            None,
            *timing,
        ),
        "energies": compared("a user's energy", energies(), 1.05, *timing),
    }
    harness.write(out, results)


if __name__ == "__main__":
    main()
