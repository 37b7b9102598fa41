"""Which sites of a system are neighbours: graphs over whose edges terms are summed,
`term.over(neighbours.ring(100))`.
"""

from .systems.graphs import all_pairs as all_pairs
from .systems.graphs import between as between
from .systems.graphs import chain as chain
from .systems.graphs import cubic as cubic
from .systems.graphs import edges as edges
from .systems.graphs import ring as ring
from .systems.graphs import square as square
from .systems.graphs import within as within
