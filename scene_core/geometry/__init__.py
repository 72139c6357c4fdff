"""Rotations, position states, primitives and ellipses, each value with its Jacobians."""
