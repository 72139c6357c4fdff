"""Sensors: how a primitive is measured, one per file."""
