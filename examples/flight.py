"""The cheapest flight from pose to pose past an obstacle, a potential on SE(3), by gradients."""

import numpy as np
from scipy.optimize import minimize

import liemech as lm

N, h, SE3 = 20, 0.3, lm.SE3()
free = lm.LiePoissonSystem(SE3, lm.KineticEnergy([1.0, 1.5, 2.0, 3.0, 3.0, 3.0]))
aim = lm.mat(*(SE3.exp([0, 0, 0, 4, 0, 0]) @ SE3.exp([0, 0, 2.5, 0, 0, 0])).tolist())


@lm.record
class Wrench(lm.Force):
    table: lm.PiecewisePolynomial
    covector = lambda self, t, xi, g: self.table(t)  # noqa: E731


def cost(u, high):  # h sum(|u|^2 / 2 + V) + 1000 |off|^2
    table = lm.PiecewisePolynomial.constant(h * np.arange(N + 1), u.reshape(N, 6))
    body = lm.MechanicalSystem(free, lm.NoPotential(), load=Wrench(table))
    plan, start = lm.Plan(body, lm.LieVerlet(), h), body.state(mu=np.zeros(6), g=np.eye(4))
    off = lambda s: 1e3 * (lm.dot(s.mu, s.mu) + lm.sum((s.g - aim).flatten() ** 2))  # noqa: E731
    V = lambda s: h * high * lm.formulas.exp(-1.4 * lm.sum((s.g[:3, 3] - [2, 0.2, 0]) ** 2))  # noqa: E731
    f = plan.gradient(off, start, steps=N, by="table.values", along=V, every=1)
    return 0.5 * h * u @ u + f.value, h * u + f["table.values"].ravel(), plan.run(start, steps=N).g


figure, ax = lm.plots.subplots(figsize=(7.2, 3.0))
for high in 0.0, 1.0, 4.0:
    u = minimize(lambda *at: cost(*at)[:2], np.zeros(6 * N), high, "L-BFGS-B", jac=True).x
    g, text = cost(u, high)[2], f"obstacle {high:g}, effort {0.5 * h * u @ u:.2f}"
    print(f"{text}: the end is off by {np.linalg.norm(g[-1] - np.array(aim)):.0e}")
    color = ax.plot(*g[:, :2, 3].T, ".-", label=text)[0].get_color()
    ax.quiver(*g[:, :2, 3].T, *g[:, :2, 0].T, color=color, scale=20.0, width=0.003)
ax.plot(2.0, 0.2, "o", color="#c9ced8", markersize=40, zorder=0)
ax.set(xlabel="$x$ (m)", ylabel="$y$ (m)", ylim=(-0.9, 0.6))
lm.plots.legend(ax)
lm.plots.save(figure, "flight.png")
