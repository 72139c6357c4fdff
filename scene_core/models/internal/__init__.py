"""Internal measurements: what a robot feels of its own state, one per file."""
