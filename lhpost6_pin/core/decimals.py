"""Decimal commas, met where a table has points."""

import re
from collections.abc import Sequence

__all__ = ["cut_at_decimal_commas", "has_decimal_comma"]

_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_WHOLE = re.compile(r"[+-]?\d+([eE][+-]?\d+)?")


def has_decimal_comma(field: str) -> bool:
    """Whether a field is a number with a comma for its point."""
    return bool(_COMMA.fullmatch(field.strip(' "')))


def cut_at_decimal_commas(fields: Sequence[str], columns: int) -> bool:
    """Whether fields between commas, more than `columns`, look like decimals cut in two: whole, and twice as many.

    Where fewer decimals are cut, one that begins with a zero (0,05) gives it away.
    """
    bare = [field.strip(' "') for field in fields]
    whole = len(bare) > columns and all(map(_WHOLE.fullmatch, bare))
    return whole and (len(bare) == 2 * columns or any(re.match(r"0\d", field) for field in bare))
