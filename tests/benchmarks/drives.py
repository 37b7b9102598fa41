"""What rotors, gears and dry friction cost: microseconds of processor time of a step of LieRATTLE of an arm of three
hinges, the least of several rounds in which all arms take turns.

    python tests/benchmarks/drives.py [--quick]
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import liemech as lm
from liemech.joints import Damper, DryFriction, Link, Linkage, Mimic, RevoluteJoint

ARMATURES = [0.1, 0.2, 0.3]


def arm(armatures: Any = (0.0, 0.0, 0.0), forces: Any = (), mimics: Any = ()) -> Linkage:
    """Three bodies on hinges across each other."""
    axes = [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.6, 0.8]]
    ends = [([0, 0, 0.5], [0, 0, 0]), ([0, 0, 0.4], [0, 0, -0.5]), ([0.1, 0, 0.3], [0, 0, -0.4])]
    joints = [
        RevoluteJoint(k, k - 1 if k else None, *ends[k], axes[k], axes[k], armature=armatures[k]) for k in range(3)
    ]
    moments = [[0.1, 0.12, 0.02], [0.05, 0.06, 0.03], [0.04, 0.03, 0.05]]
    return Linkage([Link(1.0, J) for J in moments], joints, forces=forces, mimics=mimics)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    steps, rounds = (200, 1) if quick else (5000, 7)
    dampers = [Damper(k, 0.1) for k in range(3)]
    arms = {
        "alone": arm(),
        "armatures": arm(ARMATURES),
        "dampers": arm(forces=dampers),
        "dampers, armatures": arm(ARMATURES, dampers),
        "and a joint that follows": arm(ARMATURES, dampers, [Mimic(2, 0, -0.7, 0.3)]),
    }
    for speed in (0.5, 1e-2, 1e-6):
        rubbing = [DryFriction(k, 0.2, speed) for k in range(3)]
        arms[f"dry friction, {speed:g} rad/s"] = arm(forces=rubbing)
    if quick:  # as few as there are kinds of code
        arms = {name: arms[name] for name in ("armatures", "dry friction, 1e-06 rad/s")}
    plans = {name: lm.Plan(one, lm.LieRATTLE(), h=1e-3, every=steps, compiled=True) for name, one in arms.items()}
    starts = {name: one.state(angles={0: 0.5, 1: -0.7}) for name, one in arms.items()}
    least = dict.fromkeys(arms, float("inf"))
    for turn in range(rounds + 1):
        for name, plan in plans.items():
            begin = time.process_time()
            plan.run(starts[name], steps=steps)
            spent = (time.process_time() - begin) / steps * 1e6
            least[name] = min(least[name], spent) if turn else least[name]
    for name, spent in least.items():
        print(f"{name:28} {spent:6.2f} us a step")


if __name__ == "__main__":
    main()
