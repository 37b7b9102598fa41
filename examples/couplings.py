"""Couplings of a magnet learnt from the noisy motion of its spins: one way back gives all derivatives."""

import numpy as np
from scipy.optimize import minimize

import liemech as lm


@lm.record
class Exchange(lm.Term):
    J: float

    def energy(self, a, b):
        return -self.J * lm.dot(a.mu, b.mu)


lattice, rng = lm.neighbours.square(8, 8), np.random.default_rng(0)
exact, mu = 1.0 + 0.3 * rng.normal(size=128), rng.normal(size=(64, 3))


def magnet(J):
    spins = lm.LiePoissonSystem(lm.SO3() ** 64, lm.Terms(Exchange(lm.each(J)).over(lattice)))
    return lm.Plan(spins, lm.RKMK(order=4), h=0.1, every=2, progress=False)


def misfit(J):
    plan = magnet(J)
    off = plan.run(start, steps=20).mu - seen
    return np.sum(off**2) / 2, plan.pullback({"mu": off}, start, steps=20, by="J", every=2)["J"]


start = magnet(exact).system.state(mu=mu / np.linalg.norm(mu, axis=1)[:, None])
seen = magnet(exact).run(start, steps=20).mu + 0.01 * rng.normal(size=(11, 64, 3))
fit = minimize(misfit, np.ones(128), jac=True, method="L-BFGS-B", options={"ftol": 1e-4})
print(f"{fit.nfev} runs and ways back find 128 couplings to {np.std(fit.x - exact):.3f}")
axis = lm.plots.subplots(figsize=(4.6, 4.4))[1]
axis.plot([0.0, 2.0], [0.0, 2.0], "--", exact, fit.x, "o", markersize=3.0)
axis.set(xlabel="coupling $J$ of two spins", ylabel="$J$ learnt", title="64 spins")
axis.figure.savefig("couplings.png", dpi=200)
