"""Results of others, computed again: `python -m liemech reproduce`.

compared.py       a published number beside ours, the table of a result
four_bars.py      N four-bars through dead points
andrews.py        Andrews' squeezing mechanism
bend.py           a cantilever bent by 45 degrees
elastica.py       a slender cantilever under a large load
chain_of_ten.py   the energy of ten links
figure_eight.py   three masses on one curve

Each has its title, the SOURCE, and `compared(full)`, which yields the rows.
"""

RESULTS = {
    "iftomm-a02": "four_bars",
    "iftomm-a03": "andrews",
    "bend-45": "bend",
    "elastica": "elastica",
    "wafr-10": "chain_of_ten",
    "figure-eight": "figure_eight",
}
"""The results by name, and the file of each."""
