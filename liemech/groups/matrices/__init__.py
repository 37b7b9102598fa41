"""Groups of matrices, of which every map follows from the generators."""
