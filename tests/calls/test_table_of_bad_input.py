"""Sixty-eight bad inputs, by number: each is answered at once, by a clear error or as the table
says, here or where it says.

`python tests/stress/run.py --only R19` times them.
"""

from __future__ import annotations

import math
import re
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import liemech as lm

Call = Callable[[], object]
NAN, INF = math.nan, math.inf
EPS = 2.0**-52
VALUE, KIND, CHART = lm.errors.InvalidInput, lm.errors.InvalidType, lm.errors.OutsideChart
FAILED = lm.errors.IntegrationFailure
BODY = lm.RigidBody([1.0, 1.6, 2.3])
MU = np.array([0.3, 0.4, 0.5])
START = BODY.state(MU, np.eye(3))
G, SE3, Q = lm.SO3(), lm.SE3(), lm.UnitQuaternions()
TESTS = Path(__file__).parent.parent
BAD_INPUT, ARCHIVE = "calls/test_bad_input.py", "simulation/test_archive.py"


@dataclass(frozen=True)
class Entry:
    """A row: calls that raise such an error, with such words; or that give what is true or finite; or tests elsewhere."""

    number: int
    what: str
    calls: tuple[Call, ...] = ()
    error: type[Exception] | None = None
    words: str = ""
    where: str = ""


def go(**options: Any) -> lm.Trajectory:
    """A short run in plain Python."""
    system, method, start = (
        options.pop(k, v) for k, v in (("system", BODY), ("method", lm.RKMK(order=4)), ("start", START))
    )
    return lm.integrate(system, method, start, **{"h": 0.1, "steps": 3, "compiled": False} | options)


def state(g: object) -> Call:
    """A body with this attitude."""
    return lambda: BODY.state(MU, g)


def body(inertia: object) -> Call:
    """A body with this inertia."""
    return lambda: lm.RigidBody(inertia)


def exp_step(h: float, **options: Any) -> Call:
    """Steps of Algorithm 1 with the exponential, the article's body."""
    start = lm.BodyState(lm.vec(0.5, 0.0, 0.75**0.5))
    return lambda: go(system=quiet(2 / 3, 1, 2), method=lm.CovariantVariational(), start=start, h=h, **options)


def quiet(*inertia: float) -> lm.RigidBody:
    """A body, whatever its inertia."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lm.errors.InertiaWarning)
        return lm.RigidBody(list(inertia))


def warned(category: type[Warning], words: str, call: Call) -> Call:
    """That a call warns so, and is answered."""

    def check() -> object:
        with pytest.warns(category, match=words):
            return call()

    return check


def same(*runs: lm.Trajectory) -> bool:
    """Bit for bit."""
    return all(np.array_equal(run.mu, runs[0].mu) and np.array_equal(run.g, runs[0].g) for run in runs)


def there_and_back() -> bool:
    """-h undoes h, and times decrease."""
    there = go(method=lm.CovariantVariational(lm.Cayley()), steps=20)
    back = go(method=lm.CovariantVariational(lm.Cayley()), steps=20, h=-0.1, start=there.last)
    return bool(np.abs(back.mu[-1] - MU).max() < 1e-14 and (np.diff(back.t) < 0).all())


def scaled(unit: float) -> bool:
    """As in ordinary units."""
    heavy = lm.RigidBody(unit * np.array([1.0, 1.6, 2.3]))
    run = go(system=heavy, start=heavy.state(unit * MU, np.eye(3)))
    return bool(np.abs(run.mu / unit - go().mu).max() < 1e-14)


def quaternions(scale: float) -> object:
    """A quaternion that is no unit is refused by name, or SciPy's, which scales it, is taken."""
    return BODY.state(MU, Rotation.from_quat(scale * np.array([0.1, 0.2, 0.3, 0.4]))).g


def half_turns() -> bool:
    """log exactly at pi about the axes and their diagonals: one of +-w."""
    for n in np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, -1, 1], [1, -1, 1]]):
        w = np.array(G.log(2 * np.outer(n, n) / (n @ n) - np.eye(3)))
        wanted = math.pi * n / np.sqrt(n @ n)
        if min(np.abs(w - wanted).max(), np.abs(w + wanted).max()) > 4 * EPS:
            return False
    return True


def close_to_a_turn() -> bool:
    """dexp^-1 at 2 pi - 1e-9 is finite, and dexp undoes it within its condition."""
    xi = np.array([2 * math.pi - 1e-9, 0.0, 0.0])
    eta = np.array(G.dexp_inv(xi, MU))
    return bool(np.isfinite(eta).all() and np.abs(np.array(G.dexp(xi, eta)) - MU).max() < 1e-5)


@lm.record
class Broken(lm.Hamiltonian):
    """An energy whose gradient does what a user's formulas may do."""

    how: str

    def energy(self, mu: lm.Vec) -> float:
        return 0.5 * lm.dot(mu, mu)

    def gradient(self, mu: lm.Vec) -> Any:
        if self.how == "nan" and mu[0] > 0.5:
            return math.nan * mu
        if self.how == "raises" and mu[0] > 0.5:
            raise RuntimeError("my own mistake")
        if self.how == "shape":
            return lm.vec(mu[0], mu[1])
        if self.how == "text":
            return "mu"
        return mu


def formula(how: str) -> Call:
    """A run with it."""

    def call() -> object:
        system = lm.LiePoissonSystem(G, Broken(how))
        return go(system=system, start=system.state([1.0, 0.2, 0.3]))

    return call


def errstate() -> bool:
    """NumPy's strictest mode changes nothing."""
    with np.errstate(all="raise"):
        return same(go(), go(method=lm.RKMK(order=4)))


def layouts() -> bool:
    """Any memory layout has the bits of a contiguous copy, and is not written to."""
    mu = np.arange(12.0).reshape(4, 3) / 10 + 0.1
    fortran, backwards, swapped = np.asfortranarray(mu), mu[::-1][::-1], mu.astype(">f8")
    frozen = mu.copy()
    frozen.flags.writeable = False
    runs = [
        go(start=BODY.state(x, np.eye(3)))
        for x in (mu, fortran, backwards, swapped, frozen, np.repeat(mu, 2, axis=0)[::2])
    ]
    return same(*runs) and bool(np.array_equal(mu, np.arange(12.0).reshape(4, 3) / 10 + 0.1))


def one_bad_member() -> bool:
    """Of an ensemble one body overflows: it is named, the others have the bits that they have without it."""
    mu = np.tile(MU, (40, 1)) * np.linspace(1.0, 2.0, 40)[:, None]
    bad = mu.copy()
    bad[17] = 1e200
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        run = go(start=BODY.state(bad))
    rest = [i for i in range(40) if i != 17]
    return set(run.stopped) == {17} and bool(np.array_equal(run.mu[:, rest], go(start=BODY.state(mu)).mu[:, rest]))


def redundant() -> object:
    """A constraint whose gradient is zero everywhere."""

    @lm.record
    class Empty(lm.SphericalPendulum):
        def constraint(self, q: lm.Vec) -> lm.Vec:
            return lm.vec(0.0 * q[0])

        def constraint_jacobian(self, q: lm.Vec) -> lm.Mat:
            return lm.mat(0.0 * q)

    system = Empty()
    return lm.integrate(
        system, lm.RATTLE(), system.state([0.0, 0.0, -1.0], [0.1, 0.0, 0.0]), h=0.01, steps=2, compiled=False
    )


def pendulum(q: list[float], p: list[float], h: float = 0.01, steps: int = 5) -> Call:
    """A run of the spherical pendulum."""

    def call() -> object:
        rod = lm.SphericalPendulum()
        return lm.integrate(rod, lm.RATTLE(), rod.state(q, p), h=h, steps=steps, compiled=False)

    return call


R = Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix()
POSE = np.eye(4)
FAR = np.eye(4)
FAR[:3, 3] = 1e300
LOWER = POSE + np.diag([0.0, 0, 0, 1])
KIRCHHOFF = np.diag([1.0, 1.6, 2.3, 1.0, 2.0, 3.0])
N = "steps must be"

TABLE = (
    Entry(1, "NaN in the momentum", (lambda: BODY.state([NAN, 0, 0]),), VALUE, r"mu\[0\] is nan"),
    Entry(2, "inf in the momentum", (lambda: BODY.state([0, 0, INF]),), VALUE, r"mu\[2\] is inf"),
    Entry(3, "h NaN or inf", (lambda: go(h=NAN), lambda: go(h=INF)), VALUE, "h must be finite"),
    Entry(4, "h = 0", (lambda: go(h=0.0),), VALUE, "h = 0 is no step"),
    Entry(5, "h < 0 runs backwards", (there_and_back,)),
    Entry(6, "h lost beside t", (lambda: go(h=1e-17, t0=1.0),), VALUE, "smallest useful step there is 2.2e-16"),
    Entry(7, "h denormal", (lambda: go(h=5e-324),), VALUE, "is no step"),
    Entry(8, "no steps", (lambda: len(go(steps=0)) == 1,)),
    Entry(9, "steps that are no count", (lambda: go(steps=2.5), lambda: go(steps=True), lambda: go(steps="10")), KIND, N),
    Entry(9, "fewer than no steps", (lambda: go(steps=-1),), VALUE, N),
    Entry(10, "more samples than memory", (lambda: go(steps=10**12),), VALUE, "larger `every`"),
    Entry(
        11, "t_end NaN or inf",
        tuple(lambda t=t: go(method=lm.RKMK(order=5), h=None, steps=None, t_end=t) for t in (NAN, INF)),
        VALUE,
        "t_end must be finite",
    ),
    Entry(
        12, "t_end before t0",
        (lambda: go(method=lm.CovariantVariational(lm.Cayley()), steps=None, t_end=-1.0),),
        VALUE,
        "t_end",
    ),
    Entry(
        13, "tolerances that are none",
        tuple(lambda r=r: go(method=lm.RKMK(order=5), h=None, steps=None, t_end=1.0, rtol=r) for r in (NAN, -1.0, 0.0)),
        VALUE,
        "rtol",
    ),
    Entry(14, "negative moment of inertia", (body([-1, 1, 1]),), VALUE, "principal moment -1"),
    Entry(15, "inertia without an inverse", (body([0, 1, 1]),), VALUE, "principal moment 0"),
    Entry(16, "inertia not symmetric", (body([[1, 1e-6, 0], [0, 1, 0], [0, 0, 1]]),), VALUE, "not symmetric"),
    Entry(16, "not symmetric by rounding", (lambda: lm.RigidBody([[1, 1e-16, 0], [0, 2, 0], [0, 0, 1.5]]) is not None,)),
    Entry(
        17, "no body has this inertia: it runs, with a warning",
        (warned(lm.errors.InertiaWarning, "inertia|moment", body([2 / 3, 1, 2])),),
    ),
    Entry(18, "moments that differ by 1e12 run", (lambda: go(system=quiet(1.0, 1.0, 1e-12)).mu,)),
    Entry(19, "inertia in any units", (lambda: scaled(1e-46), lambda: scaled(1e40))),
    Entry(20, "inertia of another shape", (body([[1, 2, 3]]), body([[1], [2], [3]])), VALUE, "shape"),
    Entry(21, "complex inertia", (body([1 + 0j, 1, 1]),), KIND, "complex"),
    Entry(22, "an SE(3) inertia of tiny determinant runs", (lambda: lm.models.KirchhoffBody(1e-60 * KIRCHHOFF) is not None,)),
    Entry(23, "a reflection", (state(-np.eye(3)), lambda: G.log(-np.eye(3))), VALUE, "reflection"),
    Entry(24, "twice the unit matrix", (state(2 * np.eye(3)), lambda: G.log(2 * np.eye(3))), VALUE, "by 3.0e"),
    Entry(
        25, "orthogonal to 1e-10: kept as it is",
        (lambda: np.array_equal(BODY.state(MU, np.eye(3) + 1e-10).g, np.eye(3) + 1e-10),),
    ),
    Entry(25, "orthogonal to 1e-5", (state(np.eye(3) + 1e-5),), VALUE, "more than 1e-06"),
    Entry(26, "NaN in a rotation", (state([[1, NAN, 0], [0, 1, 0], [0, 0, 1]]),), VALUE, r"g\[0, 1\] is nan"),
    Entry(
        27, "no rotation by shape",
        (state(np.zeros((3, 3))), state(np.empty((0, 3, 3))), state(np.zeros((3, 2))), state([[1, 0], [1]])), VALUE, "g|ragged",
    ),
    Entry(28, "quaternion zero", (lambda: Q.log([0.0, 0.0, 0.0, 0.0]),), VALUE, "not in UnitQuaternions"),
    Entry(
        29, "quaternions that are no units",
        (lambda: Q.log([1e200, 0, 0, 0]), lambda: Q.log([0, 0, 0, 1e-200])), VALUE, "not in UnitQuaternions",
    ),
    Entry(
        30, "q and -q are one attitude",
        (lambda: np.array_equal(Q.rotation([0.5] * 4).as_matrix(), Q.rotation([-0.5] * 4).as_matrix()),),
    ),
    Entry(31, "quaternions for a matrix: no guess", (state([0.0, 0.0, 0.0, 1.0]),), VALUE, r"g has shape \(4,\)"),
    Entry(32, "a pose with another last row", (lambda: SE3.log(LOWER),), VALUE, "not in SE3"),
    Entry(33, "a far translation", (lambda: SE3.log(FAR), lambda: SE3.exp([0.1, 0.2, 0.3, 1e300, 0.0, 0.0]))),
    Entry(34, "log at half a turn", (half_turns,)),
    Entry(35, "log at pi - 1e-13", where="groups/test_rotation_logarithm.py::test_accuracy"),
    Entry(
        36, "log of the identity",
        (lambda: not np.any(G.log(np.eye(3))), lambda: not np.any(G.log(np.eye(3) + np.full((3, 3), -0.0)))),
    ),
    Entry(
        37, "exp of next to nothing",
        (lambda: np.array_equal(G.exp(np.zeros(3)), np.eye(3)), lambda: G.exp([1e-320, 0, 0])[2, 1] == 1e-320),
    ),
    Entry(
        38, "exp of 1e8",
        (lambda: np.abs(np.array(G.exp([1e8, 0, 0])).T @ np.array(G.exp([1e8, 0, 0])) - np.eye(3)).max() < 8 * EPS,),
    ),
    Entry(38, "exp of 1e200", (lambda: G.exp([1e200, 0, 0]),), VALUE, "no finite value"),
    Entry(39, "exp of inf", (lambda: G.exp([INF, 0, 0]),), VALUE, r"xi\[0\] is inf"),
    Entry(40, "dexp^-1 at a whole turn", (lambda: G.dexp_inv([2 * math.pi, 0, 0], MU),), CHART),
    Entry(41, "dexp^-1 at 2 pi - 1e-9", (close_to_a_turn,)),
    Entry(42, "dexp^-1 beyond a turn", (lambda: G.dexp_inv([7.0, 0, 0], MU), lambda: G.dexp_inv([0, 12.0, 0], MU)), CHART),
    Entry(43, "inverse Cayley of half a turn", (lambda: G.cayley_inv(np.diag([1.0, -1.0, -1.0])),), CHART, "Cayley"),
    Entry(44, "Cayley of 1e160", (lambda: np.abs(np.array(G.cayley([1e160, 0, 0])) - np.diag([1, -1, -1])).max() < EPS,)),
    Entry(45, "exp step of more than half a turn: warned", (warned(lm.errors.StepWarning, "larger than", exp_step(3.1)),)),
    Entry(
        46, "exp steps that may have no solution: warned, and followed from h = 0",
        (warned(lm.errors.StepWarning, "followed from h = 0", exp_step(8.0)),),
    ),
    Entry(47, "Newton without an end", (exp_step(20.0),), FAILED),
    Entry(48, "a rod's other branch", where="integrators/test_solvability.py"),
    Entry(49, "a gradient of NaN", (formula("nan"),), FAILED, "overflowed or left the domain"),
    Entry(50, "a gradient that raises keeps its exception", (formula("raises"),), FAILED, "RuntimeError: my own mistake"),
    Entry(51, "a gradient of another shape", (formula("shape"),), lm.errors.LiemechError),
    Entry(51, "a gradient that is a text", (formula("text"),), lm.errors.InvalidType, "must return a vector; got str"),
    Entry(52, "a formula that writes to its argument", where="compiler/test_refusals.py"),
    Entry(53, "a gradient that is not the energy's", where="checks/test_system_laws.py"),
    Entry(54, "a structure matrix without Jacobi", where="poisson/test_structures.py"),
    Entry(55, "a constraint without a gradient", (redundant,), lm.errors.LiemechError, "rank|depend|gradient|rows"),
    Entry(
        56, "a start off the constraint",
        (pendulum([0.0, 0.0, -1.001], [0.0, 0.0, 0.0]), pendulum([0.0, 0.0, -1.0], [0.0, 0.0, 1.0])),
        lm.errors.LiemechError,
        "consistent",
    ),
    Entry(57, "constraints that become dependent on the way", where="constrained/test_constrained_input.py"),
    Entry(58, "a RATTLE step too large", (pendulum([0.0, 0.0, -1.0], [1.0, 0.0, 0.0], h=50.0),), FAILED, "step|h = "),
    Entry(59, "a time scale that is none", where="timing/test_time_transformed.py"),
    Entry(60, "a splitting of parts that do not fit", where="poisson/test_splittings.py"),
    Entry(
        61, "integers and float32 are numbers",
        (lambda: np.array_equal(BODY.state([1, 2, 3]).mu, BODY.state(np.float32([1, 2, 3])).mu),),
    ),
    Entry(
        61, "no numbers",
        (lambda: BODY.state(["1", "2", "3"]), lambda: BODY.state([True, False, True]), lambda: BODY.state(np.array([1, None, 2]))),
        KIND,
        "real numbers",
    ),
    Entry(62, "any layout in memory", (layouts,)),
    Entry(63, "a masked entry", (lambda: BODY.state(np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0])),), VALUE, "masked"),
    Entry(64, "one bad body among forty", (one_bad_member,)),
    Entry(65, "files that are no runs", where=f"{ARCHIVE}::test_every_damage_is_seen"),
    Entry(66, "a checkpoint of another run", where="simulation/test_plan.py::test_only_runs_of_an_equal_plan_are_resumed"),
    Entry(67, "labels with tags and paths", where="viewer/test_pages.py"),
    Entry(68, "NumPy's strictest mode", (errstate,)),
)  # fmt: skip


def answer(entry: Entry, call: Call) -> tuple[str, float]:
    """What is wrong with the answer, "" if nothing, and the seconds it took."""
    begun = time.thread_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            warnings.simplefilter("ignore", lm.errors.StepWarning)
            result = call()
    except Exception as error:
        seconds = time.thread_time() - begun
        if entry.error is None or not isinstance(error, entry.error):
            return f"{type(error).__name__}: {error}", seconds
        if not re.search(entry.words, str(error)):
            return f"in other words: {error}", seconds
        kept = getattr(error, "trajectory", None)
        finite = kept is None or all(np.isfinite(x).all() for x in kept.states.values())
        return "" if finite else "samples that are not finite", seconds
    seconds = time.thread_time() - begun
    if entry.error is not None:
        return f"answered {result!r}", seconds
    if isinstance(result, np.bool_ | bool):
        return "" if result else "not as it should be", seconds
    numbers = (
        [result.mu] if isinstance(result, lm.Trajectory) else [result] if not isinstance(result, lm.RigidBody) else []
    )
    return "" if all(np.isfinite(np.asarray(x, dtype=float)).all() for x in numbers) else "not finite", seconds


CALLS = [(entry, call) for entry in TABLE for call in entry.calls]


@pytest.mark.parametrize(("entry", "call"), CALLS, ids=[f"{entry.number} {entry.what}" for entry, _ in CALLS])
def test_bad_input(entry: Entry, call: Call) -> None:
    wrong, seconds = answer(entry, call)
    assert not wrong
    assert seconds < 1.0


def test_all_sixty_eight_are_there() -> None:
    assert [*dict.fromkeys(entry.number for entry in TABLE)] == [*range(1, 69)]
    for entry in TABLE:
        assert bool(entry.calls) != bool(entry.where)
        file, _, function = entry.where.partition("::")
        assert (TESTS / file).exists()
        assert not function or f"def {function}(" in (TESTS / file).read_text(encoding="utf-8")
