"""Drawings of ideas.  The two diagrams of the article: canonical transformations of extended phase space,
(t, q, p) to (T, Q, P), and on a group with the dual of its Lie algebra, (t, q_0, pi_0) to (t, q_1, pi_1).
Coadjoint orbits; left and right; folds of the discrete equation; the discrete action principle.

    python docs/figures/diagrams.py               # writes canonical_transformation.png and the others

What is drawn is computed, and each drawing prints a number that says so.
"""

import warnings
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.patches import FancyArrowPatch

import liemech as lm
from liemech.plots.spheres.globe import globe, line
from liemech.plots.spheres.projection import VIEW, view_frame
from liemech.plots.style import dressed

GREY, (BLUE, RED) = "0.35", lm.plots.COLORS[:2]


def stage(projection: str | None = None) -> tuple[Any, Any, Any]:
    """A figure with two spaces side by side."""
    figure = plt.figure(figsize=(9.6, 4.9))
    left = figure.add_axes((0.0, 0.28, 0.44, 0.66), projection=projection)
    right = figure.add_axes((0.56, 0.28, 0.44, 0.66), projection=projection)
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
    figure, old, new = stage("3d")
    pendulum, times = lm.models.Pendulum(gravity=1.0), np.linspace(0.0, 7.0, 300)
    for k, (q, p) in enumerate([(0.6, 0.0), (1.2, 0.0), (1.2, 0.9), (-0.9, 0.6)]):
        start = pendulum.state(q, p)
        exact = pendulum.exact(start, times)
        color = lm.plots.COLORS[k]
        old.plot(times, np.asarray(exact.q)[:, 0], np.asarray(exact.p)[:, 0], color=color, lw=2.0)
        new.plot(times, 0.0 * times + q, 0.0 * times + p, color=color, lw=2.0)
        for ax in (old, new):
            ax.scatter([0.0], [q], [p], color=color, s=16)
    for ax, names, title in (
        (old, ("$t$", "$q$", "$p$"), r"$\theta = p\,\mathrm{d}q - H\,\mathrm{d}t$"),
        (new, ("$T$", "$Q$", "$P$"), r"$\Theta = P\,\mathrm{d}Q - K\,\mathrm{d}T$,   $K = 0$"),
    ):
        ax.set(xlim=(0.0, 7.0), ylim=(-1.5, 1.5), zlim=(-1.5, 1.5))
        ax.set_xlabel(names[0], labelpad=-12)
        ax.set_ylabel(names[1], labelpad=-12)
        ax.set_zlabel(names[2], labelpad=-12)
        ax.set_title(title, y=0.97, fontsize=13)
        ax.set(xticks=[0.0, 3.5, 7.0], yticks=[-1.5, 0.0, 1.5], zticks=[-1.5, 0.0, 1.5])
        ax.set(xticklabels=[], yticklabels=[], zticklabels=[])
        ax.set_box_aspect((1.5, 1.0, 0.9), zoom=1.1)
        for axis in (ax.xaxis, ax.yaxis, ax.zaxis):
            axis.pane.set(facecolor="white", edgecolor="0.8")
        ax.view_init(elev=24.0, azim=-66.0)
    arrow(figure, (0.445, 0.64), (0.555, 0.64))
    figure.text(0.5, 0.675, r"$\psi$", ha="center", fontsize=15)
    below(
        figure,
        "$(t, q, P)$,   $G(t, q, P)$",
        r"$h:\ p = \frac{\partial G}{\partial q}$",
        r"$f:\ Q = \frac{\partial G}{\partial P}$",
    )
    lm.plots.save(figure, "canonical_transformation.png")
    print("canonical_transformation.png: every curve of X_H is a straight line of X_K")


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
        lm.plots.momentum_sphere(
            point, exact=around, system=body, ax=ax, color=color, names=("",) * 3
        )
        frame = view_frame(*VIEW)
        place = (frame @ point)[:2]
        if ax is new:
            line(ax, along @ frame.T, back=0.35, zorder=4.0, color=RED, linewidth=2.6)
            ax.plot(*(frame @ along[0])[:2], "o", color=BLUE, zorder=6.0)
        ax.annotate(
            "",
            place,
            (0.0, 0.0),
            zorder=5.0,
            arrowprops={"arrowstyle": "-|>", "color": color, "lw": 2.2, "shrinkB": 0},
        )
        ax.text(
            *(1.3 * place), name, color=color, fontsize=15, ha="center", va="center", zorder=6.0
        )
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
    lm.plots.save(figure, "dual_transformation.png")
    print(f"dual_transformation.png: Ad*_g pi_0 is pi_1 to {off:.0e}")


def coadjoint_orbits() -> None:
    """Orbits of four groups: momenta moved by random elements of the group, with surfaces through them."""
    figure = plt.figure(figsize=(11.0, 3.4))
    rng, printed = np.random.default_rng(5), []
    angle, height = np.linspace(0.0, 2.0 * np.pi, 49), np.linspace(-1.1, 1.1, 17)
    panels: list[tuple[Any, str, Any]] = [
        (lm.SO3(), "so(3)*: spheres", lambda mu: np.eye(3)),
        (lm.SE2(), "se(2)*: cylinders, and points of an axis", lambda mu: np.eye(3)[[1, 2, 0]]),
        (lm.SL(2), "sl(2)*: hyperboloids and cones", _normal_form),
    ]
    for k, (group, title, turned) in enumerate(panels):
        ax, orbits = figure.add_subplot(1, 4, k + 1, projection="3d"), lm.coadjoint(group)
        frame = turned(group)
        for radius, color in ((0.5, BLUE), (1.0, RED)):
            if k == 0:
                a, b = np.meshgrid(angle, np.linspace(0.0, np.pi, 13))
                surface = radius * np.array(
                    [np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), np.cos(b)]
                )
                on = [radius, 0.0, 0.0]
            elif k == 1:
                a, b = np.meshgrid(angle, height)
                surface = np.array([radius * np.cos(a), radius * np.sin(a), b])
                on = [radius, 0.0, 0.3]
            elif color == BLUE:  # two sheets, each an orbit: here the upper
                a, b = np.meshgrid(angle, np.linspace(0.0, 1.0, 13))
                surface = np.array([b * np.cos(a), b * np.sin(a), np.sqrt(0.25 + b * b)])
                on = [0.0, 0.0, 0.5]
            else:
                a, b = np.meshgrid(angle, height)
                size = np.sqrt(0.36 + b * b)
                surface = np.array([size * np.cos(a), size * np.sin(a), b])
                on = [0.6, 0.0, 0.0]
            ax.plot_wireframe(*surface, color=color, linewidth=0.3, alpha=0.6)
            mu = np.linalg.solve(frame, on)
            moved = orbits.act(group.exp(0.7 * rng.normal(size=(400, 3))), mu)
            points = moved @ frame.T
            near = points[np.abs(points).max(axis=1) < 1.3]
            ax.scatter(*near.T, s=2, color=color, depthshade=False)
            first = orbits.casimirs(mu)
            size = np.abs(orbits.casimirs(moved) - first).max() / max(1.0, np.abs(first).max())
            printed.append(float(size))
        if k == 1:
            ax.plot([0.0, 0.0], [0.0, 0.0], [-1.3, 1.3], ":", color=GREY)
        ax.set_axis_off()
        ax.set_box_aspect((1.0, 1.0, 1.0), zoom=1.25)
        ax.set(xlim=(-1.3, 1.3), ylim=(-1.3, 1.3), zlim=(-1.3, 1.3))
        ax.view_init(elev=18.0, azim=35.0)
        figure.text(0.125 + 0.245 * k, 0.93, title, ha="center", fontsize=10)
    _half_planes(figure.add_subplot(1, 4, 4))
    figure.subplots_adjust(left=0.0, right=0.98, bottom=0.08, top=0.9, wspace=0.08)
    lm.plots.save(figure, "coadjoint_orbits.png")
    print(f"coadjoint_orbits.png: Casimirs of 2,400 moved momenta, apart by {max(printed):.0e}")


def _normal_form(group: Any) -> Any:
    """Coordinates in which the quadratic Casimir of sl(2) is +-(x^2 + y^2 - z^2)."""
    unit = np.eye(3)
    value = lambda mu: float(lm.coadjoint(group).casimirs(mu)[0])  # noqa: E731
    form = np.array([[(value(a + b) - value(a - b)) / 4.0 for b in unit] for a in unit])
    lengths, axes = np.linalg.eigh(form)
    if np.sum(lengths < 0.0) == 2:
        lengths = -lengths
    order = np.argsort(-lengths)  # z has the other sign
    frame: Any = (axes[:, order] * np.sqrt(np.abs(lengths[order]))).T
    return frame


def _half_planes(ax: Any) -> None:
    """Momenta of the maps x -> a x + b of the line: two half-planes, and the points between them."""
    ax.axhspan(0.0, 1.5, color=BLUE, alpha=0.12)
    ax.axhspan(-1.5, 0.0, color=RED, alpha=0.12)
    ax.plot([-1.5, 1.5], [0.0, 0.0], ":", color=GREY)
    for radius in (
        0.4,
        0.8,
        1.2,
    ):  # free motions, on circles |mu| = const: (mu_1, mu_2)' = (-mu_2^2, mu_1 mu_2)
        for sign, color in ((1.0, BLUE), (-1.0, RED)):
            a = np.linspace(0.08, np.pi - 0.08, 60)
            ax.plot(radius * np.cos(a), sign * radius * np.sin(a), color=color, lw=1.2)
            ax.annotate("", (-0.05, sign * radius), (0.05, sign * radius),
                        arrowprops={"arrowstyle": "->", "color": color})  # fmt: skip
    ax.set(xlim=(-1.5, 1.5), ylim=(-1.5, 1.5), aspect="equal", xticks=[], yticks=[])
    ax.set_xlabel(r"$\mu_1$", labelpad=1)
    ax.set_ylabel(r"$\mu_2$", labelpad=1)
    ax.figure.text(0.87, 0.93, "aff(1)*: half-planes, and points", ha="center", fontsize=10)


def left_and_right() -> None:
    """The same velocity seen from the body, g exp(xi), and from space, exp(xi) g."""
    figure, group = plt.figure(figsize=(9.6, 3.5)), lm.SO3()
    g = group.compose(group.exp([0.0, 0.0, 0.9]), group.exp([0.0, -0.5, 0.0]))
    xi = np.array([1.2, 0.0, 0.0])
    body, space = group.compose(g, group.exp(xi)), group.compose(group.exp(xi), g)
    same = np.abs(space - group.compose(g, group.exp(group.Ad(group.inverse(g), xi)))).max()
    titles = (
        "$g$",
        r"$g\,\exp(\xi)$: about the axis of the body",
        r"$\exp(\xi)\,g$: about the axis of space",
    )
    for k, (attitude, title) in enumerate(zip((g, body, space), titles)):
        ax = figure.add_subplot(1, 3, k + 1, projection="3d")
        ax.computed_zorder = False
        _brick(ax, attitude)
        for i, name in enumerate("123"):
            ax.plot(*np.outer([0.0, 1.5], np.eye(3)[i]).T, color="0.75", lw=0.9)
            ax.text(*(1.6 * np.eye(3)[i]), f"$e_{name}$", color="0.5", fontsize=10)
        axis = g[:, 0] if k == 1 else np.eye(3)[0]
        if k:
            ax.plot(*np.outer([-1.6, 0.0], axis).T, color=RED, lw=1.8, zorder=0)
            ax.plot(*np.outer([1.0, 1.7], axis).T, color=RED, lw=1.8, zorder=5)
            turn = [group.exp(a * axis) @ _across(axis) for a in np.linspace(0.0, 5.0, 40)]
            ring = 1.3 * axis + 0.25 * np.array(turn)
            ax.plot(*ring.T, color=RED, lw=1.4, zorder=5)
            ax.quiver(
                *ring[-1],
                *(3.0 * (ring[-1] - ring[-3])),
                color=RED,
                lw=1.4,
                arrow_length_ratio=0.9,
                zorder=6,
            )
        ax.set_axis_off()
        ax.set_box_aspect((1.0, 1.0, 1.0), zoom=1.3)
        ax.set(xlim=(-1.4, 1.4), ylim=(-1.4, 1.4), zlim=(-1.4, 1.4))
        ax.view_init(elev=20.0, azim=8.0)
        figure.text((k + 0.5) / 3.0, 0.93, title, ha="center", fontsize=11)
    figure.subplots_adjust(left=0.0, right=1.0, bottom=0.0, top=0.92, wspace=0.0)
    lm.plots.save(figure, "left_and_right.png")
    print(f"left_and_right.png: exp(xi) g is g exp(Ad_g^-1 xi) to {same:.0e}")


def _across(axis: Any) -> Any:
    """A unit vector across an axis."""
    other = np.cross(axis, [0.0, 0.3, 1.0])
    return other / np.linalg.norm(other)


def _brick(ax: Any, g: Any) -> None:
    """A brick with a light and a dark face, turned by g."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    half, faces, colors = np.array([1.0, 0.55, 0.25]), [], []
    for axis in range(3):
        for sign in (1.0, -1.0):
            i, j = [n for n in range(3) if n != axis]
            corners = np.zeros((4, 3))
            corners[:, axis] = sign * half[axis]
            corners[:, i] = half[i] * np.array([-1, 1, 1, -1])
            corners[:, j] = half[j] * np.array([-1, -1, 1, 1])
            light = (0.55, 0.75, 0.95)[axis]
            faces.append(corners @ g.T)
            blue, front = (light * 0.45, light * 0.65, light * 0.9), (0.85, 0.55, 0.45)
            colors.append(front if (axis, sign) == (0, 1.0) else blue)
    ax.add_collection3d(
        Poly3DCollection(faces, facecolor=colors, edgecolor="0.25", lw=0.6, zorder=2)
    )


def folds() -> None:
    """Solutions of the discrete equation of Algorithm 1 with exp, J x = (dexp_x)* s n, along fixed directions n of
    the momentum: curves that grow out of zero, some of which turn back.
    """
    J, algebra = np.array([2 / 3, 1.0, 2.0]), lm.SO3().algebra  # of the article

    def equation(x: Any, s: float, n: Any) -> tuple[Any, Any]:
        """The residual and its derivatives by x and s."""
        r, _, by_x = algebra.exp_residual(x, J * x, s * n)
        by_s = algebra.exp_residual(x, J * x, (s + 1.0) * n)[0] - r  # it is linear in s
        return r, np.hstack([np.diag(J) + by_x, by_s[:, None]])

    figure, ax = lm.plots.subplots(figsize=(7.2, 4.4))
    met, step = [], 0.02
    directions = [
        (0.93, 0.3, 0.2),
        (0.9, 0.4, 0.2),
        (0.876, 0.426, 0.225),
        (0.85, 0.45, 0.28),
        (0.86, 0.46, 0.2),
        (0.7, 0.6, 0.4),
    ]
    for k, direction in enumerate(directions):
        n = np.array(direction) / np.linalg.norm(direction)
        at, way = np.append(1e-3 * n / J, 1e-3), np.append(n / J, 1.0)
        curve = [at]
        while at[3] < 9.0 and np.linalg.norm(at[:3]) < 8.0 and len(curve) < 3000:
            tangent = np.linalg.svd(equation(at[:3], at[3], n)[1])[2][-1]
            way = tangent * np.sign(tangent @ way)
            there = at + step * way
            for _ in range(5):  # back to the curve, across its tangent
                r, slopes = equation(there[:3], there[3], n)
                off = np.append(r, way @ (there - at) - step)
                there = there - np.linalg.solve(np.vstack([slopes, way]), off)
            at = there
            curve.append(at)
        points = np.array(curve)
        s, size = points[:, 3], np.linalg.norm(points[:, :3], axis=1)
        back = np.flatnonzero(np.diff(s) < 0.0)
        color = lm.plots.COLORS[k % len(lm.plots.COLORS)]
        end = back[0] if len(back) else len(s)
        ax.plot(s[: end + 1], size[: end + 1], color=color, lw=1.8)
        ax.plot(s[end:], size[end:], "--", color=color, lw=1.2)
        if len(back):
            met.append(s[end])
            ax.plot(s[end], size[end], "o", color=RED, ms=6, zorder=4)
    ax.annotate("fold: the solution ends,\nand a step beyond has none\nthat continues the motion", (met[0], 5.2),
                (5.3, 1.6), arrowprops={"arrowstyle": "->", "color": GREY}, fontsize=9, color=GREY)  # fmt: skip
    ax.axhline(2.0 * np.pi, color=GREY, lw=1.0, ls=":")
    ax.text(
        8.95,
        2.0 * np.pi + 0.08,
        "a whole turn, where exp is singular",
        ha="right",
        fontsize=9,
        color=GREY,
    )
    ax.set(xlabel=r"$h|\mu|$", ylabel=r"$h|\xi|$", xlim=(0.0, 9.0), ylim=(0.0, 7.4))
    ax.set_title(
        "solutions of the discrete equation along six directions of the momentum", fontsize=10
    )
    lm.plots.save(figure, "folds.png")
    print(
        f"folds.png: {len(met)} of {len(directions)} solutions end in a fold, the first at h|mu| = {min(met):.3f}"
    )


def action_principle() -> None:
    """A discrete path and its variations with fixed ends, and the action along them."""
    body, group, h, steps = lm.RigidBody([1.0, 1.6, 2.3]), lm.SO3(), 0.4, 8
    J = np.array([1.0, 1.6, 2.3])
    method = lm.CovariantVariational(lm.Cayley())
    start = body.state(mu=[0.9, 1.4, -0.7], g=np.eye(3))
    g = lm.integrate(body, method, start, h=h, steps=steps).g
    rng, amplitude = np.random.default_rng(2), np.linspace(-0.5, 0.5, 81)

    def action(path: Any) -> Any:
        back = group.inverse(path[:-1])
        xi = np.array([group.cayley_inv(f) for f in group.compose(back, path[1:])]) / h
        return float(h * np.sum(0.5 * J * xi**2))

    figure = plt.figure(figsize=(9.6, 4.2))
    x, y = g[:, :2, 2].mean(axis=0)
    view = np.degrees(np.arctan2(y, x)), 25.0  # the path is in front
    left, frame = globe(figure.add_axes((0.0, 0.0, 0.5, 0.9)), view, None, ("", "", ""))
    right = dressed(figure.add_axes((0.58, 0.14, 0.39, 0.76)))
    worst = 0.0
    for color in (BLUE, *lm.plots.COLORS[2:4]):
        waves = np.sin(
            np.pi * np.outer(np.arange(steps + 1), [1, 2, 3]) / steps
        )  # zero at both ends
        eta = waves @ rng.normal(size=(3, 3))
        values = [action(group.compose(g, group.exp(e * eta))) for e in amplitude]
        right.plot(amplitude, values, color=color, lw=1.5)
        slope = (
            action(group.compose(g, group.exp(1e-4 * eta)))
            - action(group.compose(g, group.exp(-1e-4 * eta)))
        ) / 2e-4
        worst = max(worst, abs(slope) / values[40])
        varied = group.compose(g, group.exp(0.25 * eta))[:, :, 2]
        line(
            left,
            varied @ frame.T,
            back=0.35,
            zorder=2.0,
            color=color,
            ls="--",
            lw=1.2,
            marker="o",
            ms=3.5,
        )
    path = g[:, :, 2] @ frame.T
    line(left, path, back=0.35, zorder=3.0, color=RED, lw=2.2, marker="o", ms=5.5)
    for k, name in ((0, "$g_0$"), (steps, "$g_N$")):
        left.text(*(path[k, :2] + [0.09, 0.06]), name, color=RED, fontsize=14, zorder=4)
    figure.text(
        0.25, 0.93, "a path and three variations, ends fixed: the third axis of the body",
        ha="center", fontsize=10,
    )  # fmt: skip
    right.plot([0.0], [action(g)], "o", color=RED, zorder=4)
    right.set_xlabel(r"$\epsilon$ in $g_k \exp(\epsilon\,\eta_k)$")
    right.set_ylabel(r"$S_d = \sum_k h\,\ell(\xi_k)$")
    right.set_title("the action is stationary", fontsize=10)
    lm.plots.save(figure, "action_principle.png")
    print(f"action_principle.png: slopes of the action at the path, {worst:.0e} of it")


if __name__ == "__main__":
    canonical_transformation()
    dual_transformation()
    coadjoint_orbits()
    left_and_right()
    folds()
    action_principle()
