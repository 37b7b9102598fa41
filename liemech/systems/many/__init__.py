"""Systems of many sites: their states, and the interface of energies of many sites."""
