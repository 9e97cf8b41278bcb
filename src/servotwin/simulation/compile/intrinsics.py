"""What derived modules alone import: the primitives of `engine.elementary` as single instructions, and addresses."""

# numba's and llvmlite's own types are not annotated
# mypy: disable-error-code="no-untyped-def, no-untyped-call, misc, import-untyped, call-overload"

from __future__ import annotations

import numpy as np
from llvmlite import ir
from numba import from_dtype, njit, types
from numba.core.cgutils import raw_memcpy
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

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
    return _rounded("llvm.rint", x)


@intrinsic
def floor(_typing, x):
    """Return the next whole number below."""
    return _rounded("llvm.floor", x)


def _rounded(name, x):
    kind = _widest((x,))

    def generate(_context, builder, signature, arguments):
        (x,) = arguments
        function = builder.module.declare_intrinsic(name, [x.type])
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


def array_maker(fields, dimensions, aligned):
    """Return the function (address, shape) that takes what stands in memory for an array.

    `fields` describe its elements, as `calls.described` tells them.
    """
    kind = types.Array(from_dtype(_dtype(fields)), dimensions, "C", aligned=aligned)

    @intrinsic
    def array_at(_typing, address, shape):
        def generate(context, builder, signature, arguments):
            place, lengths = arguments
            size = context.get_abi_sizeof(context.get_data_type(kind.dtype))
            shapes = [builder.extract_value(lengths, k) for k in range(dimensions)]
            strides = [ir.Constant(place.type, size)]
            for length in shapes[:0:-1]:
                strides.insert(0, builder.mul(strides[0], length))
            array = make_array(kind)(context, builder)
            data = builder.inttoptr(place, context.get_data_type(kind.dtype).as_pointer())
            populate_array(array, data=data, shape=shapes, strides=strides, itemsize=strides[-1], meminfo=None)
            return array._getvalue()

        return kind(types.int64, types.UniTuple(types.int64, dimensions)), generate

    return array_at


def _dtype(fields):
    if isinstance(fields, str):
        return np.dtype(fields)
    return np.dtype((np.record, [(name, _dtype(kind), shape) for name, kind, shape in fields]))


@intrinsic
def called(_typing, function, words):
    """Call the function at an address with the address of its words, and return its number."""
    number = types.int64

    def generate(_context, builder, signature, arguments):
        function, words = arguments
        kind = ir.FunctionType(words.type, [words.type])
        return builder.call(builder.inttoptr(function, kind.as_pointer()), [words])

    return number(number, number), generate


@intrinsic
def told(_typing, function, *arguments):
    """Call the function at an address with some words, and return its word, which counts where it has one."""
    word = types.int64

    def generate(_context, builder, signature, given):
        function, words = given
        some = [builder.extract_value(words, k) for k in range(len(arguments))]
        kind = ir.FunctionType(ir.IntType(64), [value.type for value in some])
        return builder.call(builder.inttoptr(function, kind.as_pointer()), some)

    return word(word, types.StarArgTuple.from_types([word] * len(arguments))), generate


@intrinsic
def copied(_typing, to, of, size):
    """Copy so many bytes from the address `of` to another one."""
    def generate(context, builder, signature, arguments):
        to, of, size = arguments
        byte = ir.IntType(8).as_pointer()
        raw_memcpy(builder, builder.inttoptr(to, byte), builder.inttoptr(of, byte), size, 1)
        return context.get_dummy_value()

    return types.none(types.int64, types.int64, types.int64), generate


_ACTIVE = "servotwin_active"  # the one word that a compiled function keeps between its calls


def _kept_word(builder):
    module, kind = builder.module, ir.IntType(64)
    if _ACTIVE not in module.globals:
        word = ir.GlobalVariable(module, kind, _ACTIVE)
        word.linkage, word.initializer = "internal", ir.Constant(kind, 0)
    return module.globals[_ACTIVE]


@intrinsic
def activate(_typing, value):
    """Keep a word in the function that is compiled, for `active` in the same one."""
    def generate(_context, builder, signature, given):
        builder.store(given[0], _kept_word(builder))
        return _context.get_dummy_value()

    return types.none(types.int64), generate


@intrinsic
def active(_typing):
    """Return the word that was kept."""
    def generate(_context, builder, signature, given):
        return builder.load(_kept_word(builder))

    return types.int64(), generate


_words_at, _numbers_at, _rows_at, _bytes_at, _halves_at = (array_maker(*kind, True) for kind in (
    ("<i8", 1), ("<f8", 1), ("<f8", 2), ("|i1", 1), ("<i4", 1)))


@njit(error_model="numpy")
def words(address, count):
    """Return so many whole numbers of 64 bits at an address."""
    return _words_at(address, (count,))


@njit(error_model="numpy")
def numbers(address, count):
    """Return so many floats at an address."""
    return _numbers_at(address, (count,))


@njit(error_model="numpy")
def rows(address, count, width):
    """Return a table of floats at an address."""
    return _rows_at(address, (count, width))


@njit(error_model="numpy")
def bytes_at(address, count):
    """Return so many whole numbers of 8 bits at an address."""
    return _bytes_at(address, (count,))


@njit(error_model="numpy")
def halves(address, count):
    """Return so many whole numbers of 32 bits at an address."""
    return _halves_at(address, (count,))
