"""A figure of errors over time: what drifts like N, what is bounded, what walks like sqrt N, and
what stays.
"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from goals import CAYLEY, LONG, Size, walk

import liemech as lm


def draw(path: Path, size: Size) -> None:
    """Relative errors of the energy of a free body, root mean square over 16 starts, h = 0.1."""
    rkmk = walk(lm.RKMK(order=4), size.steps)
    own = walk(CAYLEY, size.steps)
    curves = [
        ("RKMK4: drifts, N", rkmk[0], rkmk[1], "C3"),
        ("Algorithm 1 (Cayley), the energy itself: bounded", own[0], own[2], "C0"),
        ("its mean energy, plain sums", *walk(CAYLEY, size.steps, compensated=False)[:2], "C1"),
        ("its mean energy, compensated sums (default)", own[0], own[1], "C2"),
        ("its mean energy, double-double", *walk(CAYLEY, size.steps, **LONG)[:2], "C4"),
    ]
    figure, axes = plt.subplots(figsize=(7.5, 4.6), layout="constrained")
    for label, steps, error, colour in curves:
        axes.loglog(steps, error, ".-", label=label, color=colour)
    for power, (_, steps, error, _) in ((1.0, curves[0]), (0.5, curves[2]), (0.5, curves[3])):
        axes.loglog(steps, error[-1] * (steps / steps[-1]) ** power, ":", color="0.6", zorder=0)
    axes.axhline(np.finfo(float).eps, color="0.8", zorder=0)
    axes.text(curves[0][1][0], 1.3 * np.finfo(float).eps, "eps", color="0.5")
    axes.set(xlabel="steps N", ylabel="relative error of the energy")
    axes.set_title("Free rigid body, h = 0.1; dotted: N and sqrt N", fontsize="medium")
    axes.legend(fontsize="small", loc="upper left", bbox_to_anchor=(0.0, 0.72))
    figure.savefig(path, dpi=110)
    plt.close(figure)
