"""Feature models: how a landmark is parametrised, one per file."""
