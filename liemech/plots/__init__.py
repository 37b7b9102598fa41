"""Pictures of runs, by Matplotlib, which is loaded by the first of them.

    run.plot()                                              # what tells most about this run
    ax = lm.plots.drift({"RKMK4": one, "Cayley": other})    # who loses energy, and how
    lm.plots.save(ax.figure, "drift.png")

Every picture takes `ax=`, plane axes to draw on, and returns the axes; without them it makes a
figure that no window system knows of. Nothing touches Matplotlib's settings.
"""

from ..rooms.at_work.measured_orders import order_of
from .attitude import euler_angles, quaternion
from .choice import plot
from .components import components
from .field import field
from .figure_one import Panel, figure_one
from .invariants import drift, invariants
from .orders import orders, work_precision
from .path import path
from .phase import phase_portrait
from .poincare import poincare_section, section
from .polhode import herpolhode, herpolhode_points, polhode
from .space_time import space_time
from .spheres.cloud import cloud
from .spheres.energy_curves import energy_levels, principal_moments, separatrix
from .spheres.projection import VIEW, split_at_horizon, view_frame
from .spheres.sphere import momentum_sphere
from .spins import spins
from .style import COLORS, DIRECTIONS, MOST_DOTS, legend, save, subplots
from .vertical import vertical

__all__ = [
    "COLORS",
    "DIRECTIONS",
    "MOST_DOTS",
    "VIEW",
    "Panel",
    "cloud",
    "components",
    "drift",
    "energy_levels",
    "euler_angles",
    "field",
    "figure_one",
    "herpolhode",
    "herpolhode_points",
    "invariants",
    "legend",
    "momentum_sphere",
    "order_of",
    "orders",
    "path",
    "phase_portrait",
    "plot",
    "poincare_section",
    "polhode",
    "principal_moments",
    "quaternion",
    "save",
    "section",
    "separatrix",
    "space_time",
    "spins",
    "split_at_horizon",
    "subplots",
    "vertical",
    "view_frame",
    "work_precision",
]
