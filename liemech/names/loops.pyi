"""Blocks for control loops: what becomes of a command between a controller and `stepper.step`.

lm.loops.RateLimit(rate=2.0, period=0.01, first=[0.0, 0.0, 0.0])
"""

from ..rooms.at_work.command_blocks import FirstOrderHold as FirstOrderHold
from ..rooms.at_work.command_blocks import Latency as Latency
from ..rooms.at_work.command_blocks import Ramp as Ramp
from ..rooms.at_work.command_blocks import RateLimit as RateLimit
from ..rooms.at_work.command_blocks import ZeroOrderHold as ZeroOrderHold
