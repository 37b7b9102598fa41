"""Poisson structures that are ready.  One of your own is a subclass of `lm.PoissonStructure`."""

from ..groups.poisson_structure import Canonical as Canonical
from ..groups.poisson_structure import ConstantStructure as ConstantStructure
from ..groups.poisson_structure import LiePoissonStructure as LiePoissonStructure
from ..groups.poisson_structure import LogCanonical as LogCanonical
from ..rooms.poisson.local_coordinates import InducedStructure as InducedStructure
