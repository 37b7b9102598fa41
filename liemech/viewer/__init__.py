"""Moving pictures in the browser: bodies in space, momenta on their coadjoint orbits, tops,
planets.

    run.view()                                                  # what suits the system; in a notebook it shows itself
    scene = lm.viewer.Scene(run, show=("body", "momentum"))     # only what is asked for exists
    scene.save("body.html")                                     # one file that plays in any browser, without a network
    lm.viewer.animate(body, method, start, show="momentum", h=0.1, steps=1000).show()

The page is written here, around meshcat's file for browsers; its Python side is not used.
"""

from .animate import animate, live
from .body import Body
from .content import Content
from .drawing import Drawing
from .field import Field
from .links import Links
from .live import Live
from .motion import Motion
from .points import Points
from .rods import Rod
from .scene import Scene
from .sites import Sites, Spins
from .vectors import Momentum, SpatialMomentum, Vertical

__all__ = [
    "Body",
    "Content",
    "Drawing",
    "Field",
    "Links",
    "Live",
    "Momentum",
    "Motion",
    "Points",
    "Rod",
    "Scene",
    "Sites",
    "SpatialMomentum",
    "Spins",
    "Vertical",
    "animate",
    "live",
]
