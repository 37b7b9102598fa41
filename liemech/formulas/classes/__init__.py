"""Records, the classes of formulas: their fields, how they lie in memory, what follows from what a subclass writes."""
