"""A four-bar linkage: a crank turns, a rocker swings, a point of the coupler draws its curve; the joints hold to rounding."""

import matplotlib.pyplot as plt
import numpy as np

import liemech as lm

crank, coupler, rocker, ground = 0.3, 0.9, 0.7, 1.0  # lengths in m
turn, left, right = [0.0, 1.0, 0.0], [-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]  # rods lie along e1 of their bodies
rods = [lm.Link(length, np.array([1e-3, 1 / 12, 1 / 12]) * length**3) for length in (crank, coupler, rocker)]
linkage = lm.Linkage(
    rods,
    [
        lm.RevoluteJoint(0, None, np.multiply(left, crank), [0.0, 0.0, 0.0], turn, turn),
        lm.BallJoint(0, 1, np.multiply(right, crank), np.multiply(left, coupler)),
        lm.UniversalJoint(1, 2, np.multiply(right, coupler), np.multiply(right, rocker), [0.0, 0.0, 1.0], turn),
        lm.RevoluteJoint(2, None, np.multiply(left, rocker), [ground, 0.0, 0.0], turn, turn),
    ],
)

# the crank at 60 degrees, and where two circles meet; `assembled` does the rest, velocities included
a = np.array([0.5 * crank, 0.0, np.sqrt(0.75) * crank])
b = np.array([ground, 0.0, 0.0]) - a
distance, along = np.linalg.norm(b), b / np.linalg.norm(b)
s = (coupler**2 - rocker**2 + distance**2) / (2 * distance)
c = a + s * along + np.sqrt(coupler**2 - s**2) * np.array([-along[2], 0.0, along[0]])
poses = np.tile(np.eye(4), (3, 1, 1))
for pose, (p, q) in zip(poses, ((np.zeros(3), a), (a, c), (np.array([ground, 0.0, 0.0]), c))):
    d = (q - p) / np.linalg.norm(q - p)
    pose[:3, :3], pose[:3, 3] = np.transpose([d, turn, np.cross(d, turn)]), (p + q) / 2
velocities = np.zeros((3, 6))
velocities[0, 1] = -40.0
start = linkage.assembled(poses, velocities)

# some seconds in plain Python; native code for so many joints takes longer to make than this run
run = lm.integrate(linkage, lm.LieRATTLE(), start, h=0.01, steps=150, compiled=False)
misses = np.abs([linkage.conditions_at(mu, g) for mu, g in zip(run.mu[::10], run.g[::10])])
print(run.drift())
print(f"largest miss of the joints: {misses.max():.0e} (m, m/s)")

figure, (picture, energy) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
moved = linkage.poses(run.g)
for k in range(0, 120, 10):
    for pose, length in zip(moved[k], (crank, coupler, rocker)):
        ends = pose[:3, 3] + np.outer([-length / 2, length / 2], pose[:3, 0])
        picture.plot(ends[:, 0], ends[:, 2], color="C0", alpha=0.2 + 0.6 * k / 120, linewidth=1)
drawn = moved[:, 1, :3, 3] + 0.25 * moved[:, 1, :3, 2]
picture.plot(drawn[:, 0], drawn[:, 2], color="C3")
picture.set(aspect="equal", xlabel="x / m", ylabel="z / m", title="crank, coupler, rocker; a curve of the coupler")
energy.plot(run.t, run.energy / run.energy[0] - 1.0)
energy.set(xlabel="t / s", ylabel="relative error", title="energy, h = 10 ms")
figure.savefig("linkage.png", dpi=110)
print("linkage.png")
