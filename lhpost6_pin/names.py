"""Names that every module shares."""

__all__ = ["AXES"]

AXES = ("x", "y", "z", "roll", "pitch", "yaw")
"""Platen axes in the order of every record: displacement of C in {s}, Euler angles alpha, beta, gamma."""
