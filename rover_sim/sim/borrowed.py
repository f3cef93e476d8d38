"""Arrays lent to compiled helpers, uncounted.

Numba counts a reference to an array wherever a helper is handed one, with an instruction that locks the cache, also
when the helper is inlined; inside loops that costs more than many a helper's own work. In compiled code
``borrowed(array)`` is the same array without an owner, of which nothing is counted. Borrow a function's own arguments
only, which the caller keeps: an array that was made in the function is freed after the last use of its own name.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic


def _borrowed(_: Any, array: Any) -> Any:
    if not isinstance(array, types.Array):
        raise TypeError(f"borrowed: {array} is no array")
    return array(array), _emit


def _emit(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    lent = context.make_array(signature.return_type)(context, builder, value=arguments[0])
    nobody: Any = cgutils.get_null_value
    lent.meminfo, lent.parent = nobody(lent.meminfo.type), nobody(lent.parent.type)
    return lent._getvalue()  # noqa: SLF001 - numba's own way to take the array out of its proxy


borrowed: Any = intrinsic(_borrowed)
