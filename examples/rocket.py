"""A rocket burns two thirds of its mass, with a thrust that is a little off its axis: spin steadies it,
and then its speed is Tsiolkovsky's.
"""

import numpy as np

import liemech as lm

K2, BURN, SPEED = lm.vec(0.5, 0.5, 0.05), 2.0, 2000.0  # m^2, kg/s, m/s of the exhaust


@lm.record
class Fuel(lm.DrivenKineticEnergy):
    full: float

    def inertia(self, t):
        m = self.full - BURN * t
        return lm.vec(m * K2[0], m * K2[1], m * K2[2], m, m, m)


@lm.record
class Thrust(lm.Force):
    def covector(self, t, xi, g):  # what leaves takes its momentum along, and pushes
        turn = lm.vec(0.0, 1e-4 * BURN * SPEED, 0.0) - BURN * K2 * xi[:3]
        return lm.vec(*turn, *(lm.vec(0.0, 0.0, BURN * SPEED) - BURN * xi[3:]))


body = lm.DrivenLiePoissonSystem(lm.SE3(), Fuel(150.0))
rocket = lm.MechanicalSystem(body, lm.NoPotential(), load=Thrust())
figure, ax = lm.plots.subplots()
for spin in 0.0, 0.5, 2.0:  # rad/s
    start = rocket.state(mu=[0.0, 0.0, 150.0 * K2[2] * spin, 0.0, 0.0, 0.0], g=np.eye(4))
    run = lm.integrate(rocket, lm.KickDrift(), start, h=0.01, steps=5000, every=10)
    ax.plot(run.g[:, 0, 3] / 1e3, run.g[:, 2, 3] / 1e3, label=f"spin {spin:g} rad/s")
    speed = np.linalg.norm(rocket.velocity(run.mu, run.t)[-1, 3:])
    print(f"spin {spin:g}: {speed:.1f} m/s of Tsiolkovsky's {SPEED * np.log(3.0):.1f}")
ax.set(aspect="equal", adjustable="datalim", xlabel="$x$ (km)", ylabel="$z$ (km)")
lm.plots.legend(ax)
lm.plots.save(figure, "rocket.png")
