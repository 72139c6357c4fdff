"""Motion models: how a robot moves, one per file."""
