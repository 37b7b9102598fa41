"""Contents of a scene: the pictures of a motion, a class each."""
