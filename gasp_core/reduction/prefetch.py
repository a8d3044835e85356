# pyright: basic
# numba's decorators carry no types.
"""Memory brought into the caches before it is needed: rows that lie anywhere are waited for many at a time."""

from __future__ import annotations

from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

__all__ = ["bring_to_read", "bring_to_write"]

_LINE = 64
"""Bytes that memory is read in."""


def _prefetch(write: int) -> Any:
    """A compiled function of an address that has its cache line brought, to be read (0) or written (1).

    Processors that know no such thing do nothing; https://llvm.org/docs/LangRef.html#llvm-prefetch-intrinsic.
    """

    @intrinsic
    def prefetch(typing, address):
        def generate(context, builder, signature, arguments):
            number, byte = ir.IntType(32), ir.IntType(8).as_pointer()
            kind = ir.FunctionType(ir.VoidType(), [byte, number, number, number])
            function = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
            # Kept in all caches (3), data (1).
            options = [ir.Constant(number, value) for value in (write, 3, 1)]
            builder.call(function, [builder.inttoptr(arguments[0], byte), *options])
            return context.get_dummy_value()

        return types.void(types.intp), generate

    return prefetch


_prefetch_read, _prefetch_write = _prefetch(0), _prefetch(1)


@numba.njit(cache=True, error_model="numpy")
def bring_to_read(address, size):
    """Have so many bytes brought into the caches, to be read."""
    for offset in range(0, size, _LINE):
        _prefetch_read(address + offset)
    _prefetch_read(address + size - 1)


@numba.njit(cache=True, error_model="numpy")
def bring_to_write(address, size):
    """The same, to be written."""
    for offset in range(0, size, _LINE):
        _prefetch_write(address + offset)
    _prefetch_write(address + size - 1)
