"""Watt's governor: arms on a spindle swing out as it speeds up, and lift a collar on a spring and a damper."""

import numpy as np

import liemech as lm
from liemech import joints as j

y, origin = [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]
ball = [0.03, 0.03, 0.002]  # of an arm of 0.4 m with a ball of 1 kg at its end, in kg m^2
links = [j.Link(1.0, [0.05] * 3), j.Link(1.0, ball), j.Link(1.0, ball), j.Link(2.0, [0.02] * 3)]
joints = [
    j.RevoluteJoint(0, None, name="spindle"),
    j.RevoluteJoint(1, 0, [0.0, 0.0, 0.4], origin, y, y, name="left arm"),
    j.RevoluteJoint(2, 0, [0.0, 0.0, 0.4], origin, y, y, name="right arm"),
    j.PrismaticJoint(3, 0, axis=[0.0, 0.0, 1.0], name="collar"),
    j.RigidRod(1, 3, [0.0, 0.0, 0.1], origin, 0.25),  # from 0.3 m along the arm to the collar
    j.RigidRod(2, 3, [0.0, 0.0, 0.1], origin, 0.25),
]
angle, low = 0.5, -0.3 * np.cos(0.5) - np.sqrt(0.25**2 - (0.3 * np.sin(0.5)) ** 2)
push = lm.PiecewisePolynomial.linear([0.0, 1.0, 4.0, 4.5], [0.0, 1.5, 1.5, 0.0], outside="hold")
forces = [j.Spring("collar", 400.0, low + 0.08), j.Damper("collar", 25.0)]
forces += [j.Motor("spindle", push), j.Damper("spindle", 0.05)]
above, below = np.eye(4), np.eye(4)
above[2, 3], below[2, 3] = 0.2, -0.3
shapes = [j.LinkShape("cylinder", 0, below, [0.03, 0.03, 0.7])]  # what the page shows
shapes += [j.LinkShape("cylinder", b, above, [0.02, 0.02, 0.4]) for b in (1, 2)]
shapes += [j.LinkShape("ball", b, np.eye(4), [0.1] * 3, "#D55E00") for b in (1, 2)]
shapes += [j.LinkShape("cylinder", 3, np.eye(4), [0.12, 0.12, 0.06])]
governor = j.Linkage(links, joints, forces=forces, shapes=shapes)
angles = {"left arm": -angle, "right arm": angle, "collar": low}
start = governor.state(angles=angles, near=governor.poses(np.tile(np.eye(4).ravel(), 4)))
run = lm.integrate(governor, lm.LieRATTLE(), start, h=0.002, steps=5000, every=5)
spindle, collar = run.joint("spindle"), run.joint("collar")
print(f"{spindle.rate.max():.2f} rad/s lift the collar by {1e3 * np.ptp(collar.angle):.0f} mm")
lm.viewer.Scene(run, title="A governor", view=(-70, 10)).save("governor.html")
figure, axs = lm.plots.subplots(2, figsize=(5.2, 3.6), sharex=True)
axs[0].plot(run.t, spindle.rate), axs[0].set(ylabel=r"spindle $\dot\theta$ (rad/s)")
axs[1].plot(run.t, 1e3 * (collar.angle - low)), axs[1].set(ylabel="lift $z$ (mm)", xlabel="$t$ (s)")
lm.plots.save(figure, "governor.png")
