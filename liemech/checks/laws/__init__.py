"""The laws, one small function for each."""
