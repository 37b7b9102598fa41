"""Results of others, computed again: `python -m liemech reproduce`.

compared.py         a published number beside ours, the table of a result
pendulum.py         a point mass on a massless bar
four_bars.py        N four-bars through dead points
andrews.py          Andrews' squeezing mechanism
bricard.py          six hinges along edges of a cube
governor.py         a stiff governor
bend.py             a cantilever bent by 45 degrees
elastica.py         a slender cantilever under a large load
spaghetti.py        a rod that is thrown, and flies
chain_of_ten.py     the energy of ten links
problems_of_hlw.py  a pendulum, an ellipse, the outer Solar System
figure_eight.py     three masses on one curve

Each has its title, the SOURCE, and `compared(full)`, which yields the rows.
"""

RESULTS = {
    "iftomm-a01": "pendulum",
    "iftomm-a02": "four_bars",
    "iftomm-a03": "andrews",
    "iftomm-a04": "bricard",
    "iftomm-a05": "governor",
    "bend-45": "bend",
    "elastica": "elastica",
    "spaghetti-2d": "spaghetti",
    "wafr-10": "chain_of_ten",
    "hlw-problems": "problems_of_hlw",
    "figure-eight": "figure_eight",
}
"""The results by name, and the file of each."""
