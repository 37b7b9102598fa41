"""The two diagrams of the article: canonical transformations of extended phase space, (t, q, p) to
(T, Q, P), and on a group with the dual of its Lie algebra, (t, q_0, pi_0) to (t, q_1, pi_1).

    python docs/figures/diagrams.py               # writes canonical_transformation.png, dual_transformation.png

What is drawn is computed: the motions of a pendulum, and of the free body of the article.
"""

import warnings
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import FancyArrowPatch

import liemech as lm

GREY, BLUE, RED = "0.35", "#1f5fa8", "#b3332b"


def stage(width: float = 9.6, height: float = 4.9) -> tuple[Any, Any, Any]:
    """A figure with two spaces side by side."""
    figure = plt.figure(figsize=(width, height))
    left = figure.add_axes((0.0, 0.28, 0.44, 0.70), projection="3d")
    right = figure.add_axes((0.56, 0.28, 0.44, 0.70), projection="3d")
    return figure, left, right


def arrow(
    figure: Any, begin: tuple[float, float], end: tuple[float, float], bend: float = 0.0
) -> None:
    """An arrow in the coordinates of the figure."""
    figure.add_artist(
        FancyArrowPatch(
            begin,
            end,
            transform=figure.transFigure,
            arrowstyle="-|>",
            mutation_scale=16,
            color=GREY,
            linewidth=1.4,
            connectionstyle=f"arc3,rad={bend}",
        )
    )


def below(figure: Any, box: str, left: str, right: str) -> None:
    """The mixed coordinates, and the maps from there to both spaces."""
    frame = {"boxstyle": "round,pad=0.5", "facecolor": "white", "edgecolor": GREY}
    figure.text(0.5, 0.105, box, ha="center", va="center", fontsize=13, bbox=frame)
    arrow(figure, (0.345, 0.12), (0.22, 0.29), -0.2)
    arrow(figure, (0.655, 0.12), (0.78, 0.29), 0.2)
    figure.text(0.235, 0.165, left, ha="right", va="center", fontsize=12)
    figure.text(0.765, 0.165, right, ha="left", va="center", fontsize=12)


def canonical_transformation() -> None:
    """Curves of X_H on the left, straight lines of X_K, K = 0, on the right."""
    figure, old, new = stage()
    pendulum, times = lm.models.Pendulum(gravity=1.0), np.linspace(0.0, 7.0, 300)
    for k, (q, p) in enumerate([(0.6, 0.0), (1.2, 0.0), (1.2, 0.9), (-0.9, 0.6)]):
        start = pendulum.state(q, p)
        exact = pendulum.exact(start, times)
        color = RED if k == 2 else BLUE
        old.plot(times, np.asarray(exact.q)[:, 0], np.asarray(exact.p)[:, 0], color=color, lw=1.4)
        new.plot(times, 0.0 * times + q, 0.0 * times + p, color=color, lw=1.4)
        for ax in (old, new):
            ax.scatter([0.0], [q], [p], color=color, s=16)
    for ax, names, title in (
        (old, ("$t$", "$q$", "$p$"), r"$\theta = p\,\mathrm{d}q - H\,\mathrm{d}t$"),
        (new, ("$T$", "$Q$", "$P$"), r"$\Theta = P\,\mathrm{d}Q - K\,\mathrm{d}T$,   $K = 0$"),
    ):
        ax.set(xlim=(0.0, 7.0), ylim=(-2.0, 2.0), zlim=(-2.0, 2.0))
        ax.set_xlabel(names[0], labelpad=-12)
        ax.set_ylabel(names[1], labelpad=-12)
        ax.set_zlabel(names[2], labelpad=-12)
        ax.set_title(title, y=0.97, fontsize=13)
        ax.tick_params(labelbottom=False, labelleft=False, labelright=False)
        ax.set_xticklabels([])
        ax.set_yticklabels([])
        ax.set_zticklabels([])
        ax.view_init(elev=18.0, azim=-62.0)
    arrow(figure, (0.445, 0.64), (0.555, 0.64))
    figure.text(0.5, 0.675, r"$\psi$", ha="center", fontsize=15)
    below(
        figure,
        "$(t, q, P)$,   $G(t, q, P)$",
        r"$h:\ p = \frac{\partial G}{\partial q}$",
        r"$f:\ Q = \frac{\partial G}{\partial P}$",
    )
    lm.plots.save(figure, "canonical_transformation.png", dpi=130)
    print("canonical_transformation.png: every curve of X_H is a straight line of X_K")


def sphere(ax: Any, radius: float) -> None:
    """The coadjoint orbit."""
    a, b = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 25), np.linspace(0.0, np.pi, 13))
    x = radius * np.array([np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), np.cos(b)])
    ax.computed_zorder = False  # what is drawn later is in front
    ax.plot_wireframe(*x, color="0.85", linewidth=0.5, zorder=0)
    ax.set_axis_off()
    ax.set(xlim=(-radius, radius), ylim=(-radius, radius), zlim=(-radius, radius))
    ax.set_box_aspect((1.0, 1.0, 1.0), zoom=1.3)
    ax.view_init(elev=20.0, azim=25.0)


def dual_transformation() -> None:
    """The momentum before a step and after it, on one coadjoint orbit."""
    figure, old, new = stage()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", lm.errors.InertiaWarning)
        body = lm.RigidBody([2 / 3, 1.0, 2.0])
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    end = 3.0
    along = body.exact(start, np.linspace(0.0, end, 200)).mu
    around = body.exact(start, np.linspace(0.0, body.period(start), 400)).mu
    g = body.exact(start, [end]).g[0]
    off = np.abs(g.T @ np.array(start.mu) - along[-1]).max()
    for ax, point, name, color in (
        (old, along[0], r"$\pi_0$", BLUE),
        (new, along[-1], r"$\pi_1$", RED),
    ):
        sphere(ax, 1.0)
        ax.plot(*around.T, color="0.45", lw=1.2, zorder=1)
        ax.quiver(0.0, 0.0, 0.0, *point, color=color, lw=1.8, arrow_length_ratio=0.12, zorder=3)
        ax.text(*(1.17 * point), name, color=color, fontsize=15, zorder=4)
    new.plot(*along.T, color=RED, lw=2.2, zorder=2)
    new.scatter(*along[:1].T, color=BLUE, s=18, zorder=3)
    figure.text(
        0.22, 0.955, r"$\theta = \pi_0\,\lambda_{q_0} - H\,\mathrm{d}t$", ha="center", fontsize=13
    )
    figure.text(
        0.78, 0.955, r"$\Theta = \pi_1\,\lambda_{q_1} - K\,\mathrm{d}t$", ha="center", fontsize=13
    )
    arrow(figure, (0.42, 0.64), (0.58, 0.64))
    figure.text(0.5, 0.675, r"$\pi_1 = \mathrm{Ad}^*_g\,\pi_0$", ha="center", fontsize=14)
    figure.text(0.5, 0.575, r"$q_1 = q_0\,g$", ha="center", fontsize=13)
    below(
        figure,
        r"$(t, q_0, q_1)$,   $\bar S_t(g)$,   $g = q_0^{-1} q_1$",
        r"$h:\ \pi_0 = R_g^*\,\frac{\partial\bar S_t}{\partial g}$",
        r"$f:\ \pi_1 = L_g^*\,\frac{\partial\bar S_t}{\partial g}$",
    )
    lm.plots.save(figure, "dual_transformation.png", dpi=130)
    print(f"dual_transformation.png: Ad*_g pi_0 is pi_1 to {off:.0e}")


if __name__ == "__main__":
    canonical_transformation()
    dual_transformation()
