"""The command line: the main job, scenes and their files, lists, checks, measurements, saved runs."""
