"""Methods of linkages of any size: loops over bodies and joints, whose numbers lie in memory."""
