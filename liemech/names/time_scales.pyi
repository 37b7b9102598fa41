"""Time scales that are ready: how much time a unit of fictive time takes.  One of your own is a
subclass of `lm.TimeScale`, or a function.
"""

from ..rooms.fictive_time.time_scales import DistancePower as DistancePower
from ..rooms.fictive_time.time_scales import EqualArc as EqualArc
from ..rooms.fictive_time.time_scales import EqualChange as EqualChange
from ..rooms.fictive_time.time_scales import EqualPath as EqualPath
