"""Boxes of one's own for semrl."""
