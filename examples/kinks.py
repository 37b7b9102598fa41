"""Kinks of the sine-Gordon field, a line of pendulums: two meet, and are ahead of where each would be alone."""

import numpy as np

import liemech as lm


@lm.record
class Weight(lm.Potential):
    def energy(self, u):
        return 1.0 - lm.formulas.cos(u[0])


one = lm.KineticEnergy([1.0])
density = lm.FieldDensity(kinetic=one, stored=one)  # (u_t^2 - u_s^2)/2
line = lm.Field(lm.VectorSpace(1), density, length=60.0, cells=600, acting=(Weight(),))
v, s, h = 0.6, line.arc - 30.0, 0.5 * line.largest_step
gamma = 1.0 / np.sqrt(1.0 - v**2)


def exact(t):
    return 4.0 * np.arctan(v * np.sinh(gamma * s) / np.cosh(gamma * v * t))


rates = (exact(-30.0 + 1e-4) - exact(-30.0 - 1e-4)) / 2e-4
start = line.state(xi=rates[:, None], g=exact(-30.0)[:, None])
steps = round(60.0 / h)
run = lm.integrate(line, lm.KickDrift(), start, h=h, steps=steps, every=4, t0=-30.0)
places = [np.interp(np.pi, u[:, 0], s) for u in run.g[[0, -1]]]  # of the kink at u = pi
print(f"the longest stable step is {line.largest_step:.3g}; steps are {h:.3g}")
print(f"the field is {np.abs(run.g[-1, :, 0] - exact(30.0)).max():.1e} from the closed form")
shift = 2.0 * np.log(1.0 / v) / gamma
print(f"each kink is {sum(places) - 60.0 * v:.2f} ahead, {shift:.2f} in closed form")
print(run.drift())

ax = lm.plots.space_time(run, line.strains(run.g)[..., 0], label="slope $u_s$")
lm.plots.save(ax.figure, "kinks.png")
