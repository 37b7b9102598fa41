from .systems.parts import FunctionOfCoordinate as FunctionOfCoordinate
from .systems.parts import StraightLineFlow as StraightLineFlow
