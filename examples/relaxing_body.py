"""On the ellipsoid of its energy a body spirals to the axis of most entropy, |mu|^2/2."""

import numpy as np

import liemech as lm


@lm.record
class HalfSquare(lm.Hamiltonian):
    def energy(self, mu):
        return 0.5 * lm.dot(mu, mu)


body = lm.RigidBody([1.0, 1.5, 2.0])
relaxing = lm.Metriplectic(body, HalfSquare(), friction=0.05)
start = relaxing.state([0.9, 0.1, 0.2])
figure, (path, laws) = lm.plots.subplots(1, 2, figsize=(9.6, 4.2))
path.remove()
path = figure.add_subplot(1, 2, 1, projection="3d")
for method, colour in zip((lm.DiscreteGradient(), lm.RKMK(order=2)), lm.plots.COLORS):
    run = lm.integrate(relaxing, method, start, h=0.5, steps=1000)
    entropy = 0.5 * (run.mu**2).sum(axis=1)
    print(
        f"{method.name:17s} energy off by {np.ptp(run.energy):.0e}, entropy "
        f"{entropy[0]:.3f} to {entropy[-1]:.3f}, least growth {np.diff(entropy).min():+.0e}"
    )
    laws.plot(run.t, entropy, color=colour, label=f"S, {method.name}")
    laws.plot(run.t, run.energy, "--", color=colour, label=f"H, {method.name}")
    if colour == lm.plots.COLORS[0]:
        path.plot(*run.mu.T, lw=0.8, color=colour)
u, v = np.mgrid[0.0 : 2.0 * np.pi : 60j, 0.0 : np.pi : 30j]
a = np.sqrt(2.0 * run.energy[0] * np.array(body.inertia))  # half axes of the ellipsoid
surface = a[0] * np.cos(u) * np.sin(v), a[1] * np.sin(u) * np.sin(v), a[2] * np.cos(v)
path.plot_surface(*surface, color="#8a93a3", alpha=0.18, linewidth=0)
path.set(xlabel=r"$\mu_1$", ylabel=r"$\mu_2$", zlabel=r"$\mu_3$", aspect="equal")
path.locator_params(nbins=4)
laws.set(xlabel="time $t$ (s)", ylabel="energy $H$ (J), entropy $S$")
lm.plots.legend(laws)
lm.plots.save(figure, "relaxing_body.png")
