"""Kinks of the sine-Gordon field, a line of pendulums: two meet, and are ahead of where each would be alone."""

import numpy as np

import liemech as lm


@lm.record
class Weight(lm.Potential):
    """What a pendulum weighs, 1 - cos u, in a unit of length."""

    def energy(self, u):
        return 1.0 - lm.formulas.cos(u[0])


one = lm.KineticEnergy([1.0])
density = lm.FieldDensity(kinetic=one, stored=one)  # (u_t^2 - u_s^2)/2
line = lm.Field(lm.VectorSpace(1), density, length=60.0, cells=600, acting=(Weight(),))

v = 0.6
gamma = 1.0 / np.sqrt(1.0 - v**2)
s = line.arc - 30.0


def exact(t):
    """Two kinks that meet at t = 0."""
    return 4.0 * np.arctan(v * np.sinh(gamma * s) / np.cosh(gamma * v * t))


t0, h = -30.0, 0.5 * line.largest_step
rates = (exact(t0 + 1e-4) - exact(t0 - 1e-4)) / 2e-4
start = line.state(xi=rates[:, None], g=exact(t0)[:, None])
steps = round(60.0 / h)
run = lm.integrate(line, lm.KickDrift(), start, h=h, steps=steps, every=4, t0=t0)
there, back = (np.interp(np.pi, run.g[i, :, 0], s) for i in (0, -1))  # of the kink at u = pi
print(f"the longest stable step is {line.largest_step:.3g}; steps are {h:.3g}")
print(f"the field is {np.abs(run.g[-1, :, 0] - exact(run.t[-1])).max():.1e} from the closed form")
print(
    f"each kink is {there + back - 60.0 * v:.2f} ahead, {2.0 * np.log(1.0 / v) / gamma:.2f} in closed form"
)
print(run.drift())

slopes = line.strains(run.g)[..., 0]
ax = lm.plots.space_time(run, slopes, label="slope $u_s$")
lm.plots.save(ax.figure, "kinks.png")
