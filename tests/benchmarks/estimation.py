"""What estimation costs: a step of each filter, ensembles, and the smoothing of a chain of poses, beside
gtsam where it is installed, else beside the same filter in NumPy.

    python tests/benchmarks/estimation.py [--quick]

Processor time of one thread, the least of several rounds; both sides of a comparison in one process.
"""

from __future__ import annotations

import argparse
import importlib
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from harness import cost

import liemech as lm

es = lm.estimation


def native(call: Callable[[], Any]) -> float:
    """Call until native code is there; the seconds that took, with the calls in plain Python."""
    begun = time.process_time()
    last = np.inf
    while time.process_time() - begun < 20.0 and last > 5e-5:
        at = time.process_time()
        for _ in range(8):
            call()
        last = (time.process_time() - at) / 8
    return time.process_time() - begun


def problems() -> list[tuple[str, Any, Any, Any, Any]]:
    """A process, a sensor, an input and a measurement of each."""
    se3, imu, biased = (lm.SE3(), es.Imu([1e-3] * 3, [1e-2] * 3), es.BiasedImu([1e-3] * 3, [1e-2] * 3, [1e-4] * 6))
    gyro, w = es.BiasedGyroscope([1e-3] * 3, [1e-5] * 3), np.array([0.1, 0.2, 0.3])
    at_rest, z = np.array([0.1, 0.2, 0.3, 0.0, 0.0, 9.8]), np.array([0.1, 0.2, 0.3])
    up = es.Direction(lm.SO3(), [0.0, 0.0, 1.0], [0.01] * 3)
    return [
        ("SO(3), direction", es.Turning(lm.SO3(), [1e-3] * 3), up, w, np.array([0.0, 0.05, 1.0])),
        ("SO(3) x R^3, direction", gyro, es.OfPart(gyro.group, 0, up), w, np.array([0.0, 0.05, 1.0])),
        ("SE(3), landmark", es.Turning(se3, [1e-3] * 6), es.Landmark(se3, [1.0, 2.0, 3.0], [0.1] * 3),
         np.array([0.1, 0.2, 0.3, 1.0, 0.0, 0.0]), np.array([0.9, 2.1, 3.1])),
        ("SE_2(3), position", imu, es.Position(imu.group, [0.1] * 3), at_rest, z),
        ("SE_2(3) x R^6, position", biased,
         es.OfPart(biased.group, 0, es.Position(imu.group, [0.1] * 3)), at_rest, z),
    ]  # fmt: skip


def in_numpy(group: Any) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """The steps of the filter on SO(3), written out with NumPy as users do."""
    g, P, Q, R = np.eye(3), 0.01 * np.eye(3), 1e-6 * np.eye(3), 1e-4 * np.eye(3)
    known, u, z, h = (np.array([0.0, 0.0, 1.0]), np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.05, 1.0]), 0.1)

    def hat(w: Any) -> Any:
        return np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])

    def exp(w: Any) -> Any:
        angle = np.sqrt(w @ w)
        W = hat(w)
        return np.eye(3) + np.sin(angle) / angle * W + (1.0 - np.cos(angle)) / angle**2 * W @ W

    def predict() -> Any:
        turn = exp(h * u)
        return g @ turn, turn.T @ P @ turn + h * Q

    def update() -> Any:
        d = g.T @ known
        H = hat(d)
        S = H @ P @ H.T + R
        K = np.linalg.solve(S, H @ P).T
        A = np.eye(3) - K @ H
        return g @ exp(K @ (z - d)), A @ P @ A.T + K @ R @ K.T

    return predict, update


def filters(rounds: int, calls: int) -> None:
    print(f"{'filter':26} {'kind':12} {'predict':>8} {'update':>8}  us;   until native, s;   per member of 1000, us")
    for name, process, sensor, u, z in problems():
        for kind in (es.ErrorStateFilter, es.UnscentedFilter):
            f = kind(process)
            start = f.belief(np.array(process.group.identity()), np.full(process.group.dim, 0.1))
            steps = [partial(f.predict, start, u, 0.01), partial(f.update, start, sensor, z)]
            made = sum(map(native, steps))
            times = [cost(step, rounds, calls) for step in steps]
            many = f.belief(np.broadcast_to(start.g, (1000, *np.shape(start.g))), start.covariance)
            us, zs = np.tile(u, (1000, 1)), np.tile(z, (1000, 1))
            several = [partial(f.predict, many, us, 0.01), partial(f.update, many, sensor, zs)]
            for step in several:
                native(step)
            each = [cost(step, rounds, max(calls // 100, 1)) / 1000 for step in several]
            print(
                f"{name:26} {kind.__name__[:11]:12} {times[0]:8.1f} {times[1]:8.1f}       {made:8.1f}"
                f"            {each[0]:8.2f} {each[1]:8.2f}",
                flush=True,
            )
    predict, update = in_numpy(lm.SO3())
    print(f"{'SO(3) in NumPy':26} {'MEKF':12} {cost(predict, rounds, calls):8.1f} {cost(update, rounds, calls):8.1f}")


def chain(n: int) -> tuple[Any, ...]:
    """A tour of n poses with odometry, and a position at every tenth."""
    rng, group, h = np.random.default_rng(4), lm.SE3(), 1.0
    process = es.Turning(group, [0.01] * 3 + [0.05] * 3)
    u = np.tile([0.0, 0.0, 0.1, 1.0, 0.0, 0.05], (n, 1))
    noise = np.array([0.01] * 3 + [0.05] * 3)
    x = [np.eye(4)]
    for k in range(n):
        x.append(process.move(x[-1], u[k], noise * rng.normal(size=6), h))
    truth = np.array(x)
    fix, at = es.Position(group, [0.2] * 3), np.arange(0, n + 1, 10)
    z = fix.value(truth[at]) + 0.2 * rng.normal(size=(len(at), 3))
    prior = es.ErrorStateFilter(process).belief(np.eye(4), [0.01] * 6)
    return process, prior, u, h, fix, at, z


def smoothing(rounds: int, sizes: tuple[int, ...]) -> None:
    gtsam: Any = None
    try:
        gtsam = importlib.import_module("gtsam")
    except ImportError:
        print("gtsam is not installed")
    print(
        f"{'chain of poses':16} {'ours, ms':>10} {'steps':>6} {'gtsam, ms':>10} {'steps':>6} {'ratio':>7}  largest difference"
    )
    for n in sizes:
        process, prior, u, h, fix, at, z = chain(n)

        def ours() -> Any:
            return es.smooth(process, prior, u, h, [(fix, at, z)])  # noqa: B023

        for _ in range(30):  # until it is native
            found = ours()
        line = f"{n:16d} {cost(ours, rounds, 1) / 1e3:10.1f} {found.steps:6d}"
        if gtsam is not None:
            line += beside(gtsam, rounds, n, found, chain(n), cost(ours, rounds, 1))
        print(line, flush=True)


def beside(gtsam: Any, rounds: int, n: int, found: Any, problem: Any, ours: float) -> str:
    """The same with gtsam's factors: its Pose3 has the rotation first, and errors on the right hand, as ours
    on the left. The noise of a link is that of its twist, carried by the same dexp.
    """
    process, prior, u, h, _, at, z = problem
    group = process.group
    J = np.array([group.dexp(h * u[0], unit) for unit in np.eye(6)]).T
    Q = J @ np.diag((h * np.asarray(process.deviations(h))) ** 2) @ J.T
    step = gtsam.Pose3(np.asarray(group.exp(h * u[0])))
    link = gtsam.noiseModel.Gaussian.Covariance(Q)
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    first = gtsam.noiseModel.Gaussian.Covariance(np.array(prior.covariance))
    graph.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(prior.g), first))
    path = gtsam.Pose3(prior.g)
    for k in range(n):
        graph.add(gtsam.BetweenFactorPose3(k, k + 1, step, link))
        values.insert(k, path)
        path = path.compose(step)
    values.insert(n, path)
    sight = gtsam.noiseModel.Diagonal.Sigmas(np.array([0.2] * 3))
    for k, value in zip(at, z):
        graph.add(gtsam.GPSFactor(int(k), gtsam.Point3(*value), sight))
    parameters = gtsam.GaussNewtonParams()
    parameters.setRelativeErrorTol(1e-12)
    parameters.setAbsoluteErrorTol(1e-12)

    def theirs() -> Any:
        optimizer = gtsam.GaussNewtonOptimizer(graph, values, parameters)
        result = optimizer.optimize()
        marginals = gtsam.Marginals(graph, result)
        covariances = [marginals.marginalCovariance(k) for k in range(n + 1)]
        return optimizer.iterations(), result, covariances

    steps, result, covariances = theirs()
    path = np.array([result.atPose3(k).matrix() for k in range(n + 1)])
    apart = np.abs(path - found.g).max()
    spread = np.abs(np.array(covariances) - found.covariance).max() / np.abs(found.covariance).max()
    them = cost(theirs, rounds, 1)
    return f" {them / 1e3:10.1f} {steps:6d} {ours / them:7.2f}  {apart:.1e} (covariance {spread:.1e})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    if quick:
        global problems
        some = problems()[:1]
        problems = lambda: some  # noqa: E731
    filters(2 if quick else 7, 100 if quick else 1000)
    smoothing(1 if quick else 5, (30,) if quick else (100, 1000))


if __name__ == "__main__":
    main()
