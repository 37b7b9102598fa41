"""Two rods hang one from another by ball joints: the page shows them to scale, with the path of the
lower one.
"""

import numpy as np

import liemech as lm

rods = lm.joints.chain(2)
poses, top = np.tile(np.eye(4), (2, 1, 1)), np.zeros(3)
for pose, turn in zip(poses, ([1.2, 0.0, 0.0], [0.4, 0.9, 0.0])):
    pose[:3, :3] = lm.SO3().exp(turn)
    pose[:3, 3] = top - 0.5 * pose[:3, 2]
    top = top - pose[:3, 2]
# the lower one turns about itself, rad/s
spin = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 15.0, 0.0, 0.0, 0.0]
run = lm.integrate(
    rods, lm.LieRATTLE(), rods.assembled(poses, spin), h=0.02, steps=60, compiled=False
)
print(run.drift())

ends = (
    rods.poses(run.g)[:, 0, :3] @ [0.0, 0.0, -0.5, 1.0],
    rods.poses(run.g)[:, 1, :3] @ [0.0, 0.0, 0.5, 1.0],
)
print(f"the rods stay together to {np.abs(ends[0] - ends[1]).max():.0e} m")
scene = lm.viewer.Scene(run, show="links", title="Two hanging rods", seconds=8.0)
print(scene.save("linkage.html"))
ax = lm.plots.path(run, title="the centres of two rods, and their shadows")
lm.plots.save(ax.figure, "linkage_in_the_browser.png")
