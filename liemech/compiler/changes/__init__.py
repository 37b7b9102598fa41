"""Names and values that a translation has read from outside, and whether they have changed; object code on disk."""
