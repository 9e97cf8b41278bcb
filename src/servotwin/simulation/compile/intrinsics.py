"""The primitives of `engine.elementary` as single instructions; imported by derived modules alone."""

# numba's and llvmlite's own types are not annotated
# mypy: disable-error-code="no-untyped-def, no-untyped-call, misc, import-untyped"

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

_MANTISSA = {"float": 23, "double": 52}
_BIAS = {"float": 127, "double": 1023}
_ROOT_HALF_BITS = {"float": 0x3F3504F3, "double": 0x3FE6A09E667F3BCD}


def _integer(kind):
    return ir.IntType(32 if str(kind) == "float" else 64)


def _widest(arguments):
    return types.float64 if types.float64 in arguments else types.float32


@intrinsic
def fma(_typing, a, b, c):
    """Return a b + c, rounded once."""
    kind = _widest((a, b, c))

    def generate(_context, builder, signature, arguments):
        a, b, c = arguments
        return builder.fma(a, b, c)

    return kind(kind, kind, kind), generate


@intrinsic
def nearest(_typing, x):
    """Return the nearest whole number."""
    kind = _widest((x,))

    def generate(_context, builder, signature, arguments):
        (x,) = arguments
        function = builder.module.declare_intrinsic("llvm.rint", [x.type])
        return builder.call(function, [x])

    return kind(kind), generate


@intrinsic
def two_power(_typing, k):
    """Return 2^k for a whole k, by writing it into the exponent."""
    kind = _widest((k,))

    def generate(_context, builder, signature, arguments):
        (k,) = arguments
        name = str(k.type)
        whole = _integer(k.type)
        magic = ir.Constant(k.type, 1.5 * 2.0 ** _MANTISSA[name])  # leaves the bits of k in the lowest places
        bits = builder.bitcast(builder.fadd(k, magic), whole)
        bits = builder.add(bits, ir.Constant(whole, _BIAS[name]))
        return builder.bitcast(builder.shl(bits, ir.Constant(whole, _MANTISSA[name])), k.type)

    return kind(kind), generate


@intrinsic
def binary_exponent(_typing, x):
    """Return the whole e for which x / 2^e lies in [√½, √2)."""
    kind = _widest((x,))

    def generate(_context, builder, signature, arguments):
        (x,) = arguments
        name = str(x.type)
        whole = _integer(x.type)
        above = builder.sub(builder.bitcast(x, whole), ir.Constant(whole, _ROOT_HALF_BITS[name]))
        return builder.sitofp(builder.ashr(above, ir.Constant(whole, _MANTISSA[name])), x.type)

    return kind(kind), generate
