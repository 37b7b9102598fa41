"""What is shown, against what it costs: the run behind it, the writing of the page, the size of the page.

    python tests/benchmarks/viewer.py [--quick]

A free rigid body by LiePoissonHamiltonJacobi(order=4).  `run` is the time of the integration, which records what is
shown and no more; `page` that of drawing and writing; both are processor time, medians of alternating repetitions in
one warm process.
"""

import argparse
import statistics
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from harness import table

import liemech as lm
from liemech.viewer import Body, Momentum, Scene, SpatialMomentum, animate

BODY = lm.RigidBody([1.0, 2.0, 3.0])
START = BODY.state(mu=[0.02, 1.0, 0.05], g=np.eye(3))
METHOD = lm.LiePoissonHamiltonJacobi(order=4)
BARE = Momentum(trail=False, sphere=False, levels=0)
SHOWN: dict[str, Any] = {
    "momentum: arrow": BARE,
    "and the trail": Momentum(sphere=False, levels=0),
    "and the sphere": Momentum(levels=0),
    "and the curves of energy": Momentum(),
    "body": Body(),
    "body, space momentum": (Body(), SpatialMomentum()),
    "all of it": (Body(), SpatialMomentum(), Momentum()),
}


def timed(call: Callable[[], Any]) -> tuple[Any, float]:
    begun = time.process_time()
    result = call()
    return result, time.process_time() - begun


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a smoke run")
    quick = parser.parse_args().quick
    repetitions, counts = (1, (600,)) if quick else (11, (600, 1_000_000))
    for steps in counts:
        spent: dict[str, list[tuple[float, float]]] = {name: [] for name in SHOWN}
        sizes: dict[str, tuple[int, int]] = {}
        for repetition in range(repetitions + 1):
            for name, show in SHOWN.items():
                scene, run = timed(partial(animate, BODY, METHOD, START, show, h=0.1, steps=steps, frames=600))
                page, written = timed(scene.html)
                if repetition:  # the first one compiles, and reads meshcat's file
                    spent[name].append((run, written))
                sizes[name] = len(page.encode()), len(scene.html(compressed=True))
        rows = []
        for name in SHOWN:
            run, written = (1e3 * statistics.median(column) for column in zip(*spent[name], strict=True))
            rows.append((name, run, written, *(size / 1e3 for size in sizes[name])))
        table(
            f"{steps} steps, at most 601 samples", ("shown", "run, ms", "page, ms", "plain, kB", "compressed, kB"), rows
        )
    same = lm.integrate(BODY, METHOD, START, h=0.1, steps=counts[-1])
    _, spent_on_all = timed(Scene(same).html)
    print(f"\nof a run that kept all {len(same)} samples the page takes {1e3 * spent_on_all:.0f} ms")


if __name__ == "__main__":
    main()
