"""Which sites of a system are neighbours: graphs over whose edges terms are summed,
`term.over(neighbours.ring(100))`.
"""

from ..rooms.sites.graphs import all_pairs as all_pairs
from ..rooms.sites.graphs import between as between
from ..rooms.sites.graphs import chain as chain
from ..rooms.sites.graphs import cubic as cubic
from ..rooms.sites.graphs import edges as edges
from ..rooms.sites.graphs import ring as ring
from ..rooms.sites.graphs import square as square
from ..rooms.sites.graphs import within as within
