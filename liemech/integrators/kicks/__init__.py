"""Bodies in fields: kicks by forces, and drifts without them."""
