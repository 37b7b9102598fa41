"""Where laws and claims are looked at: points, states, starts."""
