"""Check of the elements of a MATLAB v5 to v7 file before scipy reads them.

scipy does not check the tags of a file: an unknown data type crashes the process, and memory is allocated for as many
cells as a variable claims. An element is a tag (type, size) and data, padded to eight bytes; a matrix is an
element made of elements: flags, dimensions, name, and its numbers, or a matrix for each cell or field.
"""

import math
import struct
import zlib
from typing import NamedTuple

__all__ = ["is_mat5", "unpacked_mat5"]

_HEADER, _TAG = 128, 8
_MATRIX, _COMPRESSED, _UINT32 = 14, 15, 6
_NUMERIC = frozenset((1, 2, 3, 4, 5, 6, 7, 9, 12, 13, 16, 17, 18))
_CELL, _STRUCT, _OBJECT, _SPARSE = 1, 2, 3, 5
_NUMBERS = range(4, 16)  # classes: text, sparse, and numbers of all sizes
_DEEPEST = 100  # cells in cells; a test has a few


class _Element(NamedTuple):
    kind: int
    data: bytes


def is_mat5(content: bytes) -> bool:
    """Whether scipy takes a file for one of v5 or later: those of v4 have a zero among the first four bytes."""
    return 0 not in content[:4]


def unpacked_mat5(content: bytes) -> bytes:
    """The file uncompressed; raises ValueError, struct.error or zlib.error for impossible elements."""
    order = ">" if content[126:_HEADER] == b"MI" else "<"
    parts, at = [content[:_HEADER]], _HEADER
    while at < len(content):
        kind, size = struct.unpack_from(f"{order}II", content, at)
        element, at = content[at : at + _TAG + size], at + _TAG + size
        if len(element) < _TAG + size:
            raise ValueError("it ends within a variable")
        if kind == _COMPRESSED:
            element = zlib.decompress(element[_TAG:])
        for found in _elements(element, order):
            _check_matrix(found, order, 0)
        parts.append(element)
    return b"".join(parts)


def _elements(body: bytes, order: str) -> list[_Element]:
    found, at = [], 0
    while at < len(body):
        kind, size = struct.unpack_from(f"{order}II", body, at)
        start, after = at + _TAG, at + _TAG + size + -size % _TAG
        if kind >> 16:  # size and data share the second half of the tag
            kind, size, start, after = kind & 0xFFFF, kind >> 16, at + _TAG // 2, at + _TAG
        data = body[start : start + size]
        if len(data) < size or start + size > after or kind not in (*_NUMERIC, _MATRIX):
            raise ValueError(f"an element of type {kind} and {size} bytes is impossible")
        found.append(_Element(kind, data))
        at = after
    return found


def _check_matrix(element: _Element, order: str, depth: int) -> None:
    """Raise ValueError unless the content of a matrix fits its class, flags and dimensions."""
    if element.kind != _MATRIX or depth > _DEEPEST:
        raise ValueError("variables are missing, or nested too deeply")
    if not element.data:
        return  # an empty cell
    flags, *parts = _elements(element.data, order)
    if flags.kind != _UINT32 or len(flags.data) != _TAG:
        raise ValueError("a variable without flags")
    value = struct.unpack_from(f"{order}I", flags.data)[0]
    kind, is_complex = value & 0xFF, bool(value & 0x800)
    if kind in _NUMBERS:
        arrays = parts[2:]  # after dimensions and name
        needed = (3 if kind == _SPARSE else 1) + is_complex
        if len(arrays) < needed or any(part.kind not in _NUMERIC for part in parts):
            raise ValueError("a variable without its numbers")
        return
    inner = [part for part in parts if part.kind == _MATRIX]
    if kind in (_CELL, _STRUCT, _OBJECT) and len(inner) < _cells(kind, parts, order):
        raise ValueError("a variable has fewer cells than its dimensions")
    for part in inner:
        _check_matrix(part, order, depth + 1)


def _cells(kind: int, parts: list[_Element], order: str) -> int:
    """How many matrices a cell array or struct of these parts must hold."""
    dims = struct.unpack(f"{order}{len(parts[0].data) // 4}i", parts[0].data)
    if min(dims, default=0) < 0:
        raise ValueError("a variable of negative size")
    if kind == _CELL:
        return math.prod(dims)
    width, names = parts[2 + (kind == _OBJECT)], parts[3 + (kind == _OBJECT)]
    return math.prod(dims) * (len(names.data) // max(1, struct.unpack(f"{order}i", width.data)[0]))
