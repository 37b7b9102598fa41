"""Moving pictures in the browser: bodies in space, momenta on their coadjoint orbits, tops,
planets.

    run.view()                                                  # what suits the system; in a notebook it shows itself
    scene = lm.viewer.Scene(run, show=("body", "momentum"))     # only what is asked for exists
    scene.save("body.html")                                     # one file that plays in any browser, without a network
    lm.viewer.animate(body, method, start, show="momentum", h=0.1, steps=1000).show()

The page is written here, around meshcat's file for browsers; its Python side is not used.
"""

from .animate import animate, live
from .contents.body import Body
from .contents.content import Content
from .contents.field import Field
from .contents.links import Links
from .contents.points import Points
from .contents.rods import Rod
from .contents.sites import Sites, Spins
from .contents.vectors import Momentum, SpatialMomentum, Vertical
from .drawing import Drawing
from .live import Live
from .motion import Motion
from .scene import Scene

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
