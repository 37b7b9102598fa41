from .simulation.at_work.command_blocks import FirstOrderHold as FirstOrderHold
from .simulation.at_work.command_blocks import Latency as Latency
from .simulation.at_work.command_blocks import RateLimit as RateLimit
from .simulation.at_work.command_blocks import ZeroOrderHold as ZeroOrderHold
from .systems.ramp import Ramp as Ramp
