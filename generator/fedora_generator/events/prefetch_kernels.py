"""Asking memory for a value before it is needed, which Numba has no word for."""

from typing import Any, Final

from llvmlite import ir  # type: ignore[import-untyped]  # Numba's own dependency, published without types
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

_INT32: Final = ir.IntType(32)
_BYTES: Final = ir.IntType(8).as_pointer()
_PREFETCH: Final = ir.FunctionType(ir.VoidType(), [_BYTES, _INT32, _INT32, _INT32])
_HINTS: Final = tuple(ir.Constant(_INT32, hint) for hint in (0, 3, 1))
"""To read, to keep in all caches, data (LLVM language reference, llvm.prefetch)."""


def _prefetch(_typing: Any, array: Any, row: Any, column: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind, (array, *indices) = signature.args[0], arguments
        view = context.make_array(kind)(context, builder, array)
        pointer_to: Any = cgutils.get_item_pointer
        place = builder.bitcast(pointer_to(context, builder, kind, view, indices, wraparound=False), _BYTES)
        builder.call(builder.module.declare_intrinsic("llvm.prefetch", [_BYTES], _PREFETCH), [place, *_HINTS])
        return context.get_dummy_value()

    return types.void(array, row, column), generate


prefetch: Final[Any] = intrinsic(_prefetch)
"""``prefetch(array, row, column)``, in compiled code: fetch the cache line of an item, and do not wait for it.

Nothing is read or checked; the indices are unsigned.
"""
