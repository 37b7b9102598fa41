"""A magnetic moment in a turning field: a driven equation on the sphere, with steps of its own choice and events.

The moment x precesses about the field b(t) and creeps towards it: it turns with the velocity A = -b + (x cross b)/5.
"""

import numpy as np

import liemech as lm
from liemech.formulas import cos, cross, sin, vec


@lm.record
class Moment(lm.HomogeneousEquation):
    """A unit vector moved by rotations, with the angular velocity A(t, x)."""

    damping: float = 0.2

    def velocity(self, t, x):
        field = vec(0.5 * cos(0.3 * t), 0.5 * sin(0.3 * t), 1.0)
        return self.damping * cross(x, field) - field


def crossing(t, state):
    return state.x[2]


crossing.direction = 1  # from the southern hemisphere to the northern

moment = Moment(lm.actions.SphereAction(3))
start = moment.state([0.6, 0.0, -0.8])
print("tolerance, steps, their lengths in s; the time over the equator, and the largest |x| - 1")
for rtol in 1e-4, 1e-7, 1e-10:
    plan = lm.Plan(moment, lm.RKMK(order=5), rtol=rtol, atol=rtol, events=crossing)
    run = plan.run(start, t_end=60.0)
    (zeros, points), step = run.events[0], np.diff(run.t)
    off = np.abs(np.linalg.norm(run.at(np.linspace(0.0, 60.0, 601)).x, axis=1) - 1.0).max()
    print(f"{rtol:.0e}: {len(step)}, {min(step):.3f} to {max(step):.3f}; {zeros[0]:.9f}, {off:.0e}")
ax = lm.plots.plot(run, title="round the field, and towards it")
lm.plots.save(ax.figure, "magnetic_moment.png")
