"""The free rigid body in other packages, whichever are installed, each in the form that suits it best.

heyoka   mu and the unit quaternion of the attitude, 7 numbers; Taylor series of the order that the tolerance asks for, compiled
SciPy    the same 7 numbers; DOP853 with a right-hand side in NumPy, and in machine code (Numba)
Exudyn   a rigid body with rotation vector and body velocity (and with a position, for it has no other); explicit Lie methods
Lielab   an element of SO(3) under rotations from the left, with the spatial momentum as a constant; its RKMK methods
"""

import importlib
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from typing import Any

import numpy as np

Result = tuple[np.ndarray, np.ndarray]  # body momentum (3,) and attitude (3, 3), body to space, at the end
Run = Callable[[], Result]

TIGHTEST = 2.3e-14
"""The tightest relative tolerance of SciPy, 100 rounding errors."""


@dataclass(frozen=True)
class Problem:
    """A free rigid body with principal moments `inertia`, from momentum `mu` and attitude 1, until `t_end`."""

    name: str
    inertia: tuple[float, float, float]
    mu: tuple[float, float, float]
    t_end: float


@dataclass(frozen=True)
class Contender:
    """A method of a package, with the numbers of steps or the tolerances to try; `prepare` compiles and sets up."""

    package: str
    method: str
    settings: tuple[float, ...]
    prepare: Callable[[Problem, float], Run]


def tolerances(loosest: int, tightest: int) -> tuple[float, ...]:
    """10^loosest, ..., 10^tightest."""
    return tuple(10.0**k for k in range(loosest, tightest - 1, -1))


def contenders() -> tuple[list[Contender], dict[str, str | None]]:
    """All contenders that are installed, and the version of each package, None if it is not."""
    found: list[Contender] = []
    versions: dict[str, str | None] = {}
    for package, make in {"heyoka": heyoka, "scipy": scipy, "numba": scipy_numba, "exudyn": exudyn, "lielab": lielab}.items():
        try:
            with warnings.catch_warnings(action="ignore"):
                found += make()
            versions[package] = metadata.version(package)
        except (ImportError, OSError):
            versions[package] = None
    return found, versions


def start(problem: Problem) -> np.ndarray:
    """Momentum and quaternion, scalar part first."""
    return np.array([*problem.mu, 1.0, 0.0, 0.0, 0.0])


def end(state: np.ndarray) -> Result:
    """Momentum and rotation matrix."""
    w, x, y, z = state[3:].tolist()
    return state[:3].copy(), np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


# ------------------------------------------------------------------ heyoka


def heyoka() -> list[Contender]:
    hy: Any = importlib.import_module("heyoka")

    def prepare(problem: Problem, tolerance: float) -> Run:
        a, b, c = (1.0 / moment for moment in problem.inertia)
        p, q, r, w, x, y, z = hy.make_vars(*"pqrwxyz")
        u, v, s = a * p, b * q, c * r
        body = [(p, (c - b) * (q * r)), (q, (a - c) * (r * p)), (r, (b - a) * (p * q))]
        turn = [
            (w, -0.5 * (x * u + y * v + z * s)),
            (x, 0.5 * (w * u + y * s - z * v)),
            (y, 0.5 * (w * v + z * u - x * s)),
            (z, 0.5 * (w * s + x * v - y * u)),
        ]
        first = start(problem)
        integrator = hy.taylor_adaptive(body + turn, first, tol=tolerance)

        def run() -> Result:
            integrator.time = 0.0
            integrator.state[:] = first
            integrator.propagate_until(problem.t_end)
            return end(integrator.state)

        return run

    return [Contender("heyoka", "Taylor", (*tolerances(-1, -15), 2.3e-16), prepare)]


# ------------------------------------------------------------------ SciPy


def _scipy(label: str, right_hand_side: Callable[[Problem], Callable[..., Any]]) -> list[Contender]:
    integrate: Any = importlib.import_module("scipy.integrate")

    def prepare(problem: Problem, tolerance: float) -> Run:
        f, first = right_hand_side(problem), start(problem)
        options = {"method": "DOP853", "rtol": tolerance, "atol": tolerance}
        return lambda: end(integrate.solve_ivp(f, (0.0, problem.t_end), first, **options).y[:, -1])

    return [Contender("SciPy", f"DOP853, {label}", (*tolerances(-3, -13), TIGHTEST), prepare)]


def scipy() -> list[Contender]:
    def right_hand_side(problem: Problem) -> Callable[..., Any]:
        inverse = 1.0 / np.array(problem.inertia)

        def f(t: float, state: np.ndarray) -> np.ndarray:
            mu, q = state[:3], state[3:]
            u, v, s = inverse * mu
            turn = np.array([[0.0, -u, -v, -s], [u, 0.0, s, -v], [v, -s, 0.0, u], [s, v, -u, 0.0]])
            bend = np.array([[0.0, s, -v], [-s, 0.0, u], [v, -u, 0.0]])
            return np.concatenate([bend @ mu, 0.5 * (turn @ q)])

        return f

    return _scipy("NumPy", right_hand_side)


def scipy_numba() -> list[Contender]:
    numba: Any = importlib.import_module("numba")

    def right_hand_side(problem: Problem) -> Callable[..., Any]:
        a, b, c = (1.0 / moment for moment in problem.inertia)

        @numba.njit
        def f(t: float, state: np.ndarray) -> np.ndarray:
            p, q, r, w, x, y, z = state
            u, v, s = a * p, b * q, c * r
            rates = np.empty(7)
            rates[0], rates[1], rates[2] = (c - b) * q * r, (a - c) * r * p, (b - a) * p * q
            rates[3], rates[4] = -0.5 * (x * u + y * v + z * s), 0.5 * (w * u + y * s - z * v)
            rates[5], rates[6] = 0.5 * (w * v + z * u - x * s), 0.5 * (w * s + x * v - y * u)
            return rates

        return f

    return _scipy("Numba", right_hand_side)


# ------------------------------------------------------------------ Exudyn


def exudyn() -> list[Contender]:
    exu: Any = importlib.import_module("exudyn")
    items: Any = importlib.import_module("exudyn.itemInterface")

    def prepare(problem: Problem, setting: float, solver: str) -> Run:
        container = exu.SystemContainer()
        system = container.AddSystem()
        velocity = [m / moment for m, moment in zip(problem.mu, problem.inertia, strict=True)]
        node = system.AddNode(
            items.NodeRigidBodyRotVecLG(referenceCoordinates=[0.0] * 6, initialVelocities=[0.0, 0.0, 0.0, *velocity])
        )
        system.AddObject(items.ObjectRigidBody(physicsMass=1.0, physicsInertia=[*problem.inertia, 0.0, 0.0, 0.0], nodeNumber=node))
        system.Assemble()
        settings = exu.SimulationSettings()
        settings.solutionSettings.writeSolutionToFile = settings.displayStatistics = False
        time = settings.timeIntegration
        time.endTime, time.verboseMode, time.explicitIntegration.useLieGroupIntegration = problem.t_end, 0, True
        time.automaticStepSize = setting < 1.0
        if setting < 1.0:
            time.relativeTolerance = time.absoluteTolerance = setting
            time.numberOfSteps, time.initialStepSize, time.minimumStepSize = 100, 1e-2, 1e-8
        else:
            time.numberOfSteps = int(setting)
        kind, variables, moments = getattr(exu.DynamicSolverType, solver), exu.OutputVariableType, np.array(problem.inertia)

        def run(keep: Any = container) -> Result:
            system.SolveDynamic(settings, solverType=kind, storeSolver=False)
            w = system.GetNodeOutput(node, variables.AngularVelocityLocal)
            return moments * w, system.GetNodeOutput(node, variables.RotationMatrix).reshape(3, 3)

        return run

    choices = {"RK44": doubled(100, 8), "RK67": doubled(25, 9), "DOPRI5": tolerances(-2, -12)}
    return [Contender("Exudyn", solver, settings, partial(prepare, solver=solver)) for solver, settings in choices.items()]


# ------------------------------------------------------------------ Lielab


def lielab() -> list[Contender]:
    domain: Any = importlib.import_module("lielab.domain")
    integrate: Any = importlib.import_module("lielab.integrate")

    def prepare(problem: Problem, setting: float, tableau: str) -> Run:
        moments, momentum = np.array(problem.inertia), np.array(problem.mu)

        def velocity(t: float, place: Any) -> Any:
            g, xi = place.point[0].get_matrix(), domain.so(3)
            xi.set_vector(g @ ((momentum @ g) / moments))
            return domain.CompositeAlgebra([xi])

        system, options = integrate.HomogeneousIVPSystem(velocity), integrate.IVPOptions()
        options.method = integrate.IVPMethod.MuntheKaas
        options.coefficients = getattr(integrate.RungeKuttaCoefficients, tableau)
        options.variable_time_step = setting < 1.0
        if setting < 1.0:
            options.reltol = options.abstol = setting
            options.dt, options.dt_max = 0.05, 10.0
        else:
            options.dt, options.dt_max = problem.t_end / setting, 1.01 * problem.t_end / setting
            options.dt_min = 0.5 * options.dt
        place = domain.CompositeManifold([domain.SO(np.eye(3))])

        def run() -> Result:
            g = integrate.solve_ivp(system, np.array([0.0, problem.t_end]), place, options).y[-1].point[0].get_matrix()
            return momentum @ g, np.array(g)

        return run

    choices = {
        "RK4a": doubled(125, 5),
        "RKDP54_7M": tolerances(-3, -9),
        "RKV87r": tolerances(-3, -12),
        "RKV98r": (*tolerances(-3, -13), TIGHTEST),
    }
    return [Contender("Lielab", f"RKMK {name}", settings, partial(prepare, tableau=name)) for name, settings in choices.items()]


def doubled(first: int, times: int) -> tuple[float, ...]:
    """first, 2 first, 4 first, ...: numbers of steps."""
    return tuple(float(first << k) for k in range(times))
