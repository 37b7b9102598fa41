"""An arm of two links: PD gains and first angles, fitted to where its hand was seen."""

import numpy as np
from scipy.optimize import minimize

import liemech as lm


@lm.record
class PD(lm.joints.JointForce):
    gain: float
    damping: float
    effort = lambda self, t, q, rate: self.gain * (0.6 - q) - self.damping * rate  # noqa: E731


def motion(x, hand=None):
    two = lm.joints.chain(2, mass=0.5, length=0.3, axis=[0.0, 1.0, 0.0])
    arm = lm.joints.Linkage(two.links, two.joints, forces=[PD(0, *x[:2]), PD(1, *x[2:4])])
    start, *moved = [arm.state(angles=dict(enumerate(x[4:] + e))) for e in STEPS]
    plan, G = lm.Plan(arm, lm.LieRATTLE(), 0.01, every=5, progress=False), arm.configurations
    if hand is None:
        return plan.run(start, steps=60)
    miss = lambda t, s: lm.norm(lm.vec(s.g[19], s.g[27]) - hand(t)) ** 2  # noqa: E731
    found = plan.gradient(lambda s: 0.0, start, steps=60, by=["start", *GAINS], along=miss)
    eta = [G.log(G.compose(G.inverse(start.g), s.g)) / 1e-6 for s in moved]  # dg = g hat(eta)
    return found.value, [*(found[name] for name in GAINS), *(eta @ found["start"][12:])]


GAINS = ["forces.0.gain", "forces.0.damping", "forces.1.gain", "forces.1.damping"]
STEPS = np.array([[0.0, 0.0], [1e-6, 0.0], [0.0, 1e-6]])
run, first = motion(np.array([3.0, 0.3, 1.0, 0.1, 0.2, -0.1])), np.array([2, 0.2, 1.5, 0.15, 0, 0])
hand = lm.PiecewisePolynomial.linear(run.t, run.g[:, [19, 27]])  # x and z of the second link
fit = minimize(motion, first, args=(hand,), jac=True, tol=1e-12)
print(f"{fit.nfev} gradients: {fit.x.round(4)}, misfit {fit.fun:.0e}")
figure, ax = lm.plots.subplots()
for name, by, style in ("fitted", fit.x, "-"), ("first guess", first, "--"):
    ax.plot(*motion(by).g[:, [19, 27]].T, style, label=name)
ax.plot(*run.g[:, [19, 27]].T, "o", label="seen"), ax.set(xlabel="$x$ (m)", ylabel="$z$ (m)")
lm.plots.legend(ax), lm.plots.save(figure, "arm_gains.png")
