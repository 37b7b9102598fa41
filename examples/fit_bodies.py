"""A hundred damped bodies: inertia, gain and momentum of each, fitted at once to noisy attitudes."""

import numpy as np
from scipy.optimize import minimize

import liemech as lm


@lm.record
class Miss(lm.Record):
    seen: lm.PiecewisePolynomial  # attitudes, nine numbers each
    __call__ = lambda self, t, state: lm.sum((state.g.flatten() - self.seen(t)) ** 2)  # noqa: E731


def motion(x, misses=None):
    bodies = [lm.DoubleBracket(lm.RigidBody([1.0, *row[:2]]), row[2]) for row in x.tolist()]
    start = bodies[0].state(mu=x[:, 3:], g=np.tile(np.eye(3), (100, 1, 1)))
    plan = lm.Plan(bodies, lm.RKMK(order=4), 0.05, every=10, progress=False)
    if misses is None:
        return plan.run(start, steps=400)
    words = {"by": ["start", "inertia", "damping"], "along": misses}
    found = plan.gradient(lambda state: 0.0, start, steps=400, **words)
    parts = found["inertia"][:, 1:], found["damping"], found["start"][:, :3]
    return found.value, np.column_stack(parts).ravel()


random, linear = np.random.default_rng(1).normal, lm.PiecewisePolynomial.linear
true = np.array([1.5, 2.0, 0.2, 0.3, 1.0, 0.5]) + 0.03 * random(size=(100, 6))
first, run = true * (1.0 + 0.05 * random(size=(100, 6))), motion(true)
seen = run.g + 0.01 * random(size=run.g.shape)
misses = [Miss(linear(run.t, seen[:, i].reshape(-1, 9))) for i in range(100)]
words = {"jac": True, "bounds": 600 * [(0.05, None)], "options": {"maxiter": 60}}
fit = minimize(lambda x: motion(x.reshape(100, 6), misses), first.ravel(), **words)
print(f"600 numbers, {fit.nfev} gradients: {motion(first, misses)[0]:.0f} to {fit.fun:.1f}")
figure, ax = lm.plots.subplots()
for x, style, label in (fit.x.reshape(100, 6), "-", "fitted"), (first, "--", "first guess"):
    ax.semilogy(run.t, (motion(x).g - seen).std((1, 2, 3)), style, label=label)
ax.set(xlabel="time $t$ (s)", ylabel="misfit of $g$"), lm.plots.legend(ax)
lm.plots.save(figure, "fit_bodies.png")
