"""Numbers that a formula may meet in place of floats: with derivatives, series, more digits, or no value.

bases.py, pairs.py                   what kinds there are; conversions.py: from one to another; sizes.py: beside rounding
dual.py                              derivatives forwards; backwards transposes.py, over the linear forms of forms.py
series.py, products.py               power series; series_of_sites.py: of sites that meet
double_double.py, compensated.py     32 digits; sums that remember what rounding takes
complex_numbers.py, philox.py        complex numbers; random numbers by counters
anything.py, ways.py                 numbers without values: degrees of formulas; identities on every branch
"""
