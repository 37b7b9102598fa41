"""A heavy top as a page: its nose draws loops, waves or cusps, by how it was let go; beside it the
vertical seen from the top.
"""

import numpy as np

import liemech as lm

top = lm.models.LagrangeTop(weight=1.0, transverse=1.0, axial=0.6, length=0.8)
tilted = lm.SO3().exp([0.6, 0.0, 0.0])
scene = lm.viewer.Scene(title="Nutation of a heavy top")

for name, precession in (
    ("let go at rest: cusps", 0.0),
    ("pushed forwards: waves", 0.18),
    ("pushed backwards: loops", -0.25),
):
    spin = np.array([0.0, 0.0, 2.6])  # about its own axis, kg m^2/s
    # an angular velocity about the vertical, seen from the top
    pushed = tilted.T @ np.array([0.0, 0.0, precession])
    start = top.state(mu=spin + np.array([1.0, 1.0, 0.0]) * pushed, g=tilted)
    run = lm.integrate(top, lm.KickDrift(order=4), start, h=0.1, steps=350)
    height = run.g[:, 2, 2]
    print(
        f"{name:<26} nose between {height.min():.3f} and {height.max():.3f}, energy "
        f"{run.drift()['energy'].verdict}"
    )
    scene.add(run, show="body", name=name)

print(scene.save("top.html"))
ax = lm.plots.vertical(run, title="the vertical, seen from the top")
lm.plots.save(ax.figure, "top_in_the_browser.png")
