"""A figure of errors over time: what drifts like N, what is bounded, what walks like sqrt N, and what stays."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from goals import CAYLEY, LONG, Size, walk

import liemech as lm


def draw(path: Path, size: Size) -> None:
    """Relative errors of the energy of a free body, root mean square over 16 starts, h = 0.1."""
    rkmk = walk(lm.RKMK(order=4), size.steps)
    own = walk(CAYLEY, size.steps)
    curves = [
        ("RKMK4: drifts, $N$", rkmk[0], rkmk[1]),
        ("Algorithm 1 (Cayley), the energy itself: bounded", own[0], own[2]),
        ("its mean energy, plain sums", *walk(CAYLEY, size.steps, compensated=False)[:2]),
        ("its mean energy, compensated sums (default)", own[0], own[1]),
        ("its mean energy, double-double", *walk(CAYLEY, size.steps, **LONG)[:2]),
    ]
    figure, axes = lm.plots.subplots(figsize=(7.5, 4.6))
    for k, (label, steps, error) in enumerate(curves):
        style = {"marker": "os^Dv"[k], "markersize": 3.5, "color": lm.plots.COLORS[k]}
        axes.loglog(steps, error, "-", label=label, **style)
    for power, (_, steps, error) in ((1.0, curves[0]), (0.5, curves[2]), (0.5, curves[3])):
        axes.loglog(steps, error[-1] * (steps / steps[-1]) ** power, ":", color="0.5", zorder=0)
    axes.axhline(np.finfo(float).eps, color="0.6", linewidth=0.8, zorder=0)
    axes.text(curves[0][1][0], 1.3 * np.finfo(float).eps, r"$\epsilon$", color="0.35")
    axes.set(xlabel="steps $N$", ylabel="relative error of the energy")
    axes.set_title(r"a free rigid body, $h$ = 0.1; dotted: $N$ and $\sqrt{N}$", fontsize=10)
    lm.plots.legend(axes, loc="upper left", bbox_to_anchor=(0.0, 0.74))
    lm.plots.save(figure, path)
