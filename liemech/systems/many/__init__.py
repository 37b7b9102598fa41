"""Many sites as systems see them: their states, and the words by which energies of many sites are asked."""
