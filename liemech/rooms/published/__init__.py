"""Results of others, computed again: `python -m liemech reproduce`.

compared.py                   a published number beside ours, the table of a result
article.py                    momenta on the sphere
double_spherical_pendulum.py  orders of methods of Lie groups
pendulum.py                   a point mass on a massless bar
four_bars.py                  N four-bars through dead points
andrews.py                    Andrews' squeezing mechanism
bricard.py                    six hinges along edges of a cube
governor.py                   a stiff governor
heavy_top.py                  a fast top
chain_of_ten.py               the energy of ten links
robots.py                     robots of public files
rods/                         cantilevers, a frame, rods that fly
spin_one.py                   waves of spins 1
problems_of_hlw.py            a pendulum, an ellipse, the outer Solar System
figure_eight.py               three masses on one curve

Each has its title, the SOURCE, and `compared(full)`, which yields the rows.
"""

RESULTS = {
    "article-fig1": "article",
    "celledoni-owren": "double_spherical_pendulum",
    "iftomm-a01": "pendulum",
    "iftomm-a02": "four_bars",
    "iftomm-a03": "andrews",
    "iftomm-a04": "bricard",
    "iftomm-a05": "governor",
    "heavy-top": "heavy_top",
    "bend-45": "rods.bend",
    "elastica": "rods.elastica",
    "princeton": "rods.princeton",
    "twisted": "rods.twisted",
    "right-angle-frame": "rods.right_angle_frame",
    "spaghetti-2d": "rods.spaghetti",
    "spaghetti-3d": "rods.spaghetti_in_space",
    "wafr-10": "chain_of_ten",
    "robots": "robots",
    "dahlbom": "spin_one",
    "hlw-problems": "problems_of_hlw",
    "figure-eight": "figure_eight",
}
"""The results by name, and the file of each."""
