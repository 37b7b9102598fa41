"""Group actions and representations that are ready.  One of your own is a subclass of
`lm.GroupAction`.
"""

from ..groups.actions import LeftMultiplication as LeftMultiplication
from ..groups.actions import LinearAction as LinearAction
from ..groups.actions import SphereAction as SphereAction
from ..groups.actions import TranslationAction as TranslationAction
from ..groups.coadjoint import CoadjointAction as CoadjointAction
from ..groups.representations import AdjointAction as AdjointAction
from ..groups.representations import Representation as Representation
from ..groups.representations import RotationAction as RotationAction
