"""The free rigid body and the heavy top in other packages, whichever are installed, each in the
form that suits it best.

heyoka   mu and the unit quaternion of the attitude, 7 numbers; Taylor series of the order that the tolerance asks for, compiled
SciPy    the same 7 numbers; DOP853 with a right-hand side in NumPy, and in machine code (Numba)
Exudyn   a rigid body with rotation vector and body velocity (and with a position, for it has no other); explicit Lie methods
Lielab   an element of SO(3) under rotations from the left, with the spatial momentum, constant or in R^3; its RKMK methods
"""

import importlib
import itertools
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from typing import Any

import numpy as np

Result = tuple[np.ndarray, np.ndarray]  # body momentum (3,) and attitude (3, 3), body to space
Run = Callable[[], list[Result]]  # at each of the times asked for
Triple = tuple[float, float, float]

TIGHTEST = 2.3e-14
"""The tightest relative tolerance of SciPy, 100 rounding errors."""


@dataclass(frozen=True)
class Problem:
    """A rigid body, mu' = mu x J^-1 mu + Gamma x load, Gamma = g^T e3: free, or a heavy top if it has a load.

    name : of the problem.  inertia : principal moments.  load : weight times centre of mass, in
    body axes.
    mu, quaternion : momentum and attitude (scalar part first) at the start.  times : of the
    results.
    pace : how many times more steps it wants in a unit of time than the numbers in
    `Contender.settings`, which are for 100 units.
    """

    name: str
    inertia: Triple
    mu: Triple
    times: tuple[float, ...]
    load: Triple = (0.0, 0.0, 0.0)
    quaternion: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    pace: float = 1.0

    @property
    def heavy(self) -> bool:
        """Is there a field of force?"""
        return any(self.load)

    @property
    def start(self) -> np.ndarray:
        """Momentum and quaternion."""
        return np.array([*self.mu, *self.quaternion])

    @property
    def spans(self) -> list[tuple[float, float]]:
        """From zero to the first time, and from each time to the next."""
        return list(itertools.pairwise((0.0, *self.times)))

    def steps(self, setting: float, t: float) -> int:
        """How many steps a number of them for 100 units of time is until t."""
        return max(1, round(setting * self.pace * t / 100.0))


@dataclass(frozen=True)
class Contender:
    """A method of a package, with the tolerances or the numbers of steps in 100 units of time to
    try; `prepare` sets it up.
    """

    package: str
    method: str
    settings: tuple[float, ...]
    prepare: Callable[[Problem, float], Run]


def tolerances(loosest: int, tightest: int) -> tuple[float, ...]:
    """10^loosest, ..., 10^tightest."""
    return tuple(10.0**k for k in range(loosest, tightest - 1, -1))


def doubled(first: int, times: int) -> tuple[float, ...]:
    """first, 2 first, 4 first, ...: numbers of steps."""
    return tuple(float(first << k) for k in range(times))


def contenders() -> tuple[list[Contender], dict[str, str | None]]:
    """All contenders that are installed, and the version of each package, None if it is not."""
    found: list[Contender] = []
    versions: dict[str, str | None] = {}
    for package, make in {
        "heyoka": heyoka,
        "scipy": scipy,
        "numba": scipy_numba,
        "exudyn": exudyn,
        "lielab": lielab,
    }.items():
        try:
            with warnings.catch_warnings(action="ignore"):
                found += make()
            versions[package] = metadata.version(package)
        except (ImportError, OSError):
            versions[package] = None
    return found, versions


def result(state: np.ndarray) -> Result:
    """Momentum and rotation matrix of seven numbers."""
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
        (a, b, c), (i, j, k) = (1.0 / moment for moment in problem.inertia), problem.load
        p, q, r, w, x, y, z = hy.make_vars(*"pqrwxyz")
        u, v, s = a * p, b * q, c * r
        torque: list[Any] = [(c - b) * (q * r), (a - c) * (r * p), (b - a) * (p * q)]
        if problem.heavy:
            e, f, g = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z
            torque = [torque[0] + (f * k - g * j), torque[1] + (g * i - e * k), torque[2] + (e * j - f * i)]
        turn = [
            (w, -0.5 * (x * u + y * v + z * s)),
            (x, 0.5 * (w * u + y * s - z * v)),
            (y, 0.5 * (w * v + z * u - x * s)),
            (z, 0.5 * (w * s + x * v - y * u)),
        ]
        first = problem.start
        integrator = hy.taylor_adaptive([*zip((p, q, r), torque, strict=True), *turn], first, tol=tolerance)

        def run() -> list[Result]:
            integrator.time, found = 0.0, []
            integrator.state[:] = first
            for t in problem.times:
                integrator.propagate_until(t)
                found.append(result(integrator.state))
            return found

        return run

    return [Contender("heyoka", "Taylor", (*tolerances(-1, -15), 2.3e-16), prepare)]


# ------------------------------------------------------------------ SciPy


def _scipy(label: str, right_hand_side: Callable[[Problem], Callable[..., Any]]) -> list[Contender]:
    integrate: Any = importlib.import_module("scipy.integrate")

    def prepare(problem: Problem, tolerance: float) -> Run:
        f, options = (right_hand_side(problem), {"method": "DOP853", "rtol": tolerance, "atol": tolerance})

        def run() -> list[Result]:
            state, found = problem.start, []
            for span in problem.spans:
                state = integrate.solve_ivp(f, span, state, t_eval=span[1:], **options).y[:, -1]
                found.append(result(state))
            return found

        return run

    return [Contender("SciPy", f"DOP853, {label}", (*tolerances(-3, -13), TIGHTEST), prepare)]


def scipy() -> list[Contender]:
    def right_hand_side(problem: Problem) -> Callable[..., Any]:
        inverse, (i, j, k) = 1.0 / np.array(problem.inertia), problem.load
        load = np.array([[0.0, k, -j], [-k, 0.0, i], [j, -i, 0.0]])

        def f(t: float, state: np.ndarray) -> np.ndarray:
            mu, q = state[:3], state[3:]
            u, v, s = inverse * mu
            turn = np.array([[0.0, -u, -v, -s], [u, 0.0, s, -v], [v, -s, 0.0, u], [s, v, -u, 0.0]])
            bend = np.array([[0.0, s, -v], [-s, 0.0, u], [v, -u, 0.0]])
            torque = bend @ mu
            if problem.heavy:
                w, x, y, z = q
                torque = torque + load @ np.array(
                    [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z]
                )
            return np.concatenate([torque, 0.5 * (turn @ q)])

        return f

    return _scipy("NumPy", right_hand_side)


def scipy_numba() -> list[Contender]:
    numba: Any = importlib.import_module("numba")

    def right_hand_side(problem: Problem) -> Callable[..., Any]:
        (a, b, c), (i, j, k), heavy = ((1.0 / moment for moment in problem.inertia), problem.load, problem.heavy)

        @numba.njit
        def f(t: float, state: np.ndarray) -> np.ndarray:
            p, q, r, w, x, y, z = state
            u, v, s = a * p, b * q, c * r
            rates = np.empty(7)
            rates[0], rates[1], rates[2] = (c - b) * q * r, (a - c) * r * p, (b - a) * p * q
            if heavy:  # known when it is compiled
                e, f, g = (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w - x * x - y * y + z * z)
                rates[0], rates[1], rates[2] = (
                    rates[0] + (f * k - g * j),
                    rates[1] + (g * i - e * k),
                    rates[2] + (e * j - f * i),
                )
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
        scalar, *vector = problem.quaternion
        length = math.hypot(*vector)
        turn = [2.0 * math.atan2(length, scalar) / length * x if length else 0.0 for x in vector]
        node = system.AddNode(
            items.NodeRigidBodyRotVecLG(
                referenceCoordinates=[0.0] * 3 + turn, initialVelocities=[0.0, 0.0, 0.0, *velocity]
            )
        )
        # held by inertia: the centre of mass is the fixed point, and turning does not feel it
        mass = 1e6 if problem.heavy else 1.0
        body = system.AddObject(
            items.ObjectRigidBody(physicsMass=mass, physicsInertia=[*problem.inertia, 0.0, 0.0, 0.0], nodeNumber=node)
        )
        if problem.heavy:  # a unit force downwards at `load` has the moment of gravity
            place = system.AddMarker(items.MarkerBodyRigid(bodyNumber=body, localPosition=[*problem.load]))
            system.AddLoad(items.LoadForceVector(markerNumber=place, loadVector=[0.0, 0.0, -1.0]))
        system.Assemble()
        settings = exu.SimulationSettings()
        settings.solutionSettings.writeSolutionToFile = settings.displayStatistics = False
        time = settings.timeIntegration
        time.verboseMode, time.explicitIntegration.useLieGroupIntegration = 0, True
        time.automaticStepSize = setting < 1.0
        if setting < 1.0:
            time.relativeTolerance = time.absoluteTolerance = setting
            time.initialStepSize, time.minimumStepSize = 1e-2, 1e-8
        kind, variables, moments = (
            getattr(exu.DynamicSolverType, solver),
            exu.OutputVariableType,
            np.array(problem.inertia),
        )
        data, initially = system.systemData, exu.ConfigurationType.Initial
        first = data.GetODE2Coordinates(initially), data.GetODE2Coordinates_t(initially)

        def run(keep: Any = container) -> list[Result]:
            found = []
            data.SetODE2Coordinates(first[0], initially)
            data.SetODE2Coordinates_t(first[1], initially)
            for begin, end in problem.spans:
                time.startTime, time.endTime = begin, end
                time.numberOfSteps = 100 if setting < 1.0 else problem.steps(setting, end - begin)
                system.SolveDynamic(
                    settings, solverType=kind, storeSolver=False, updateInitialValues=len(problem.times) > 1
                )
                w = system.GetNodeOutput(node, variables.AngularVelocityLocal)
                found.append((moments * w, system.GetNodeOutput(node, variables.RotationMatrix).reshape(3, 3)))
            return found

        return run

    choices = {"RK44": doubled(100, 8), "RK67": doubled(25, 9), "DOPRI5": tolerances(-2, -12)}
    return [
        Contender("Exudyn", solver, settings, partial(prepare, solver=solver)) for solver, settings in choices.items()
    ]


# ------------------------------------------------------------------ Lielab


def lielab() -> list[Contender]:
    domain: Any = importlib.import_module("lielab.domain")
    integrate: Any = importlib.import_module("lielab.integrate")

    def prepare(problem: Problem, setting: float, tableau: str) -> Run:
        moments, load = np.array(problem.inertia), np.array(problem.load)
        _, attitude = result(problem.start)
        # spatial; the top keeps it beside the attitude, the free body as a constant
        momentum = attitude @ problem.mu

        def velocity(t: float, place: Any) -> Any:
            g, xi = place.point[0].get_matrix(), domain.so(3)
            m = place.point[1].serialize() if problem.heavy else momentum
            xi.set_vector(g @ ((m @ g) / moments))
            if not problem.heavy:
                return domain.CompositeAlgebra([xi])
            torque, (x, y, _) = domain.rn(3), g @ load
            torque.set_vector(np.array([-y, x, 0.0]))
            return domain.CompositeAlgebra([xi, torque])

        system, options = integrate.HomogeneousIVPSystem(velocity), integrate.IVPOptions()
        options.method = integrate.IVPMethod.MuntheKaas
        options.coefficients = getattr(integrate.RungeKuttaCoefficients, tableau)
        options.variable_time_step = setting < 1.0
        if setting < 1.0:
            options.reltol = options.abstol = setting
            options.dt, options.dt_max = 0.05, 10.0

        def run() -> list[Result]:
            parts, found = [domain.SO(attitude)], []
            if problem.heavy:
                parts.append(domain.RN.from_vector(momentum))
            place = domain.CompositeManifold(parts)
            for begin, end in problem.spans:
                if setting >= 1.0:
                    h = (end - begin) / problem.steps(setting, end - begin)
                    options.dt, options.dt_max, options.dt_min = h, 1.01 * h, 0.5 * h
                place = integrate.solve_ivp(system, np.array([begin, end]), place, options).y[-1]
                g = np.array(place.point[0].get_matrix())
                found.append(((place.point[1].serialize() if problem.heavy else momentum) @ g, g))
            return found

        return run

    choices = {
        "RK4a": doubled(125, 5),
        "RKDP54_7M": tolerances(-3, -9),
        "RKV87r": tolerances(-3, -12),
        "RKV98r": (*tolerances(-3, -13), TIGHTEST),
    }
    return [
        Contender("Lielab", f"RKMK {name}", settings, partial(prepare, tableau=name))
        for name, settings in choices.items()
    ]
