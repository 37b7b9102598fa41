"""On the ellipsoid of its energy a body spirals to the axis of most entropy, |mu|^2/2."""

import matplotlib.pyplot as plt
import numpy as np

import liemech as lm


@lm.record
class HalfSquare(lm.Hamiltonian):
    def energy(self, mu):
        return 0.5 * lm.dot(mu, mu)


body = lm.RigidBody([1.0, 1.5, 2.0])
relaxing = lm.Metriplectic(body, HalfSquare(), friction=0.05)
start = relaxing.state([0.9, 0.1, 0.2])
figure = plt.figure(figsize=(9.6, 4.2), layout="constrained")
path = figure.add_subplot(1, 2, 1, projection="3d")
laws = figure.add_subplot(1, 2, 2)
for method, colour in (lm.DiscreteGradient(), "C0"), (lm.RKMK(order=2), "C1"):
    run = lm.integrate(relaxing, method, start, h=0.5, steps=1000)
    entropy = 0.5 * (run.mu**2).sum(axis=1)
    print(
        f"{method.name:17s} energy off by {np.ptp(run.energy):.0e}, entropy "
        f"{entropy[0]:.3f} to {entropy[-1]:.3f}, least growth {np.diff(entropy).min():+.0e}"
    )
    laws.plot(run.t, entropy, color=colour, label=f"S, {method.name}")
    laws.plot(run.t, run.energy, "--", color=colour, label=f"H, {method.name}")
    if colour == "C0":
        path.plot(*run.mu.T, lw=0.8)
path.set(
    xlabel=r"$\mu_1$", ylabel=r"$\mu_2$", zlabel=r"$\mu_3$", aspect="equal", title="on one energy"
)
path.locator_params(nbins=4)
laws.set(xlabel="t in s", ylabel="energy, entropy")
laws.legend(fontsize=8)
lm.plots.save(figure, "relaxing_body.png", dpi=110)
