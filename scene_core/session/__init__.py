"""A run from its configuration to its record: presets, commands, history, metrics, studies."""
