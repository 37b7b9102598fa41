"""A net of rods on ball joints, held at two opposite corners, falls; its sixteen meshes are closed loops."""

import numpy as np

import liemech as lm
from liemech.joints import BallJoint, Link, Linkage

n = 5  # knots along a side
knots = [(i, j) for i in range(n) for j in range(n)]
rods = [(a, (a[0] + 1, a[1])) for a in knots if a[0] < n - 1]
rods += [(a, (a[0], a[1] + 1)) for a in knots if a[1] < n - 1]
ends = [0.0, 0.0, 0.5], [0.0, 0.0, -0.5]
joints, poses = [], np.tile(np.eye(4), (len(rods), 1, 1))
for pose, (a, b) in zip(poses, np.array(rods, dtype=float)):
    along = np.append(a - b, 0.0)
    pose[:3, :3] = np.transpose([np.cross([0.0, 0.0, 1.0], along), [0.0, 0.0, 1.0], along])
    pose[:2, 3] = 0.5 * (a + b)
for knot in knots:
    here = [(r, ends[knot == rod[1]]) for r, rod in enumerate(rods) if knot in rod]
    for r, end in here[1:]:
        joints.append(BallJoint(r, here[0][0], end, here[0][1]))
    if knot in (knots[0], knots[-1]):
        joints.append(BallJoint(here[0][0], None, here[0][1], [*map(float, knot), 0.0]))
net = Linkage([Link.rod(0.1, 1.0, 0.02)] * len(rods), joints)
start = net.assembled(poses)
run = lm.integrate(net, lm.LieRATTLE(), start, h=0.002, steps=600, every=200)
figure, axes = lm.plots.subplots(1, 4, figsize=(11, 3), subplot_kw={"projection": "3d"})
for axis, t, g in zip(axes, run.t, run.g):
    for pose in net.poses(g):
        tips = [pose[:3, 3] + s * pose[:3, 2] for s in (0.5, -0.5)]
        axis.plot(*np.transpose(tips), color=lm.plots.COLORS[0], linewidth=1)
    axis.plot([0, 4], [0, 4], [0, 0], "o", color=lm.plots.COLORS[1], markersize=4)  # held
    axis.set(title=f"t = {t:.1f} s", xlim=(0, 4), ylim=(0, 4), zlim=(-3, 1))
    axis.set_box_aspect((1, 1, 1), zoom=1.15), axis.set_axis_off()
c = net.conditions_at(run.mu[-1], run.g[-1])[0]
print(f"{len(rods)} rods, {len(joints)} joints; conditions to {np.abs(c).max():.0e} m")
print(f"energy to {np.ptp(run.energy) / 20:.0e} J of 20 J that fell")
lm.plots.save(figure, "net.png")
