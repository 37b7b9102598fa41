"""Two hundred bodies, spun almost alike, on one momentum sphere as a page: how a cloud is drawn out
along the curves of energy.
"""

import numpy as np

import liemech as lm

body = lm.RigidBody([1.0, 1.5, 2.0])
rng = np.random.default_rng(1)
momenta = [0.5, 0.0, 0.75**0.5] + 0.08 * rng.normal(size=(200, 3))
momenta /= np.linalg.norm(momenta, axis=1, keepdims=True)

# records the momenta, and as many of them as the page will show; there is no attitude, so none is
# computed
scene = lm.viewer.animate(
    body,
    lm.RKMK(order=4),
    body.state(mu=momenta),
    "momentum",
    h=0.1,
    steps=1500,
    frames=300,
    title="200 bodies",
)
run = scene.runs[0]
for t, mu in zip(run.t[::60], run.mu[::60]):
    print(f"t = {t:5.1f} s   length of the mean momentum {np.linalg.norm(mu.mean(axis=0)):.3f}")
print(scene.save("ensemble.html", compressed=True))
lm.plots.save(
    lm.plots.cloud(run, title="200 bodies, drawn out").figure, "ensemble_in_the_browser.png"
)
