"""Numbers that a formula may meet in place of floats: with derivatives, series, more digits, or no value."""
