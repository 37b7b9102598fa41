"""Ready systems of many sites: rods, water, chains, bodies that attract each other."""
