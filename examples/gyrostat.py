"""A spinning rotor steadies a body's unstable middle axis: a Hamiltonian of one's own, compiled
like a built-in one.
"""

import numpy as np

import liemech as lm


@lm.record
class Gyrostat(lm.Hamiltonian):
    """A body with a rotor of constant momentum r about a body axis: H(mu) = (mu - r).J^-1
    (mu - r)/2.
    """

    inertia: lm.Vec
    rotor: lm.Vec

    def energy(self, mu):
        return 0.5 * lm.dot(mu - self.rotor, self.gradient(mu))

    def gradient(self, mu):
        return (mu - self.rotor) / self.inertia


for r in 0.0, 0.2, 0.4, 0.6, 0.8:
    system = lm.LiePoissonSystem(lm.SO3(), Gyrostat([1.0, 2.0, 3.0], [0.0, r, 0.0]))
    start = system.state(mu=[0.01, 1.0, 0.0])
    run = lm.integrate(system, lm.RKMK(order=4), start, h=0.05, steps=10_000)
    tilt = np.degrees(np.arccos(run.mu[:, 1] / np.linalg.norm(run.mu, axis=1)))
    print(f"rotor {r:.1f} kg m^2/s: the middle axis swings out to {tilt.max():5.1f} degrees")
    if r == 0.2:  # a body of one's own has its curves of constant energy too
        ax = lm.plots.momentum_sphere(run.mu, system=system, title=f"a rotor of {r} kg m$^2$/s")
lm.plots.save(ax.figure, "gyrostat.png")
