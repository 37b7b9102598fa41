"""Dzhanibekov's flip as a page: a body spun about its middle axis turns over, while its momentum in
space stands still.

On the sphere the momentum runs along the separatrix, from one unstable pole to the other.
"""

import numpy as np

import liemech as lm

body = lm.RigidBody([1.0, 2.0, 3.0])
start = body.state(mu=[0.01, 1.0, 0.01], g=np.eye(3))
t = np.linspace(0.0, 2.0 * body.period(start), 1200)
exact = lm.viewer.Motion(body, t, body.exact(start, t))  # closed form: no steps at all

scene = lm.viewer.Scene(exact, title="Dzhanibekov's flip", seconds=15.0)
page = scene.save("flip.html")  # scene.show() would open it
print(
    f"{page}: two periods of {body.period(start):.2f} s, four flips, "
    f"{page.stat().st_size / 1e6:.2f} MB"
)
lm.plots.save(lm.plots.plot(exact).figure, "flip_in_the_browser.png")
