"""Bricard's loop of six hinges along the edges of a cube: it should be stiff, and moves; one condition is dropped."""

import numpy as np

import liemech as lm

e = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # e2 of the cube is upwards
edges = np.concatenate([e, -e])  # five rods of 1 m and 1 kg, and the ground
corners = np.concatenate([np.zeros((1, 3)), np.cumsum(edges, axis=0)])
axes = [np.cross(edges[k - 1], edges[k]) for k in range(6)]  # of the hinges, at the corners
turns = [np.transpose([np.cross(axes[k], edges[k]), axes[k], edges[k]]) for k in range(5)]
half, joints = np.array([0.0, 0.0, 0.5]), []  # rods lie along e3 of their frames
for k in range(5):
    seen = corners[0], axes[0]  # by the ground, of the point and the axis
    if k > 0:
        seen = half, turns[k - 1].T @ axes[k]
    ends = -half, seen[0], turns[k].T @ axes[k], seen[1]
    joints += [lm.joints.RevoluteJoint(k, k - 1 if k else None, *ends, name=f"hinge {k + 1}")]
ends = half, corners[5], turns[4].T @ axes[5], axes[5]
joints += [lm.joints.RevoluteJoint(4, None, *ends, name="hinge 6")]
poses = np.tile(np.eye(4), (5, 1, 1))
poses[:, :3, :3], poses[:, :3, 3] = turns, corners[:5] + 0.5 * edges[:5]
loop = lm.joints.Linkage([lm.joints.Link.rod(1.0, 1.0, 0.03)] * 5, joints).independent(poses)
print("conditions that follow from the others:", *loop.dropped)
run = lm.integrate(loop, lm.LieRATTLE(), loop.assembled(poses), h=0.001, steps=3000, every=10)
print(run.drift())
lm.viewer.Scene(run, title="Bricard's loop", view=(-50, 20)).save("bricard.html")
moved = loop.poses(run.g)
ends = moved[:, :, None, :3, 3] + moved[:, :, None, :3, 2] * [[-0.5], [0.5]]
figure, axs = lm.plots.subplots(1, 4, figsize=(8.4, 2.4), sharex=True, sharey=True)
for ax, frame in zip(axs, (0, 40, 60, 80)):
    shown = ends[frame] @ np.transpose([[0.8, 0.6, 0.0], [-0.24, 0.32, 0.92]])  # from aside
    ax.plot(*shown.T, "-", linewidth=2)
    ax.plot(*shown[[0, -1], [0, 1]].T, "k:")
    ax.set(aspect="equal", title=f"$t$ = {run.t[frame]:.1f} s", xlabel="across (m)")
axs[0].set_ylabel("up (m)")
lm.plots.save(figure, "bricard.png")
