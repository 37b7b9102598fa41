"""Systems that are ready: bodies, tops, pendulums, planets, charges, lattices, and the fields that
they are in.

    lm.models.HeavyTop([1.0, 1.5, 0.7], 1.3, centre=[0.6, 0.0, 0.8])

`RigidBody`, `SphericalPendulum` and `Kepler` are `lm.RigidBody` and so on.

    bodies/, swinging/     rigid bodies and tops; pendulums, points on surfaces
    planets/, space/       points that attract each other; spacecraft and what acts on them
    lattices/, many/       Poisson and isospectral systems; rods, water, many bodies
    charged_particle.py    charges in magnetic fields
    input_checks.py        parameters; starts and times of exact motions
    poses.py, curves.py, even_boxes.py    what pictures ask: where bodies are, from where curves are seen, boxes by inertia
"""

from ..names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
