"""The library of named effects: what a shake table may have that the report's model lacks."""

from .family import Family, Shape, families, find_family
from .make import effect_entry, make_effect, make_named_effect
from .scaled import in_size_of, scaled_families, size_of

__all__ = [
    "Family",
    "Shape",
    "effect_entry",
    "families",
    "find_family",
    "in_size_of",
    "make_effect",
    "make_named_effect",
    "scaled_families",
    "size_of",
]
