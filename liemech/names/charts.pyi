"""Coordinates: canonical ones of Poisson structures, local ones of submanifolds, and changes between
canonical ones.
"""

from ..rooms.poisson.canonical_transformation import CanonicalTransformation as CanonicalTransformation
from ..rooms.poisson.darboux import Andoyer as Andoyer
from ..rooms.poisson.darboux import DarbouxChart as DarbouxChart
from ..rooms.poisson.darboux import InDarbouxChart as InDarbouxChart
from ..rooms.poisson.darboux import LinearDarboux as LinearDarboux
from ..rooms.poisson.darboux import LogarithmicDarboux as LogarithmicDarboux
from ..rooms.poisson.darboux_lie import DarbouxLieChart as DarbouxLieChart
from ..rooms.poisson.local_coordinates import LocalChart as LocalChart
from ..rooms.poisson.local_coordinates import in_coordinates as in_coordinates
