"""Systems that are ready: bodies, tops, pendulums, planets, charges, lattices, and the fields that
they are in.

    lm.models.HeavyTop([1.0, 1.5, 0.7], 1.3, centre=[0.6, 0.0, 0.8])

`RigidBody`, `SphericalPendulum` and `Kepler` are `lm.RigidBody` and so on.
"""

from ..names import lazily

__getattr__, __dir__, __all__ = lazily(__name__)
