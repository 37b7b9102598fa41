"""The cheapest slew of a satellite: a torque at each step of a variational method, by gradients."""

import numpy as np
from scipy.optimize import minimize

import liemech as lm


@lm.record
class Thrust(lm.Force):
    torque: lm.PiecewisePolynomial
    covector = lambda self, t, xi, g: self.torque(t)  # noqa: E731


aim = lm.mat(*(lm.SO3().exp([0.0, 0.0, 2.0]) @ lm.SO3().exp([1.0, 0.0, 0.0])).tolist())
off = lambda s: lm.dot(s.mu, s.mu) + lm.sum((s.g - aim).flatten() ** 2)  # noqa: E731


def cost(u, weight):
    nodes, h = u.size // 3, 6.0 / u.size
    torque = lm.PiecewisePolynomial.constant(h * np.arange(nodes + 1), u.reshape(-1, 3))
    body = lm.MechanicalSystem(lm.RigidBody([1, 1.5, 2]), lm.NoPotential(), load=Thrust(torque))
    start, plan = body.state(mu=[0, 0, 0], g=np.eye(3)), lm.Plan(body, lm.LieVerlet(), h)
    miss = plan.gradient(off, start, steps=nodes, by="torque.values")
    return 0.5 * h * u @ u + weight * miss.value, h * u + weight * miss["torque.values"].ravel()


figure, ax = lm.plots.subplots()
for nodes, style in (10, "o"), (40, "-"):
    u = 0.1 * np.ones(3 * nodes)
    for weight in 10.0, 100.0, 1000.0:
        u = minimize(cost, u, (weight,), jac=True, options={"maxiter": 60}).x
    effort, miss = cost(u, 0.0)[0], cost(u, 1.0)[0] - cost(u, 0.0)[0]
    print(f"{nodes} nodes: cost {effort:.3f}, off by {miss:.0e}")
    ax.set_prop_cycle(color=lm.plots.COLORS[:3])
    names = [f"$u_{k}$, {nodes} nodes" for k in (1, 2, 3)]
    ax.plot((np.arange(nodes) + 0.5) * 2.0 / nodes, u.reshape(-1, 3), style, label=names)
ax.set(xlabel="time $t$ (s)", ylabel="torque $u$ (N m)"), lm.plots.legend(ax)
lm.plots.save(figure, "slew.png")
