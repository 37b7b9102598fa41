"""Henon and Heiles' galaxy cut by a surface: some stars draw curves, others of the same energy fill
an area.
"""

import numpy as np

import liemech as lm

galaxy = lm.models.HenonHeiles()
energy, y = 1 / 8, np.array([0.0, 0.1, 0.2, 0.3, -0.1, -0.2])
# all of them start at x = 0 with this energy
push = np.sqrt(2.0 * energy - y**2 + 2.0 / 3.0 * y**3)
starts = galaxy.state(q=np.stack([0.0 * y, y], axis=1), p=np.stack([push, 0.0 * y], axis=1))
run = lm.integrate(galaxy, lm.Splitting(order=6), starts, h=0.1, steps=30_000)

q, p, star = lm.plots.section(run, coordinate=0)
print(run.drift())
for k, start in enumerate(y):
    own = q[star == k, 1]
    print(
        f"a star from y = {start:+.1f}: {len(own)} crossings of x = 0, at y between "
        f"{own.min():+.3f} and {own.max():+.3f}"
    )
ax = lm.plots.poincare_section(run, coordinate=0, shown=1, title="energy 1/8, section $x = 0$")
lm.plots.save(ax.figure, "chaos_in_a_galaxy.png")
