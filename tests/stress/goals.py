"""The 28 goals of reliability: what is wanted, what is measured, whether it is met, and which test holds it."""

from __future__ import annotations

import functools
import math
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import fuzz_calls
import numpy as np
import precision
import rounding
import test_archive
import test_double_double
import test_rotation_coefficients
import test_rotation_logarithm
import test_table_of_bad_input
from mpmath import mp, mpf
from scenes import asymmetric_body, errors_at, hat, same_bits, slope

import liemech as lm

TESTS = Path(__file__).parent.parent
EPS = rounding.EPS
EXP, CAYLEY = rounding.EXP, rounding.CAYLEY
HJ4 = lm.LiePoissonHamiltonJacobi(4, lm.Cayley())
METHODS = {"exp": EXP, "Cayley": CAYLEY}
LONG = {"precision": "double-double"}
G, SE3 = lm.SO3(), lm.SE3()


@dataclass(frozen=True)
class Size:
    """How much is measured."""

    quick: bool
    steps: int
    """Of a long run."""
    calls: int
    """Random calls of public functions."""

    def some(self, many: int) -> int:
        """So many, or a tenth in a quick run."""
        return max(1, many // 10) if self.quick else many


@dataclass(frozen=True)
class Found:
    """What was measured, in words, and whether the goal is met; None: not measured."""

    text: str
    met: bool | None
    by: str = ""
    """The mode that meets it, if another does not."""


@dataclass(frozen=True)
class Goal:
    """A row of the table."""

    name: str
    wanted: str
    measure: Callable[[Size], Found]
    where: str


# ---------------------------------------------------------------- functions of rotations, in eps


def below(values: dict[str, float], most: float, unit: str = "", scale: float = 1.0) -> Found:
    """All of them, and whether the largest is small enough."""
    shown = ", ".join(f"{name} {value / scale:.2g}{unit}".strip() for name, value in values.items())
    return Found(shown, max(values.values()) <= most)


def coefficients(size: Size) -> Found:
    """sinc, versine, segment and the coefficient of dexp^-1 for angles from 1e-100 to 2 pi - 1e-9."""
    t = test_rotation_coefficients
    angles = [x for part in (t.ON_POLYNOMIAL, t.BEYOND) for xs in part.values() for x in xs[:: 10 if size.quick else 1]]
    return below({"": max(t.largest(t.NAMES, angles).values())}, 4.0, " eps")


def exact_pose(w: np.ndarray, v: np.ndarray, cayley: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """exp or Cayley of w, and where exp (w, v) leads the origin; 400 digits, rounded once."""
    with mp.workdps(400):
        x = mp.fsum(mpf(float(c)) ** 2 for c in w)
        t, W, one = mp.sqrt(x), mp.matrix(hat(w).tolist()), mp.eye(3)
        R = one + 4 / (4 + x) * (W + W * W / 2) if cayley else one + mp.sin(t) / t * W + (1 - mp.cos(t)) / x * W * W
        p = (one + (1 - mp.cos(t)) / x * W + (t - mp.sin(t)) / (x * t) * W * W) * mp.matrix(v.tolist())
        return np.array(R.tolist(), dtype=float), np.array(p.tolist(), dtype=float)[:, 0]


def spread(low: float, high: float, count: int) -> Iterable[np.ndarray]:
    """Vectors of all directions, of lengths between 10^low and 10^high."""
    rng = np.random.default_rng(5)
    for k in np.linspace(low, high, count):
        w = rng.normal(size=3)
        yield 10.0**k * w / np.linalg.norm(w)


def exponentials(size: Size) -> Found:
    """Entries of exp on SO(3), and of exp on SE(3) beside the translation."""
    turns, moves = [], []
    for w in spread(-8.0, 8.0, size.some(400)):
        v = np.array([0.3, -0.7, 0.4])
        R, p = exact_pose(w, v)
        g = np.array(SE3.exp(np.concatenate([w, v])))
        turns.append(np.abs(np.array(G.exp(w)) - R).max())
        moves.append(max(np.abs(g[:3, :3] - R).max(), np.abs(g[:3, 3] - p).max() / np.linalg.norm(v)))
    return below({"SO(3)": max(turns), "SE(3)": max(moves)}, 8 * EPS, " eps", EPS)


def logarithms(size: Size) -> Found:
    """Relative to the angle, from 1e-12 to the double pi."""
    count = size.some(150)
    t = test_rotation_logarithm
    return below({"": max(t.largest_error(where, count) for where in t.ANGLES)}, 3.0, " eps")


def cayleys(size: Size) -> Found:
    """Entries of the Cayley map to 1e150; its inverse in units of eps (1 + |w|^2/4)/|w|, to 1e3."""
    forth = [
        np.abs(np.array(G.cayley(w)) - exact_pose(w, w, cayley=True)[0]).max()
        for w in spread(-12.0, 150.0, size.some(200))
    ]
    back = []
    for w in spread(0.0, 3.0, size.some(200)):
        length = np.linalg.norm(w)
        back.append(
            np.abs(np.array(G.cayley_inv(exact_pose(w, w, cayley=True)[0])) - w).max() / (1.0 + length**2 / 4.0)
        )
    return below({"map": max(forth), "inverse over its condition": max(back)}, 8 * EPS, " eps", EPS)


# ---------------------------------------------------------------- rounding of long runs


@functools.cache
def lost(method: lm.Method, steps: int) -> tuple[float, float, float]:
    """What the long mode loses of the Casimir, of the momentum in space and of g g^T, told from both words."""
    body, start = asymmetric_body()
    run = lm.integrate(body, method, start, h=0.1, steps=steps, every=steps, progress=False, **LONG)  # type: ignore[arg-type]
    return test_double_double.defects(run, start)


def of(method: lm.Method) -> rounding.Case:
    """The case of this method among those of `rounding`."""
    return next(case for case in rounding.CASES if case.method == method)


def modes(default: dict[str, float], long: dict[str, float], most: float) -> Found:
    """Default mode and long mode: both, and whether one of them keeps to the goal."""
    met = [max(values.values()) <= most for values in (default, long)]
    texts = [", ".join(f"{k} {v:.1e}" for k, v in values.items()) for values in (default, long)]
    return Found(f"default: {texts[0]}; long mode: {texts[1]}", met[1], "" if met[0] else " by the long mode")


def orthogonality(size: Size) -> Found:
    """max |g^T g - 1|."""
    default = {
        f"{name}{', all compensated' if sums else ''}": rounding.spatial_drift(of(method), size.steps, sums)[1]
        for name, method in METHODS.items()
        for sums in (None, True)
    }
    return modes(default, {name: lost(method, size.steps)[2] for name, method in METHODS.items()}, 8 * EPS)


def attitude(size: Size) -> Found:
    """Against the product of the same turns in 19 digits."""
    steps = size.some(10**6)
    found = {
        "compensated (default)": rounding.driven_attitude(steps=steps),
        "plain": rounding.driven_attitude(False, steps=steps),
    }
    return Found(", ".join(f"{k} {v:.1e}" for k, v in found.items()), found["compensated (default)"] <= 3e-14)


def casimirs(size: Size) -> Found:
    """The largest relative change in ten times as many steps."""
    return below({case.name: rounding.casimir_drift(case, 10 * size.steps) for case in rounding.CASES[:6:2]}, 2e-13)


@functools.cache
def walk(method: lm.Method, steps: int, **sums: object) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers of steps, and the changes of the mean energy and of the energy after them."""
    counts = np.unique(np.geomspace(min(1e3, steps / 100), steps, 13).round().astype(int))
    return counts, *rounding.energy_walk(method, counts, **sums)


def invariants(size: Size) -> Found:
    """Casimir and mean energy at the end."""
    default, long = {}, {}
    for name, method in METHODS.items():
        default[f"|mu|^2 {name}"] = rounding.casimir_drift(of(method), size.steps)
        default[f"energy {name}"] = float(walk(method, size.steps)[1].max())
        long[f"|mu|^2 {name}"] = lost(method, size.steps)[0]
        long[f"energy {name}"] = float(walk(method, size.steps, **LONG)[1].max())
    return modes(default, long, 1e-16)


def bias(size: Size) -> Found:
    """Mean and standard error of what a step rounds, in eps."""
    texts, met = [], True
    for case in rounding.CASES[:6]:
        found = rounding.rounding(case, size.some(400_000) // len(case.shares))
        met &= abs(found.energy) <= max(3 * found.energy_error, 1e-3)
        texts.append(f"{case.name} {1e3 * found.energy:.2f} ± {1e3 * found.energy_error:.2f}")
    return Found("10^-3 eps: " + ", ".join(texts), met)


def exponents(size: Size) -> Found:
    """Of the growth with the number of steps, 16 starts."""
    cases = [rounding.CASES[i] for i in ((0,) if size.quick else (0, 1, 4, 5))]
    found = {case.name: rounding.growth(case)[0] for case in cases}
    flat = max(float(walk(method, size.steps, **LONG)[1].max()) for method in METHODS.values())
    met = all(power <= 0.6 for power in found.values())
    powers = ", ".join(f"{name} N^{power:.2f}" for name, power in found.items())
    powers += " (see [a drift that was rounding](rounding.md#a-drift-that-was-rounding))"
    return Found(f"{powers}; long mode: flat at {flat:.0e}, the rounding of samples", met)


def rattle(size: Size) -> Found:
    """The spherical pendulum."""
    system = lm.SphericalPendulum(gravity=1.0)
    start, steps = system.state([0.6, 0.0, -0.8], [0.0, 0.7, 0.0]), size.some(10**6)
    run = lm.integrate(system, lm.RATTLE(), start, h=0.01, steps=steps // 7 * 7, every=7, progress=False)
    position, hidden = np.split(np.asarray(system.defects(run.q, run.p)), 2, axis=1)
    window, energy = rounding.WINDOW, run.energy.astype(rounding.Wide)
    # means in which the oscillation is not seen
    first, last = window @ energy[: len(window)], window @ energy[-len(window) :]
    drift = float(abs(last / first - 1.0))
    wide = lm.integrate(system, lm.RATTLE(), start, h=0.01, steps=size.some(10**5), every=7, progress=False, **LONG)
    found = {"|g|": position.max() / EPS, "|G v|": hidden.max() / EPS}
    long = max(np.asarray(system.defects(wide.q, wide.p)).max() / EPS, 0.0)
    text = ", ".join(f"{name} {value:.1f} eps" for name, value in found.items())
    text += f", energy over the run {drift:.0e}; samples of the long mode {long:.1f} eps"
    return Found(text, max(found.values()) <= 8.0 and drift <= 1e-12)


def reversed_runs(size: Size) -> Found:
    """Ten thousand steps forth and back."""
    return below({case.name: rounding.reversibility(case) for case in rounding.CASES if case.method.symmetric}, 1e-11)


def separatrix(size: Size) -> Found:
    """The offset that explains the time between flips."""
    default = {name: rounding.offset(method, steps=size.some(10**6)) for name, method in METHODS.items()}
    long = {name: rounding.offset(method, 1e-24, steps=size.some(10**5), **LONG) for name, method in METHODS.items()}
    return modes(default, long, 2e-8)


# ---------------------------------------------------------------- costs, orders, times


def guards(size: Size) -> Found:
    """There is no step without them."""
    return Found(
        "no native code is made without them; docs/proof/performance.md has steps beside C++ that has none", None
    )


def cost_of_long_mode(size: Size) -> Found:
    """Ratios of the time of a step."""
    chosen = precision.CASES[:1] if size.quick else precision.CASES[:4]
    rows = [precision.measured(method, scene, 25, 0.01) for method, scene in chosen]
    return below({f"{row['method']}, {row['scene']}:": row["ratio"] for row in rows}, 4.0)


def orders(size: Size) -> Found:
    """Slopes of the largest errors of momentum, attitude and energy of the free body against its exact motion."""
    texts, met = [], True
    body, start = asymmetric_body()
    for method, counts in ((EXP, (160, 320, 640, 1280)), (CAYLEY, (160, 320, 640, 1280)), (HJ4, (80, 160, 320, 640))):
        t_end, energy = 8.0, []
        for n in counts:
            run = lm.integrate(body, method, start, h=t_end / n, steps=n, progress=False)
            energy.append(np.abs(run.energy - run.energy[0]).max())
        h = [t_end / n for n in counts]
        found = [slope(h, e) for e in (*errors_at(body, method, start, t_end, counts), energy)]
        met &= all(abs(x - method.order) <= 0.1 for x in found)
        texts.append(f"{method.name} {', '.join(f'{x:.2f}' for x in found)}")
    return Found("; ".join(texts), met)


def times_of_steps(size: Size) -> Found:
    """Against n h in exact numbers, rounded once; in units in the last place."""
    body, start = asymmetric_body()
    steps, h, worst = 10 * size.steps, 0.1, 0.0
    run = lm.integrate(
        body, CAYLEY, body.state(start.mu), h=h, steps=steps, every=steps // 100 + 7, t0=0.3, progress=False
    )
    counts = [*range(0, steps, steps // 100 + 7), steps]
    for n, t in zip(counts, run.t.tolist(), strict=True):
        worst = max(worst, float(abs(Fraction(t) - (Fraction(0.3) + n * Fraction(h)))) / math.ulp(t))
    return below({"": worst}, 1.0, " ulp")


# ---------------------------------------------------------------- same bits


def workers(size: Size) -> Found:
    """An ensemble among 1, 2 and 8 threads, and each body alone."""
    body, start = asymmetric_body()
    mu, same = np.random.default_rng(6).normal(size=(37, 3)), True
    for method in (EXP, CAYLEY, lm.RKMK(order=4)):
        runs = [
            lm.integrate(body, method, body.state(mu, start.g), h=0.3, steps=500, workers=w, compiled=True)
            for w in (1, 2, 8)
        ]
        same &= all(same_bits(run.mu, runs[0].mu) and same_bits(run.g, runs[0].g) for run in runs)
        for i in range(0, 37, 9):
            for native in (True, False):
                alone = lm.integrate(body, method, body.state(mu[i], start.g), h=0.3, steps=500, compiled=native)
                same &= same_bits(alone.mu, np.ascontiguousarray(runs[0].mu[:, i]))
    return Found(
        f"3 methods, 1, 2 and 8 threads, alone, native and plain: {'same bits' if same else 'other bits'}", same
    )


def powers_of_two(size: Size) -> Found:
    """Units of mass from 2^-300 to 2^300, of time from 2^-250 to 2^250, both at once."""
    body, start = asymmetric_body()
    mu, J, tried, refused, other = np.array(start.mu), np.array(body.inertia), 0, 0, []
    rng = np.random.default_rng(8)
    for method in (EXP, CAYLEY, HJ4, lm.RKMK(order=4)):
        run = lm.integrate(body, method, start, h=0.3, steps=100, progress=False)
        for _ in range(size.some(100)):
            a, b = int(rng.integers(-300, 301)), int(rng.integers(-250, 251))
            if abs(2 * b - a) > 900 or abs(a - b) > 450:
                continue  # the energy, or a square of the momentum, is no double
            mass, second = 2.0**a, 2.0**b
            heavy = lm.RigidBody(mass * J)
            tried += 1
            try:
                begin = heavy.state(mass / second * mu, start.g)
                there = lm.integrate(heavy, method, begin, h=0.3 * second, steps=100, progress=False)
            except lm.errors.InvalidInput:  # says that products leave the range of doubles
                refused += 1
                continue
            if not (same_bits(there.mu, mass / second * run.mu) and same_bits(there.g, run.g)):
                other.append((method.name, a, b))
    text = f"{tried} pairs of units, 4 methods: {refused} refused by name, {len(other)} with other bits"
    return Found(" ".join([text, *(f"({name}, 2^{a} kg, 2^{b} s)" for name, a, b in other[:2])]), not other)


# ---------------------------------------------------------------- bad input, failures, files


def tests(*nodes: str, slow: bool = False) -> Callable[[Size], Found]:
    """The tests that hold a goal, run now."""

    def measure(size: Size) -> Found:
        if slow and size.quick:
            return Found("not run in a quick run", None)
        options = ("-q", "-p", "no:xdist", "-p", "no:cacheprovider", "-m", "slow or not slow")
        command = [sys.executable, "-m", "pytest", *options, *nodes]
        out = subprocess.run(command, cwd=TESTS, capture_output=True, text=True, check=False)
        last = (out.stdout.strip() or "nothing ran").splitlines()[-1].partition(" in ")[0]
        return Found(f"its tests: {last}", out.returncode == 0)

    return measure


def bad_inputs(size: Size) -> Found:
    """Those of the table of 68 that are calls: how long the slowest answer takes."""
    slowest, wrong, count = 0.0, [], 0
    for entry in test_table_of_bad_input.TABLE:
        for call in entry.calls:
            call_found, seconds = test_table_of_bad_input.answer(entry, call)
            slowest, count = max(slowest, seconds), count + 1
            if call_found:
                wrong.append(entry.number)
    text = f"{count} calls: {len(wrong)} answered otherwise than the table says, the slowest in {1e3 * slowest:.0f} ms"
    return Found(text, not wrong and slowest < 1.0)


def fuzz(size: Size) -> Found:
    """Random calls of every public function."""
    bad = fuzz_calls.failures(size.calls, 17)
    count = {kind: sum(b.startswith(kind) for b in bad) for kind in ("not finite", "bare", "slow")}
    return Found(
        f"{size.calls} calls: " + ", ".join(f"{n} {kind}" for kind, n in count.items()) + f", {len(bad)} in all",
        not bad,
    )


def damages(size: Size) -> Found:
    """A saved run with each byte changed, and cut off at each."""
    rng = np.random.default_rng(9)
    seen = tried = 0
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.npz"
        test_archive.CASES["body"][0].run(test_archive.START, steps=3).save(path)
        data = path.read_bytes()
        for at in range(0, len(data), 10 if size.quick else 1):
            for bad in (data[:at], data[:at] + bytes([data[at] ^ int(rng.integers(1, 256))]) + data[at + 1 :]):
                path.write_bytes(bad)
                tried += 1
                try:
                    lm.Trajectory.load(path)
                except lm.errors.InvalidInput:
                    seen += 1
    return Found(f"{seen} of {tried} found", seen == tried)


FAILING = "simulation/test_failing_runs.py"
GOALS = (
    Goal("R1", "coefficients, angles to 2 pi - 1e-9: 4 eps", coefficients, "`tests/groups/test_rotation_coefficients.py`"),
    Goal("R2", "exp on SO(3) and SE(3), |w| to 1e8, entrywise: 8 eps", exponentials, "`tests/groups/test_so3.py`, here"),
    Goal("R3", "log, at pi too: 3 eps, relative", logarithms, "`tests/groups/test_rotation_logarithm.py`"),
    Goal("R4", "Cayley of any size to 1e150, its inverse within its condition: 8 eps", cayleys, "`tests/groups/test_so3.py`, here"),
    Goal("R5", "orthogonality: 8 eps = 1.8e-15", orthogonality, "`tests/simulation/test_double_double.py`, here"),
    Goal("R6", "attitude at a varying rate, 10^6 steps: 3e-14", attitude, "`tests/long/test_rounding.py`"),
    Goal("R7", "Casimir, default sums, 10^7 steps: 2e-13", casimirs, "`tests/long/test_rounding.py`"),
    Goal("R8", "Casimir and mean energy: 1e-16", invariants, "`tests/simulation/test_double_double.py`, here"),
    Goal("R9", "bias of a step: within 3 standard errors or 10^-3 eps", bias, "`tests/long/test_rounding.py`"),
    Goal("R10", "growth of the mean energy: no faster than N^0.6", exponents, "`tests/long/test_rounding.py`"),
    Goal(
        "R11", "RATTLE, 10^6 steps: constraints 8 eps, energy 1e-12", rattle,
        "`tests/constrained/test_constrained_methods.py`, here",
    ),
    Goal("R12", "cost of guards: 5 %", guards, ""),
    Goal("R13", "cost of the long mode: 4 times", cost_of_long_mode, "`tests/benchmarks/precision.py`"),
    Goal("R14", "orders of momentum, attitude, energy: within 0.1", orders, "`tests/integrators/test_symmetric_orders.py`, here"),
    Goal("R15", "10^4 steps forth and back: 1e-11", reversed_runs, "`tests/long/test_rounding.py`"),
    Goal(
        "R16", "restart from any checkpoint: same bits",
        tests("simulation/test_archive.py", "simulation/test_runs.py", "-k", "two_parts or saved_run"),
        "`tests/simulation/test_archive.py`, `tests/simulation/test_runs.py`",
    ),
    Goal("R17", "threads, ensembles, processes: same bits", workers, "`tests/simulation/test_threads.py`, here"),
    Goal("R18", "units changed by powers of two: same bits", powers_of_two, "`tests/simulation/test_integrate.py`, here"),
    Goal("R19", "any bad input answered within 1 s", bad_inputs, "`tests/calls/test_table_of_bad_input.py`"),
    Goal("R20", "random calls: no NaN, no bare error", fuzz, "`tests/calls/test_calls.py`, here"),
    Goal("R21", "failed runs keep states, step, reason", tests(FAILING), f"`tests/{FAILING}`"),
    Goal(
        "R22", "killed runs load and lose one interval at most",
        tests("simulation/test_archive.py::test_a_killed_run_leaves_a_whole_file", slow=True), "`tests/simulation/test_archive.py`",
    ),
    Goal("R23", "damaged files: all found", damages, "`tests/simulation/test_archive.py`, here"),
    Goal(
        "R24", "hostile files: no code runs", tests("simulation/test_forged_files.py"),
        "`tests/simulation/test_forged_files.py`",
    ),
    Goal(
        "R25", "one bad body costs no other",
        tests(FAILING, "simulation/test_plan.py", "-k", "every_body or harms_no_other or body_that_stopped"),
        f"`tests/{FAILING}`, `tests/simulation/test_plan.py`",
    ),
    Goal(
        "R26", "Ctrl-C: what there is, within 1 s", tests("simulation/test_integrate.py", "-k", "interrupted_run"),
        "`tests/simulation/test_integrate.py`",
    ),
    Goal("R27", "times t0 + n h: 1 ulp", times_of_steps, "`tests/long/test_drift.py`, here"),
    Goal("R28", "noise at the separatrix: 2e-8", separatrix, "`tests/long/test_rounding.py`"),
)  # fmt: skip


def row(goal: Goal, size: Size) -> str:
    """A row of the table, measured now."""
    begun = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lm.errors.StepWarning)
        found = goal.measure(size)
    met = "not measured" if found.met is None else f"met{found.by}" if found.met else "**missed**"
    print(f"{goal.name} ({time.perf_counter() - begun:.0f} s) {met}: {found.text}", flush=True)
    cells = (goal.name, goal.wanted, found.text, met, goal.where)
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
