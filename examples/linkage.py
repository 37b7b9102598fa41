"""A four-bar linkage: a crank turns, a rocker swings, a point of the coupler draws its curve; the joints hold to rounding."""

import numpy as np

import liemech as lm

# crank, coupler, rocker: their lengths in m, and their ends at the start, by eye
lengths, turn = np.array([0.3, 0.9, 0.7]), np.array([0.0, 1.0, 0.0])
ends = np.array([[0.0, 0.0, 0.0], [0.15, 0.0, 0.26], [0.94, 0.0, 0.70], [1.0, 0.0, 0.0]])
low, high = np.outer(lengths, [0.0, 0.0, -0.5]), np.outer(lengths, [0.0, 0.0, 0.5])  # along e3
linkage = lm.joints.Linkage(
    [lm.joints.Link.rod(mass=length, length=length, radius=0.02) for length in lengths],
    [
        lm.joints.RevoluteJoint(0, None, low[0], ends[0], turn, turn),
        lm.joints.BallJoint(0, 1, high[0], low[1]),
        lm.joints.UniversalJoint(1, 2, high[1], low[2], [1.0, 0.0, 0.0], turn),
        lm.joints.RevoluteJoint(2, None, high[2], ends[3], turn, turn),
    ],
)
poses = np.tile(np.eye(4), (3, 1, 1))
poses[:, :3, 3] = (ends[1:] + ends[:-1]) / 2
for pose, d in zip(poses, np.diff(ends, axis=0)):
    d /= np.linalg.norm(d)
    pose[:3, :3] = np.transpose([np.cross(turn, d), turn, d])
start = linkage.assembled(poses, [[0.0, -60.0, 0.0, 0.0, 0.0, 0.0], np.zeros(6), np.zeros(6)])
run = lm.integrate(linkage, lm.LieRATTLE(), start, h=0.01, steps=150)
misses = [linkage.conditions_at(mu, g) for mu, g in zip(run.mu[::10], run.g[::10])]
print(run.drift())
print(f"largest miss of the joints: {np.abs(misses).max():.0e} (m, m/s)")
moved = linkage.poses(run.g)
figure, ax = lm.plots.subplots()
for length, rod, color in zip(lengths, moved[::10].swapaxes(0, 1), lm.plots.COLORS[:3]):
    both = rod[:, :3, 3, None] + rod[:, :3, 2, None] * [-length / 2, length / 2]
    ax.plot(both[:, 0].T, both[:, 2].T, "-", color=color, alpha=0.25, linewidth=1)
    ax.plot(both[-1, 0], both[-1, 2], "o-", color=color, linewidth=3)  # at the end
ax.plot(*(moved[:, 1, (0, 2), 3] + 0.25 * moved[:, 1, (0, 2), 0]).T, "-", color="#1a1a1a")
ax.set(aspect="equal", xlabel="$x$ (m)", ylabel="$z$ (m)")
lm.plots.save(figure, "linkage.png")
