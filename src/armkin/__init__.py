"""armkin: robot arms from a YAML table to real motion."""

__version__ = "0.1.0"
