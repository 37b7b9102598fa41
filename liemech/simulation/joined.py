"""Runs of bodies as one run of all of them."""

from __future__ import annotations

from typing import Any

import numpy as np


def beside(runs: list[Any]) -> dict[str, Any]:
    """What runs of one body each, or of some, show together: a run that has less samples shows its
    last one again.
    """
    first, samples, h = runs[0], max(map(len, runs)), runs[0].h
    bodies = [run.bodies or 1 for run in runs]

    def together(arrays: list[np.ndarray]) -> np.ndarray:
        columns = [x[:, None] if run.bodies is None else x for x, run in zip(arrays, runs)]
        filled = [np.concatenate([x, np.repeat(x[-1:], samples - len(x), axis=0)]) for x in columns]
        return np.concatenate(filled, axis=1)

    def clock(times: list[np.ndarray]) -> np.ndarray:
        """Times, (n, bodies) unless all have the same ones, (n,)."""
        if all(t.ndim == 1 and np.array_equal(t, times[0]) for t in times):
            return times[0]
        return together(
            [
                np.repeat(t[:, None], run.bodies, axis=1) if run.bodies and t.ndim == 1 else t
                for t, run in zip(times, runs)
            ]
        )

    def by_name(kept: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
        return {name: together([one[name] for one in kept]) for name in kept[0]}

    if first.rejected is not None:
        h = float(np.average([run.h for run in runs], weights=bodies))
    elif any(np.ndim(run.h) or run.h != h for run in runs):
        h = np.concatenate([np.broadcast_to(run.h, n) for run, n in zip(runs, bodies)])
    found = {
        "t": clock([run.t for run in runs]),
        "states": by_name([run.states for run in runs]),
        "h": h,
        "bodies": sum(bodies),
        "steps": max(run.steps for run in runs),
        "compiled": all(run.compiled for run in runs),
        "rejected": None if first.rejected is None else sum(run.rejected for run in runs),
    }
    if getattr(first, "tau", None) is not None:
        found["tau"] = clock([run.tau for run in runs])
    if getattr(first, "z", None) is not None:
        found["z"] = together([run.z for run in runs])
    if hasattr(first, "tangent"):
        found["tangent"] = by_name([run.tangent for run in runs])
    return found
