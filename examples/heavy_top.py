"""A heavy top: kicks and drifts keep the vertical momentum, and the energy does not drift; RKMK4
loses both, slowly.
"""

import numpy as np

import liemech as lm

top = lm.models.HeavyTop(inertia=[1.0, 1.5, 0.7], weight=1.3, centre=[0.6, 0.0, 0.8])
start = top.state(mu=[0.3, 0.6, 1.1], g=lm.SO3().exp([0.4, -0.3, 0.5]))

runs = {}
for method in lm.LieVerlet(), lm.LieVerlet(lm.Cayley()), lm.KickDrift(order=4), lm.RKMK(order=4):
    run = runs[method.name] = lm.integrate(top, method, start, h=0.1, steps=20_000, every=10)
    print(method.name, run.drift(), "", sep="\n")

# how the nose of the top moves, one step after another
run = lm.integrate(top, lm.KickDrift(order=6), start, h=0.1, steps=60, every=10)
for t, height in zip(run.t, run.g[:, 2] @ np.array(top.centre)):
    print(f"t = {t:3.0f} s: centre of mass {height:+.3f} m above the fixed point")
lm.plots.save(
    lm.plots.drift(runs, "vertical momentum", title="a heavy top").figure, "heavy_top.png"
)
