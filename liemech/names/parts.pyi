"""Parts of an energy whose flow is known by what they are.  One with a flow of your own is a subclass
of `lm.Part`.
"""

from ..systems.parts import FunctionOfCoordinate as FunctionOfCoordinate
from ..systems.parts import StraightLineFlow as StraightLineFlow
