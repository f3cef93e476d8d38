"""Weighed sums of four texels in machine code of our own: the four numbers of a texel go through the processor at once.

Numba does not find that by itself. In compiled
code, ``weighed(texels, a, b, c, d, wa, wb, wc, wd)`` is ``wa`` times texel ``a`` and so on, added up, four numbers;
``texels`` is the address of an array (N, 4) of single precision. ``add_weighed(..., total)`` adds the same to the
four numbers at the address ``total``; ``ahead(texels, a)`` has a texel fetched that will be wanted soon.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

FOUR, LANE = ir.VectorType(ir.FloatType(), 4), ir.IntType(32)


def _weighed(_: Any, texels: Any, a: Any, b: Any, c: Any, d: Any, wa: Any, wb: Any, wc: Any, wd: Any) -> Any:
    four: Any = types.UniTuple
    return four(types.float32, 4)(texels, a, b, c, d, wa, wb, wc, wd), _emit_weighed


def _emit_weighed(_: Any, builder: Any, __: Any, arguments: Any) -> Any:
    total, pack = _emit_sum(builder, arguments), cgutils.pack_array  # type: Any, Any
    return pack(builder, [builder.extract_element(total, LANE(n)) for n in range(4)])


def _add_weighed(
    _: Any, texels: Any, a: Any, b: Any, c: Any, d: Any, wa: Any, wb: Any, wc: Any, wd: Any, total: Any
) -> Any:
    return types.void(texels, a, b, c, d, wa, wb, wc, wd, total), _emit_add_weighed


def _emit_add_weighed(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
    place = builder.inttoptr(arguments[9], FOUR.as_pointer())
    before = builder.load(place, align=4)
    builder.store(builder.fadd(before, _emit_sum(builder, arguments), flags=("fast",)), place, align=4)
    return context.get_dummy_value()


def _emit_sum(builder: Any, arguments: Any) -> Any:
    """The sum as one vector."""
    undefined, everywhere = ir.Constant(FOUR, ir.Undefined), ir.Constant(ir.VectorType(LANE, 4), [0] * 4)
    first = builder.inttoptr(arguments[0], ir.FloatType().as_pointer())
    total = None
    for at, weight in zip(arguments[1:5], arguments[5:9], strict=True):
        place = builder.gep(first, [builder.shl(at, ir.Constant(at.type, 2))])
        texel = builder.load(builder.bitcast(place, FOUR.as_pointer()), align=4)
        share = builder.shuffle_vector(builder.insert_element(undefined, weight, LANE(0)), undefined, everywhere)
        part = builder.fmul(texel, share, flags=("fast",))
        total = part if total is None else builder.fadd(total, part, flags=("fast",))
    return total


def _ahead(_: Any, texels: Any, texel: Any) -> Any:
    return types.void(texels, texel), _emit_ahead


def _emit_ahead(context: Any, builder: Any, _: Any, arguments: Any) -> Any:
    """Ask for a texel's line of the cache: read, to be kept in all levels, data."""
    first = builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())
    place = builder.gep(first, [builder.shl(arguments[1], ir.Constant(arguments[1].type, 4))])
    form = ir.FunctionType(ir.VoidType(), [ir.IntType(8).as_pointer(), LANE, LANE, LANE])
    declare: Any = cgutils.get_or_insert_function
    builder.call(declare(builder.module, form, "llvm.prefetch.p0"), [place, LANE(0), LANE(3), LANE(1)])
    return context.get_dummy_value()


weighed: Any = intrinsic(_weighed)
ahead: Any = intrinsic(_ahead)
add_weighed: Any = intrinsic(_add_weighed)
