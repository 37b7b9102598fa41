"""Mechanisms of the literature, an arm and a chain of 64 rods beside other programs.

    python tests/benchmarks/mechanisms.py [--quick] [--peers] [--figure FILE] [--out FILE]

1. Errors of Andrews' squeezer, slider-cranks, Bricard's loop, a governor and N four-bars against published
   numbers or solutions in minimal coordinates, at one step and at half of it; processor time of a step and
   of compiling.
2. The cost of N four-bars, by N.
3. The Puma of `examples/puma560.urdf`, held by six PD controllers against gravity and damping: processor
   time of a step of 1 ms, and errors after a tenth of a second against steps of 1/64 ms of order 4.  With --peers
   MuJoCo reads the same file.
4. With --peers, a chain of 64 rods on ball joints for a second: error against processor time, of MuJoCo, DART,
   Exudyn and Pinocchio's accelerations in an RKMK4 in Python, of those that are installed; --figure draws it.

Times are the least of several rounds; rounds of one table go in turn.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from harness import table, write
from spins import least

import liemech as lm

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT))
import benchmark_mechanisms  # noqa: E402

PUMA = ROOT.parent / "examples" / "puma560.urdf"


def spent(call: Callable[[], Any]) -> float:
    """Seconds of processor time."""
    begun = time.process_time()
    call()
    return time.process_time() - begun


# ------------------------------------------------------------------ the literature


def literature(chosen: Any) -> dict[str, Any]:
    """Errors, orders, costs."""
    kept, lines = {}, []
    names = ["spatial slider-crank"] if chosen.quick else benchmark_mechanisms.ALL
    for name in names:
        made = benchmark_mechanisms.ALL[name]()
        bodies, method = len(made.linkage.links), lm.LieRATTLE()
        h, steps = made.end / made.steps, made.steps
        plan = lm.Plan(made.linkage, method, h=h, every=steps, compiled=True, progress=False)
        compiling = spent(lambda: plan.run(made.start, steps=10))  # noqa: B023
        errors = [made.error(method, made.steps * n) for n in (1, 2)]
        four = made.error(lm.Composition(method, order=4), made.steps // 2) if not chosen.quick else None
        plan = lm.Plan(made.linkage, method, h=made.end / made.steps, every=made.steps, progress=False)
        runs = {name: lambda: plan.run(made.start, steps=made.steps)}  # noqa: B023
        us = 1e6 * least(runs, 3)[name] / made.steps
        kept[name] = {"errors": errors, "order 4": four, "us": us, "compile": compiling}
        lines.append([
            name, bodies, len(made.linkage.dropped), h, errors[0], errors[1],
            np.log2(errors[0] / errors[1]), four, us, us / bodies, compiling,
        ])  # fmt: skip
    table(
        "mechanisms of the literature: errors in rad or m at the end",
        ["", "bodies", "dropped", "h, s", "error", "h/2", "order", "order 4 at 2h", "us a step", "a body",
         "compile, s"],
        lines,
    )  # fmt: skip
    return kept


def four_bars(chosen: Any) -> dict[str, float]:
    """Microseconds a step by the number of loops."""
    found, lines = {}, []
    for loops in (2,) if chosen.quick else (1, 4, 16, 64):
        made = benchmark_mechanisms.four_bars(loops)
        steps = 4000 // loops
        plan = lm.Plan(made.linkage, lm.LieRATTLE(), h=made.end / steps, every=steps, progress=False)
        plan.run(made.start, steps=10)
        us = 1e6 * least({"run": lambda: plan.run(made.start, steps=steps)}, 5)["run"] / steps  # noqa: B023
        found[str(loops)] = us
        lines.append([loops, 2 * loops + 1, us, us / (2 * loops + 1)])
    table("N four-bars", ["loops", "bodies", "us a step", "us a body"], lines)
    return found


# ------------------------------------------------------------------ an arm


@lm.record
class PD(lm.joints.JointForce):
    """Holds a joint at an angle."""

    stiffness: float
    damping: float
    wanted: float

    def effort(self, t: float, q: float, rate: float) -> float:
        """The torque."""
        return self.stiffness * (self.wanted - q) - self.damping * rate


JOINTS = ("waist", "shoulder", "elbow", "wrist roll", "wrist pitch", "flange")
GAINS = [(4000, 120), (6000, 200), (3000, 60), (20, 0.2), (10, 0.05), (0.2, 0.004)]
WANTED = [0.5, 0.8, -0.6, 1.0, -0.4, 2.0]
FIRST = [0.2, 0.4, -0.7, 0.3, 0.8, 0.1]


def arm(chosen: Any) -> dict[str, Any]:
    """The Puma, beside MuJoCo."""
    hold = [PD(n, *map(float, gain), w) for n, gain, w in zip(JOINTS, GAINS, WANTED)]
    bare = lm.joints.Linkage.from_urdf(PUMA)
    held = lm.joints.Linkage.from_urdf(PUMA, forces=hold)
    angles, end, two = dict(zip(JOINTS, FIRST)), 0.1, lm.LieRATTLE()
    four = lm.Composition(two, order=4)

    def moved(linkage: Any, method: Any, h: float) -> np.ndarray:
        steps = round(end / h)
        run = lm.integrate(linkage, method, linkage.state(angles=angles), h=h, steps=steps, every=steps, progress=False)
        return np.array([run.joint(n).angle[-1] for n in JOINTS])

    reference = moved(held, *((two, 1e-3 / 16) if chosen.quick else (four, 1e-3 / 64)))
    runs: dict[str, Callable[[], Any]] = {}
    errors: dict[str, float] = {}
    steps = 500 if chosen.quick else 5000
    cases = [("ours, falling", bare, two), ("ours, held", held, two)][chosen.quick :]
    for name, linkage, method in cases + ([] if chosen.quick else [("ours, held, order 4", held, four)]):
        plan = lm.Plan(linkage, method, h=1e-3, every=steps, progress=False)
        start = linkage.state(angles=angles)
        plan.run(start, steps=10)
        runs[name] = lambda plan=plan, start=start: plan.run(start, steps=steps)  # type: ignore[misc]
        if linkage is held:
            for h in (1e-3, 5e-4):
                errors[f"{name}, {h:g} s"] = np.abs(moved(held, method, h) - reference).max()
    for name, integrator in (("Euler", 0), ("RK4", 1), ("implicitfast", 3)) if chosen.peers else ():
        made = in_mujoco(integrator)
        if made is None:
            break
        runs[f"MuJoCo, {name}"] = lambda made=made: made(1e-3, steps)  # type: ignore[misc]
        for h in (1e-3, 5e-4):
            errors[f"MuJoCo, {name}, {h:g} s"] = np.abs(made(h, round(end / h)) - reference).max()
    us = {name: 1e6 * t / steps for name, t in least(runs, 3 if chosen.quick else 7).items()}
    table("the Puma: microseconds a step of 1 ms", ["", "us"], [[k, v] for k, v in us.items()])
    table("its largest error of an angle after 0.1 s, rad", ["", "error"], [[k, v] for k, v in errors.items()])
    return {"us": us, "errors": errors}


def in_mujoco(integrator: int) -> Callable[[float, int], np.ndarray] | None:
    """The Puma under the same control, from the same file: the angles after so many steps."""
    try:
        import mujoco
    except ImportError:
        return None
    spec = mujoco.MjSpec.from_file(str(PUMA))
    for name, (k, c) in zip(JOINTS, GAINS):
        one = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        one.gaintype, one.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        one.gainprm[0], one.biasprm[1], one.biasprm[2] = k, -k, -c
    model = spec.compile()
    model.opt.gravity[:], model.opt.integrator = [0.0, 0.0, -9.80665], integrator
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_LIMIT)
    model.jnt_actfrclimited[:] = 0  # by the efforts of the file
    data = mujoco.MjData(model)

    def run(h: float, steps: int) -> np.ndarray:
        mujoco.mj_resetData(model, data)
        model.opt.timestep = h
        for name, q, wanted in zip(JOINTS, FIRST, WANTED):
            data.qpos[model.joint(name).qposadr] = q
            data.ctrl[model.actuator(name).id] = wanted
        mujoco.mj_step(model, data, steps)
        return np.array([data.qpos[model.joint(name).qposadr[0]] for name in JOINTS])

    return run


# ------------------------------------------------------------------ a chain beside others

RODS, END, RADIUS = 64, 1.0, 0.05
BENT = {0: np.array([0.3, 0.0, 0.0]), RODS // 2: np.array([0.0, 0.5, 0.0])}


def chain_peers() -> dict[str, tuple[Callable[[int], np.ndarray], list[int]]]:
    """Of each program the function that takes the chain to the end in so many steps and gives the place
    of its end, and numbers of steps; the chain begins at rest, its joints turned by `BENT`, rotation vectors.
    """
    found: dict[str, Any] = {}
    chain = lm.joints.chain(RODS)
    start = chain.state(angles=BENT)
    for name, method, counts in (
        ("LieRATTLE, order 2", lm.LieRATTLE(), [400, 800, 1600, 3200]),
        ("LieRATTLE, order 4", lm.Composition(lm.LieRATTLE(), order=4), [400, 800, 1600]),
        ("RKMK, order 4", lm.RKMK(order=4), [400, 800, 1600]),
        ("RKMK, order 8", lm.RKMK(order=8), [200, 400, 800]),
        ("Taylor, order 4", lm.Taylor(order=4), [400, 800, 1600]),
        ("Taylor, order 8", lm.Taylor(order=8), [100, 200, 400]),
        ("Taylor, order 12", lm.Taylor(order=12), [50, 100, 200]),
    ):

        def ours(steps: int, method: Any = method) -> np.ndarray:
            run = lm.integrate(chain, method, start, h=END / steps, steps=steps, every=steps, progress=False)
            pose = chain.poses(run.g)[-1, -1]
            return np.asarray(pose[:3, 3] - 0.5 * pose[:3, 2])

        found[f"liemech, {name}"] = ours, counts
    across, along = (3 * RADIUS**2 + 1.0) / 12, 0.5 * RADIUS**2
    try:
        import mujoco

        rod = '<body pos="0 0 {0}"><joint type="ball"/><inertial pos="0 0 -0.5" mass="1" diaginertia="{1} {1} {2}"/>'
        bodies = "".join(rod.format(0 if k == 0 else -1, across, along) for k in range(RODS))
        for name, counts in (("Euler", [400, 1600]), ("RK4", [200, 400, 800])):
            model = mujoco.MjModel.from_xml_string(
                f'<mujoco><option integrator="{name}" gravity="0 0 -9.80665"/><worldbody>{bodies}'
                + "</body>" * RODS + "</worldbody></mujoco>"
            )  # fmt: skip
            data = mujoco.MjData(model)

            def mujocos(steps: int, model: Any = model, data: Any = data) -> np.ndarray:
                mujoco.mj_resetData(model, data)
                model.opt.timestep = END / steps
                for k, turn in BENT.items():
                    data.qpos[4 * k : 4 * k + 4] = half_angles(turn)
                mujoco.mj_step(model, data, steps)
                mujoco.mj_kinematics(model, data)
                return np.asarray(data.xpos[-1] - data.xmat[-1].reshape(3, 3)[:, 2])

            found[f"MuJoCo, {name}"] = mujocos, counts
    except ImportError:
        pass
    try:
        import pinocchio as pin

        model, parent = pin.Model(), 0
        model.gravity.linear = np.array([0, 0, -9.80665])
        inertia = pin.Inertia(1.0, np.array([0, 0, -0.5]), np.diag([across, across, along]))
        for k in range(RODS):
            shift = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.0 if k == 0 else -1.0]))
            parent = model.addJoint(parent, pin.JointModelSpherical(), shift, f"ball {k}")
            model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        data, zero = model.createData(), np.zeros(model.nv)

        def pinocchios(steps: int) -> np.ndarray:
            """RKMK of order 4: q = q_n exp(u) joint by joint, u' = v + [u, v]/2 + [u, [u, v]]/12."""
            q, v, h = pin.neutral(model), np.zeros(model.nv), END / steps
            for k, turn in BENT.items():
                q[4 * k : 4 * k + 4] = np.roll(half_angles(turn), -1)

            def stage(u: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
                a = pin.aba(model, data, pin.integrate(model, q, u), w, zero).copy()
                U, W = u.reshape(-1, 3), w.reshape(-1, 3)
                once = np.cross(U, W)
                return (W + 0.5 * once + np.cross(U, once) / 12.0).ravel(), a

            for _ in range(steps):
                u1, a1 = stage(zero, v)
                u2, a2 = stage(0.5 * h * u1, v + 0.5 * h * a1)
                u3, a3 = stage(0.5 * h * u2, v + 0.5 * h * a2)
                u4, a4 = stage(h * u3, v + h * a3)
                q = pin.integrate(model, q, h / 6.0 * (u1 + 2.0 * (u2 + u3) + u4))
                v = v + h / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
            pin.forwardKinematics(model, data, q)
            end = data.oMi[RODS]
            return np.asarray(end.translation - end.rotation[:, 2])

        found["aba of Pinocchio, RKMK4 in Python"] = pinocchios, [200, 400, 800]
    except ImportError:
        pass
    try:
        import dartpy as dart

        def darts(steps: int) -> np.ndarray:
            world, skeleton, body = dart.simulation.World(), dart.dynamics.Skeleton("chain"), None
            world.setGravity([0, 0, -9.80665])
            world.setTimeStep(END / steps)
            for k in range(RODS):
                joint = dart.dynamics.BallJointProperties()
                joint.mName = f"ball {k}"
                shift = dart.math.Isometry3()
                if k:
                    shift.set_translation([0.0, 0.0, -1.0])
                joint.mT_ParentBodyToJoint = shift
                node = dart.dynamics.BodyNodeProperties(dart.dynamics.BodyNodeAspectProperties(f"rod {k}"))
                _, body = skeleton.createBallJointAndBodyNodePair(body, joint, node)
                inertia = dart.dynamics.Inertia(1.0, [0, 0, -0.5], np.diag([across, across, along]))
                body.setInertia(inertia)
            world.addSkeleton(skeleton)
            for k, turn in BENT.items():
                skeleton.getJoint(k).setPositions(turn)
            for _ in range(steps):
                world.step()
            T = skeleton.getBodyNode(RODS - 1).getWorldTransform()
            return np.asarray(T.translation() - T.rotation()[:, 2])

        darts(1)
        found["DART"] = darts, [400, 1600]
    except (ImportError, AttributeError, TypeError) as refused:
        print("DART:", refused)
    try:
        import exudyn as exu
        from exudyn.utilities import RigidBodyInertia

        poses = chain.poses(start.g)

        def exudyns(steps: int) -> np.ndarray:
            """The generalized-alpha method of index 2, sparse."""
            system = exu.SystemContainer().AddSystem()
            last = system.CreateGround()
            inertia = RigidBodyInertia(1.0, np.diag([across, across, along]))
            for k in range(RODS):
                body = system.CreateRigidBody(
                    inertia=inertia, referencePosition=list(poses[k, :3, 3]),
                    referenceRotationMatrix=poses[k, :3, :3], gravity=[0.0, 0.0, -9.80665],
                )  # fmt: skip
                top = poses[k, :3, 3] + 0.5 * poses[k, :3, 2]
                system.CreateSphericalJoint(itemNumbers=[last, body], position=list(top), useGlobalFrame=True)
                last = body
            system.Assemble()
            settings = exu.SimulationSettings()
            settings.timeIntegration.numberOfSteps, settings.timeIntegration.endTime = steps, END
            settings.timeIntegration.verboseMode = 0
            settings.timeIntegration.newton.useModifiedNewton = True
            settings.solution.file.write = False
            settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
            system.SolveDynamic(settings)
            place = system.GetObjectOutputBody(last, exu.OutputVariableType.Position, [0, 0, -0.5])
            return np.asarray(place)

        exudyns(2)
        found["Exudyn"] = exudyns, [100, 400]
    except (ImportError, AttributeError, TypeError, ValueError) as refused:
        print("Exudyn:", refused)
    return found


def half_angles(turn: np.ndarray) -> np.ndarray:
    """The unit quaternion of a rotation vector, its scalar part first."""
    angle = np.linalg.norm(turn)
    return np.array([np.cos(angle / 2), *(np.sin(angle / 2) / angle * turn)])


def equal_error(chosen: Any) -> dict[str, Any]:
    """Error and processor time of each program."""
    peers = chain_peers()
    reference, check = (peers["liemech, Taylor, order 12"][0](800), peers["liemech, RKMK, order 8"][0](3200))
    print(f"reference good to {np.abs(reference - check).max():.0e} m, by two methods")
    kept: dict[str, Any] = {}
    lines = []
    for name, (run, counts) in peers.items():
        kept[name] = []
        run(counts[0])
        for steps in counts[:2] if chosen.quick else counts:
            ends: list[np.ndarray] = []
            seconds = min(spent(lambda: ends.append(run(steps))) for _ in range(3))  # noqa: B023
            error = float(np.abs(ends[-1] - reference).max())
            kept[name].append((seconds, error))
            lines.append([name, steps, error, seconds, 1e6 * seconds / steps])
    table(f"chain of {RODS} rods, {END:g} s", ["", "steps", "error, m", "s", "us a step"], lines)
    if chosen.figure:
        drawn(kept, chosen.figure)
    return kept


GREYS = "#333333", "#555555", "#777777", "#999999", "#bbbbbb"


def drawn(kept: dict[str, Any], figure: str) -> None:
    """Errors over times, ours solid and in colour."""
    picture, ax = lm.plots.subplots(figsize=(7.6, 3.8))
    for k, (name, pairs) in enumerate(kept.items()):
        ours = name.startswith("liemech")
        marks = {"LieRATTLE": "o-", "RKMK": "s-", "Taylor": "D-."}
        style = marks[name.split(", ")[1]] if ours else "sD^vP"[k % 5] + "--"
        colours = lm.plots.COLORS if ours else GREYS
        colour = colours[k % len(colours)]
        shown = name.removeprefix("liemech, ")
        ax.loglog(*np.transpose(pairs), style, label=shown, color=colour, markersize=4)
    ax.set(xlabel="processor time (s)", ylabel="error of the end after 1 s (m)")
    lm.plots.legend(ax, loc="upper left", bbox_to_anchor=(1.02, 1.0))
    lm.plots.save(picture, figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--peers", action="store_true", help="other programs, those that are installed")
    parser.add_argument("--figure", help="draw errors and times of the chain")
    parser.add_argument("--only", choices=["literature", "four-bars", "arm", "chain"])
    parser.add_argument("--out")
    chosen = parser.parse_args()
    parts = {"literature": literature, "four-bars": four_bars, "arm": arm}
    if chosen.peers:
        parts["chain"] = equal_error
    kept = {name: part(chosen) for name, part in parts.items() if chosen.only in (None, name)}
    if chosen.out:
        write(chosen.out, kept)


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
