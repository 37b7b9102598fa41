from .integrators.class_functions import CayleySquare as CayleySquare
from .integrators.class_functions import ClassFunction as ClassFunction
from .integrators.class_functions import InvariantForm as InvariantForm
from .integrators.class_functions import TraceOfAd as TraceOfAd
