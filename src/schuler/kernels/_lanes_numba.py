"""What Numba has to know of values of four numbers: their type and what LLVM does with them."""

from __future__ import annotations

import operator
from typing import Any, ClassVar

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from schuler.kernels.lanes import LANES

__all__ = [
    "abs4", "any_at_least4", "any_greater4", "first_lanes", "larger4", "load4", "load_row4",
    "smaller4", "splat4", "store4", "store_row4", "where_equal4", "where_greater4",
]  # fmt: skip

_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_INT = ir.IntType(32)


class Lanes(types.Type):
    """Numba's type of four numbers."""

    def __init__(self) -> None:
        super().__init__(name="lanes4")


lanes = Lanes()


@register_model(Lanes)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _VECTOR)


def _splat(builder: Any, value: Any) -> Any:
    one = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, _INT(0))
    every = ir.Constant(ir.VectorType(_INT, LANES), [0] * LANES)
    return builder.shuffle_vector(one, ir.Constant(_VECTOR, ir.Undefined), every)


def _register(op: Any, name: str) -> None:
    """Let an operator work on values of four numbers, and on one with a single number."""

    class Typing(ConcreteTemplate):  # type: ignore[misc]
        cases: ClassVar = [
            signature(lanes, lanes, lanes),
            signature(lanes, lanes, types.float64),
            signature(lanes, types.float64, lanes),
        ]

    infer_global(op)(Typing)

    def lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        a, b = (
            value if kind == lanes else _splat(builder, value)
            for kind, value in zip(sig.args, args, strict=True)
        )
        return getattr(builder, name)(a, b)

    for one in (lanes, types.float64):
        for other in (lanes, types.float64):
            if lanes in (one, other):
                lower_builtin(op, one, other)(lower)


for _op, _name in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"),
                   (operator.truediv, "fdiv")):  # fmt: skip
    _register(_op, _name)


def _place(context: Any, builder: Any, kind: Any, array: Any, index: list[Any]) -> Any:
    """Return the address of four numbers in an array."""
    made = context.make_array(kind)(context, builder, array)
    at = cgutils.get_item_pointer(context, builder, kind, made, index, wraparound=False)
    return builder.bitcast(at, _VECTOR.as_pointer())


def _load(a: Any, index: tuple[Any, ...]) -> Any:
    """Return type and code of a load from an array whose numbers follow each other."""
    if not (isinstance(a, types.Array) and a.layout == "C" and a.dtype == types.float64):
        return None
    if a.ndim != len(index):
        return None

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.load(_place(context, builder, sig.args[0], args[0], args[1:]), align=8)

    return lanes(a, *[types.intp] * len(index)), code


def _store(a: Any, index: tuple[Any, ...], value: Any) -> Any:
    """Return type and code of a store."""
    if _load(a, index) is None or value != lanes:
        return None

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        builder.store(args[-1], _place(context, builder, sig.args[0], args[0], args[1:-1]), align=8)
        return context.get_dummy_value()

    return types.void(a, *[types.intp] * len(index), lanes), code


@intrinsic
def load4(typing: Any, a: Any, i: Any) -> Any:
    """Load from an array."""
    return _load(a, (i,))


@intrinsic
def load_row4(typing: Any, a: Any, i: Any, j: Any) -> Any:
    """Load from a matrix."""
    return _load(a, (i, j))


@intrinsic
def store4(typing: Any, a: Any, i: Any, value: Any) -> Any:
    """Store into an array."""
    return _store(a, (i,), value)


@intrinsic
def store_row4(typing: Any, a: Any, i: Any, j: Any, value: Any) -> Any:
    """Store into a matrix."""
    return _store(a, (i, j), value)


@intrinsic
def splat4(typing: Any, x: Any) -> Any:
    """Repeat a number."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _splat(builder, args[0])

    return lanes(types.float64), code


@intrinsic
def first_lanes(typing: Any, count: Any, a: Any, b: Any) -> Any:
    """Choose by the number of the lane."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        whole = ir.IntType(64)
        numbers = ir.VectorType(whole, LANES)
        one = builder.insert_element(ir.Constant(numbers, ir.Undefined), args[0], _INT(0))
        every = ir.Constant(ir.VectorType(_INT, LANES), [0] * LANES)
        counts = builder.shuffle_vector(one, ir.Constant(numbers, ir.Undefined), every)
        below = builder.icmp_signed("<", ir.Constant(numbers, list(range(LANES))), counts)
        return builder.select(below, args[1], args[2])

    return lanes(types.intp, lanes, lanes), code


@intrinsic
def abs4(typing: Any, a: Any) -> Any:
    """Clear the signs."""

    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kind = ir.FunctionType(_VECTOR, [_VECTOR])
        name = f"llvm.fabs.v{LANES}f64"
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), args)

    return lanes(lanes), code


def _chosen(op: str) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(builder.fcmp_ordered(op, args[0], args[1]), args[0], args[1])

    return lanes(lanes, lanes), code


@intrinsic
def larger4(typing: Any, a: Any, b: Any) -> Any:
    """Compare and choose."""
    return _chosen(">")


@intrinsic
def smaller4(typing: Any, a: Any, b: Any) -> Any:
    """Compare and choose."""
    return _chosen("<")


def _chosen_of_others(op: str) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.select(builder.fcmp_ordered(op, args[0], args[1]), args[2], args[3])

    return lanes(lanes, lanes, lanes, lanes), code


@intrinsic
def where_greater4(typing: Any, a: Any, b: Any, x: Any, y: Any) -> Any:
    """Compare two, choose of two others."""
    return _chosen_of_others(">")


@intrinsic
def where_equal4(typing: Any, a: Any, b: Any, x: Any, y: Any) -> Any:
    """Compare two, choose of two others."""
    return _chosen_of_others("==")


def _any(op: str) -> Any:
    def code(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        each = builder.fcmp_ordered(op, args[0], args[1])
        bits = builder.bitcast(each, ir.IntType(LANES))
        return builder.icmp_unsigned("!=", bits, ir.Constant(ir.IntType(LANES), 0))

    return types.boolean(lanes, lanes), code


@intrinsic
def any_greater4(typing: Any, a: Any, b: Any) -> Any:
    """Compare, and look at all answers at once."""
    return _any(">")


@intrinsic
def any_at_least4(typing: Any, a: Any, b: Any) -> Any:
    """Compare, and look at all answers at once."""
    return _any(">=")
