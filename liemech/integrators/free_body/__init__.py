"""Methods of free bodies alone: exact ones, splittings into rotations, midpoint rules, Moser and Veselov's."""
