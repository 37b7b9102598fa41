"""Poinsot's ellipsoid rolls on a plane: the angular velocity draws the polhode on the one and the
herpolhode on the other.
"""

import numpy as np

import liemech as lm

# product moments: axes of its own
body = lm.RigidBody([[1.0, 0.2, 0.1], [0.2, 1.4, -0.3], [0.1, -0.3, 1.9]])
start = body.state(mu=[0.3, 0.8, 0.5], g=np.eye(3))
run = lm.integrate(body, lm.LiePoissonHamiltonJacobi(order=4), start, h=0.1, steps=800)

# height of the plane
along = np.einsum("ni,ni->n", body.velocity(run.mu), run.mu) / np.linalg.norm(run.mu, axis=1)
print(
    f"the plane stands still to {np.ptp(along):.1e} rad/s; across it the angular velocity is",
    end=" ",
)
across = np.linalg.norm(lm.plots.herpolhode_points(run), axis=1)
print(f"between {across.min():.3f} and {across.max():.3f} rad/s")

lm.plots.save(lm.plots.polhode(run, title="polhode").figure, "polhode.png")
lm.plots.save(lm.plots.herpolhode(run, title="herpolhode").figure, "herpolhode.png")
