"""Arrays packed one behind the other into one, and views of them within compiled code.

The caller holds the packed array. Views have no owner: neither they nor those made of them count references, which are
atomic operations and, for two dozen views a step, cost as much as the step's own arithmetic.
"""

from collections.abc import Sequence
from typing import Any

import numba
import numpy as np
from numba.core.cgutils import unpack_tuple
from numba.extending import intrinsic

from .arrays import Array

__all__ = ["array_view", "packed_zeros", "table_view"]


def packed_zeros(head: Sequence[int], shapes: Sequence[tuple[int, ...]]) -> list[Array]:
    """One array of zeros behind the numbers of a head, then its parts of these shapes, as views."""
    ends = np.cumsum([len(head), *(int(np.prod(shape)) for shape in shapes)])
    packed = np.zeros(ends[-1])
    packed[: len(head)] = head
    views = zip(ends[:-1], ends[1:], shapes, strict=True)
    return [packed, *(packed[first:last].reshape(shape) for first, last, shape in views)]


@intrinsic
def table_view(_context: Any, packed: Any, dtype: Any, first: Any, last: Any) -> Any:
    """View (n,) of packed[first:last], read as a dtype."""
    result = numba.types.Array(dtype.dtype, 1, "C")

    def make(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        size = context.get_abi_sizeof(context.get_data_type(result.dtype))
        _, _, start, end = arguments
        octets = builder.mul(builder.sub(end, start), context.get_constant(numba.intp, 8))
        count = builder.sdiv(octets, context.get_constant(numba.intp, size))
        return _view(context, builder, signature, arguments, start, [count])

    return result(packed, dtype, numba.intp, numba.intp), make


@intrinsic
def array_view(_context: Any, packed: Any, first: Any, shape: Any) -> Any:
    """View of a shape, a tuple, of the numbers from packed[first] on."""
    result = numba.types.Array(packed.dtype, len(shape), "C")

    def make(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        _, start, sizes = arguments
        return _view(context, builder, signature, arguments, start, unpack_tuple(builder, sizes))

    return result(packed, numba.intp, numba.types.UniTuple(numba.intp, len(shape))), make


def _view(context: Any, builder: Any, signature: Any, arguments: Any, start: Any, shape: list[Any]) -> Any:
    """Array structure of a shape, in C order, at a place of a packed array, without owner."""
    from numba.np.arrayobj import make_array, populate_array

    packed = make_array(signature.args[0])(context, builder, arguments[0])
    out = make_array(signature.return_type)(context, builder)
    size = context.get_constant(numba.intp, context.get_abi_sizeof(context.get_data_type(signature.return_type.dtype)))
    strides = [size]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    data = builder.bitcast(builder.gep(packed.data, [start]), out.data.type)
    populate_array(out, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None)
    return out._getvalue()
