from .systems.time_scales import DistancePower as DistancePower
from .systems.time_scales import EqualArc as EqualArc
from .systems.time_scales import EqualChange as EqualChange
from .systems.time_scales import EqualPath as EqualPath
