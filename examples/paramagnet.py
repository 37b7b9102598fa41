"""Spins in a field and a heat bath, on their spheres: their mean is Langevin's function of B/T."""

import numpy as np

import liemech as lm


@lm.record
class Field(lm.Hamiltonian):
    """A spin in a field along z, H(mu) = -B mu_z."""

    strength: float

    def energy(self, mu):
        return -self.strength * mu[2]


spins, fields = 4000, np.array([0.05, 0.1, 0.2, 0.3, 0.5, 0.8])
up, error = [], []
for k, B in enumerate(fields):
    spin = lm.LiePoissonSystem(lm.SO3(), Field(B))
    bath = lm.thermal_bath(spin, damping=1.0, temperature=0.1, seed=k)
    start = bath.state([[1.0, 0.0, 0.0]] * spins)
    run = lm.integrate(bath, lm.WongZakai(), start, h=0.05, steps=1200, every=20)
    mean = run.mu[20:, :, 2].mean(axis=0)  # of each spin, when the start is forgotten
    up, error = [*up, mean.mean()], [*error, mean.std() / spins**0.5]
exact = 1.0 / np.tanh(fields / 0.1) - 0.1 / fields
off = np.abs(np.array(up) - exact) / error
print(f"mean of mu_z beside Langevin's function: off by at most {off.max():.1f} standard errors")
x = np.linspace(0.01, 9.0, 200)
figure, ax = lm.plots.subplots(figsize=(6.4, 4.0))
ax.plot(x, 1.0 / np.tanh(x) - 1.0 / x, color="0.4", label=r"$\coth x - 1/x$")
ax.errorbar(fields / 0.1, up, 3.0 * np.array(error), fmt="o", label=f"{spins} spins, 3 errors")
ax.set(xlabel="$x = B/T$", ylabel=r"mean of $\mu_z$", title="a paramagnet")
lm.plots.legend(ax, loc="lower right")
lm.plots.save(figure, "paramagnet.png")
