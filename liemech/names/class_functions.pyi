"""Functions on a group that are constant on conjugacy classes: what generating functions of the first
kind start from.
"""

from ..rooms.hamilton_jacobi.class_functions import CayleySquare as CayleySquare
from ..rooms.hamilton_jacobi.class_functions import ClassFunction as ClassFunction
from ..rooms.hamilton_jacobi.class_functions import InvariantForm as InvariantForm
from ..rooms.hamilton_jacobi.class_functions import TraceOfAd as TraceOfAd
