"""Two vortices of an easy-plane magnet on a square lattice, as a page: they circle round each other,
and send out spin waves as they go.
"""

import numpy as np

import liemech as lm


@lm.record
class Exchange(lm.Term):
    """The exchange energy of two neighbours, weaker for the components out of the plane."""

    out_of_plane: float

    def energy(self, a, b):
        return -lm.dot(a.mu[:2], b.mu[:2]) - self.out_of_plane * a.mu[2] * b.mu[2]


lattice = lm.neighbours.square(36, 36, periodic=False)
energy = lm.Terms(Exchange(0.85).over(lattice))
spins = lm.LiePoissonSystem(lm.SO3() ** lattice.sites, energy)

# in the plane, under the sum of the angles at which the two centres see a site; near them upwards
x, y = lattice.layout[:, :2].T - 17.6
angle = np.arctan2(y, x - 5.2) + np.arctan2(y, x + 5.2)
up = np.minimum(1.0, sum(np.exp(-np.hypot(x - c, y) / 1.8) for c in (-5.2, 5.2)))
across = np.sqrt(1.0 - up**2)
start = spins.state(mu=np.stack([across * np.cos(angle), across * np.sin(angle), up], axis=-1))
run = lm.integrate(spins, lm.SublatticeSplitting(order=4), start, h=0.1, steps=4000, every=16)
for t, mu in zip(run.t[::50], run.mu[::50]):
    first = np.argmax(mu[:, 2])
    print(f"t = {t:5.1f}   a centre at x, y = {x[first]:5.1f}, {y[first]:5.1f}")
print(f"energy {run.drift()['energy'].verdict}")

along_x = lm.viewer.Spins(axis=[1.0, 0.0, 0.0])
print(lm.viewer.Scene(run, along_x, title="Two vortices", seconds=20.0).save("spins.html"))
ax = lm.plots.spins(run, 125, axis=[1.0, 0.0, 0.0])
lm.plots.save(ax.figure, "spins_in_the_browser.png")
