"""A group of one's own from its generators: free motion on the Heisenberg group is that of a charge in a magnetic field."""

import numpy as np

import liemech as lm


@lm.record
class Heisenberg(lm.MatrixLieGroup):
    """The matrices [[1, x, z], [0, 1, y], [0, 0, 1]]: planar motions that remember the area they enclose, z' = x y' + ..."""

    @property
    def generators(self):
        x, y, z = np.zeros((3, 3, 3))
        x[0, 1] = y[1, 2] = z[0, 2] = 1.0
        return x, y, z


group = Heisenberg()
print(str(lm.check_group(group, native=True)).splitlines()[0])
# H = |p|^2/2: p_3, which commutes with all, is the field; (p_1, p_2) turns in it with the cyclotron frequency p_3.
charge = lm.LiePoissonSystem(group, lm.KineticEnergy([1.0, 1.0, 1.0]))
figure, (left, right) = lm.plots.subplots(1, 2, figsize=(7.6, 3.6))
for field in 0.5, 1.0, 2.0:
    start = charge.state(mu=[1.0, 0.0, field], g=np.eye(3))
    turn = 2.0 * np.pi / field
    run = lm.integrate(charge, lm.RKMK(order=4), start, h=turn / 4000, steps=4000)
    x, y, z = run.g[:, 0, 1], run.g[:, 1, 2], run.g[:, 0, 2]
    radius, area = (x.max() - x.min()) / 2.0, z[-1] - field * turn
    back = np.hypot(x[-1], y[-1])
    print(
        f"field {field}: radius {radius:.6f}, back after a turn to {back:.0e}, the area {area:.6f}"
    )
    print(f"is remembered, pi r^2 = {np.pi * radius**2:.6f}, compiled: {run.compiled}")
    left.plot(x, y)
    right.plot(run.t / turn, z - field * run.t, label=f"field {field}")
left.set(aspect="equal", xlabel="$x$", ylabel="$y$")
right.set(xlabel="turns", ylabel="area remembered, $z - p_3 t$"), lm.plots.legend(right)
lm.plots.save(figure, "heisenberg.png")
