"""Random trees of links with mixed joints, springs and dampers, beside MuJoCo."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.joints import BallJoint, Damper, Link, Linkage, PrismaticJoint, RevoluteJoint, Spring

KINDS = {"hinge": RevoluteJoint, "ball": BallJoint, "slide": PrismaticJoint}


def random_tree(seed: int, n: int, scale: float, spread: float) -> list[dict[str, Any]]:
    """Links with a parent each; masses about `scale`, which differ by powers of ten up to `spread`."""
    rng, links = np.random.default_rng(seed), []
    for b in range(n):
        kind = ["hinge", "ball", "slide"][int(rng.integers(3))] if b else "hinge"
        mass = scale * rng.uniform(0.5, 2.0) * 10.0 ** rng.uniform(-spread, spread)
        free = 3 if kind == "ball" else 1
        axis = rng.normal(size=3)
        links.append({
            "parent": int(rng.integers(max(0, b - 4), b)) if b else -1, "kind": kind,
            "axis": axis / np.linalg.norm(axis), "mass": mass,
            "inertia": mass * np.sort(rng.uniform(0.1, 0.19, 3)),
            "at": rng.normal(size=3), "on": rng.normal(size=3) if b else np.zeros(3),
            "k": mass * rng.uniform(0.0, 5.0), "c": mass * rng.uniform(0.0, 0.1),
            "q": np.zeros(3) if free == 3 else 0.3 * rng.normal(size=1), "rate": 0.5 * rng.normal(size=free),
        })  # fmt: skip
    return links


def by_mujoco(mujoco: Any, links: list[dict[str, Any]], h: float, steps: int) -> np.ndarray:
    """Where the centres of mass are after so many steps of RK4."""

    def text(x: Any) -> str:
        return " ".join(repr(float(a)) for a in x)

    def body(b: int) -> str:
        x = links[b]
        axis = "" if x["kind"] == "ball" else f'axis="{text(x["axis"])}"'
        return (
            f'<body name="b{b}" pos="{text(x["on"] - x["at"])}"><joint type="{x["kind"]}" '
            f'pos="{text(x["at"])}" {axis} stiffness="{x["k"]}" damping="{x["c"]}"/><inertial '
            f'pos="0 0 0" mass="{x["mass"]}" diaginertia="{text(x["inertia"])}"/>'
            + "".join(body(c) for c, other in enumerate(links) if other["parent"] == b)
            + "</body>"
        )

    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><compiler angle="radian"/><option timestep="{h}" integrator="RK4" '
        f'gravity="0 0 -9.80665"/><worldbody>{body(0)}</worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    for b, x in enumerate(links):
        joint = model.body(f"b{b}").jntadr[0]
        q, v = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
        data.qvel[v : v + len(x["rate"])] = x["rate"]
        if x["kind"] != "ball":
            data.qpos[q] = x["q"][0]
    mujoco.mj_step(model, data, steps)
    mujoco.mj_forward(model, data)
    return np.array([data.body(f"b{b}").xipos for b in range(len(links))])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seed", "n", "scale", "spread", "error"),
    [(0, 5, 1.0, 0.0, 1e-11), (3, 60, 1.0, 0.0, 1e-9), (4, 10, 1e-6, 0.0, 1e-11),
     (5, 10, 1e6, 0.0, 1e-11), (6, 8, 1.0, 3.0, 1e-7)],
)  # fmt: skip
def test_random_trees_move_as_in_mujoco(seed: int, n: int, scale: float, spread: float, error: float) -> None:
    mujoco = pytest.importorskip("mujoco")
    links = random_tree(seed, n, scale, spread)
    joints, forces = [], []  # type: list[Any], list[Any]
    for b, x in enumerate(links):
        ends = b, None if b == 0 else x["parent"], x["at"], x["on"]
        axes = {"hinge": (x["axis"], x["axis"]), "ball": (), "slide": (x["axis"],)}[x["kind"]]
        joints.append(KINDS[x["kind"]](*ends, *axes))  # type: ignore[operator]
        forces += [Spring(b, x["k"]), Damper(b, x["c"])]
    linkage = Linkage([Link(x["mass"], x["inertia"]) for x in links], joints, forces=forces)
    start = linkage.state(
        angles={b: x["q"] for b, x in enumerate(links)}, rates={b: x["rate"] for b, x in enumerate(links)}
    )
    method, wanted, errors = lm.Composition(lm.LieRATTLE(), order=4), None, []
    wanted = by_mujoco(mujoco, links, 1e-4, 1000)
    for h in (0.002, 0.001):
        run = lm.integrate(linkage, method, start, h=h, steps=round(0.1 / h), compiled=True)
        errors.append(np.abs(run.g[-1].reshape(n, 4, 4)[:, :3, 3] - wanted).max())
    assert errors[1] < error
    assert errors[1] < errors[0] / 8.0  # order 4, down to rounding
