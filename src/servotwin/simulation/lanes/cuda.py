"""An NVIDIA GPU by its driver alone: memory, kernels from PTX, and arrays that other libraries read in place.

The context is the device's primary one, which PyTorch, JAX, CuPy and Warp use too; all work is put on the stream of
whoever asks for it, and nothing here waits but what copies to the processor. Sources: CUDA Driver API 13; DLPack 1.0;
CUDA Array Interface 3.
"""

from __future__ import annotations

import ctypes
import math
import os
import weakref
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from servotwin.errors import InputError, ServotwinError

LIBRARIES = ("nvcuda.dll",) if os.name == "nt" else ("libcuda.so.1", "libcuda.so")
_OLDEST, _LEAST = (11, 0), (8, 0)  # CUDA of the driver, which reads PTX 7.0; compute capability, that of the PTX
_BLOCK = 128  # threads
_MAJOR, _MINOR = 75, 76  # attributes of a device: its compute capability
_MAX_REGISTERS, _ERROR_LOG, _ERROR_LOG_SIZE = 0, 5, 6  # options of the compiler within the driver
_LOG = 8192  # bytes of what that compiler says

_address, _int, _text = ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p
_size, _word = ctypes.c_size_t, ctypes.c_uint
_SIGNATURES: dict[str, tuple[Any, ...]] = {
    "cuInit": (_word,), "cuDriverGetVersion": (_address,), "cuDeviceGetCount": (_address,),
    "cuDeviceGet": (_address, _int), "cuDeviceGetAttribute": (_address, _int, _int),
    "cuDevicePrimaryCtxRetain": (_address, _int), "cuDevicePrimaryCtxRelease_v2": (_int,),
    "cuCtxPushCurrent_v2": (_address,), "cuCtxPopCurrent_v2": (_address,),
    "cuModuleLoadDataEx": (_address, _address, _word, _address, _address),
    "cuModuleGetFunction": (_address, _address, _text),
    "cuMemAlloc_v2": (_address, _size), "cuMemFree_v2": (_address,),
    "cuMemcpyHtoDAsync_v2": (_address, _address, _size, _address),
    "cuMemcpyDtoHAsync_v2": (_address, _address, _size, _address),
    "cuMemsetD8Async": (_address, ctypes.c_ubyte, _size, _address), "cuStreamSynchronize": (_address,),
    "cuEventCreate": (_address, _word), "cuEventRecord": (_address, _address), "cuEventDestroy_v2": (_address,),
    "cuStreamWaitEvent": (_address, _address, _word),
    "cuLaunchKernel": (_address, *[_word] * 7, _address, _address, _address), "cuGetErrorString": (_int, _address)}


class Driver:
    """The functions of the driver.

    Raises
    ------
    InputError
        If there is none, or one that is older than what the kernels need.
    """

    def __init__(self) -> None:
        for name in LIBRARIES:
            try:
                self._library = ctypes.CDLL(name)
                break
            except OSError:
                continue
        else:
            raise InputError("device", "cuda, without a driver of NVIDIA on this computer", "cpu")
        for name, kinds in _SIGNATURES.items():
            function = getattr(self._library, name, None)
            if function is None:
                raise InputError("device", f"cuda, by a driver without {name}", _of_version(_OLDEST))
            function.argtypes, function.restype = kinds, ctypes.c_int
        self.call("cuInit", 0)
        version = self.number("cuDriverGetVersion")
        if divmod(version // 10, 100) < _OLDEST:
            raise InputError("device", "cuda, by a driver of CUDA {}.{}".format(*divmod(version // 10, 100)),
                             _of_version(_OLDEST))

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function.

        Raises
        ------
        ServotwinError
            If it fails: says how.
        """
        code = getattr(self._library, name)(*arguments)
        if code != 0:
            said = ctypes.c_char_p()
            self._library.cuGetErrorString(code, ctypes.byref(said))
            raise ServotwinError(f"cuda: {name}: {(said.value or b'error %d' % code).decode()}")

    def number(self, name: str, *arguments: Any) -> int:
        """Return the whole number that a function puts to its first argument."""
        found = ctypes.c_int()
        self.call(name, ctypes.byref(found), *arguments)
        return found.value

    def address(self, name: str, *arguments: Any) -> int:
        """Return the address, or the handle, that a function puts to its first argument."""
        found = ctypes.c_void_p()
        self.call(name, ctypes.byref(found), *arguments)
        return found.value or 0


def _of_version(version: tuple[int, int]) -> str:
    return "cpu, or a driver of CUDA {}.{} or later".format(*version)


@cache
def _driver() -> Driver:
    return Driver()


class Gpu:
    """A GPU in its primary context.

    Parameters
    ----------
    device : str
        "cuda", or "cuda:" and its number.

    Raises
    ------
    InputError
        If there is no such device, or one that does not run the kernels.
    """

    def __init__(self, device: str) -> None:
        name, _, number = device.partition(":") if isinstance(device, str) else ("", "", "")
        if name != "cuda" or not (number.isdecimal() or device == "cuda"):
            raise InputError("device", device, "cpu, cuda or cuda: and a number")
        self.number, self._driver = int(number or 0), _driver()
        count = self._driver.number("cuDeviceGetCount")
        if self.number >= count:
            raise InputError("device", device, ", ".join(["cpu", *(f"cuda:{k}" for k in range(count))]))
        handle = self._driver.number("cuDeviceGet", self.number)
        capability = tuple(self._driver.number("cuDeviceGetAttribute", which, handle) for which in (_MAJOR, _MINOR))
        if capability < _LEAST:
            raise InputError("device", "{}, of compute capability {}.{}".format(device, *capability),
                             "cpu, or a GPU of compute capability {}.{} or later".format(*_LEAST))
        self._context = self._driver.address("cuDevicePrimaryCtxRetain", handle)
        weakref.finalize(self, self._driver.call, "cuDevicePrimaryCtxRelease_v2", handle).atexit = False

    def __repr__(self) -> str:
        return f"cuda:{self.number}"

    @contextmanager
    def _current(self) -> Iterator[Driver]:
        """Let calls be of this device, and leave the thread as it was."""
        self._driver.call("cuCtxPushCurrent_v2", self._context)
        try:
            yield self._driver
        finally:
            self._driver.address("cuCtxPopCurrent_v2")

    def array(self, like: NDArray[Any]) -> GpuArray:
        """Return an array on the device with the numbers of another one."""
        with self._current() as driver:
            address = driver.address("cuMemAlloc_v2", max(like.nbytes, 1))
        found = GpuArray(self, address, like.shape, like.dtype, None)
        weakref.finalize(found, self._free, address).atexit = False
        found.write(like)
        return found

    def _free(self, address: int) -> None:
        with self._current() as driver:
            driver.call("cuMemFree_v2", address)

    def kernels(self, ptx: str, names: Sequence[str], registers: int) -> dict[str, int]:
        """Return handles of kernels that get so many registers at the most, once the driver has compiled them."""
        log = ctypes.create_string_buffer(_LOG)
        options = (ctypes.c_int * 3)(_MAX_REGISTERS, _ERROR_LOG, _ERROR_LOG_SIZE)
        values = (ctypes.c_void_p * 3)(registers, ctypes.addressof(log), _LOG)
        with self._current() as driver:
            try:
                module = driver.address("cuModuleLoadDataEx", ptx.encode(), len(options), options, values)
            except ServotwinError as error:
                raise ServotwinError(f"{error} {' '.join(log.value.decode(errors='replace').split())}") from None
            return {name: driver.address("cuModuleGetFunction", module, name.encode()) for name in names}

    def launch(self, kernel: int, threads: int, table: ctypes.Structure, stream: int) -> None:
        """Put a kernel of so many threads on a stream, with a struct as its argument."""
        arguments = (ctypes.c_void_p * 1)(ctypes.addressof(table))
        with self._current() as driver:
            driver.call("cuLaunchKernel", kernel, -(-threads // _BLOCK), 1, 1, _BLOCK, 1, 1, 0, stream, arguments, None)

    def follows(self, stream: int, other: int) -> None:
        """Let what is put on a stream from now on wait for all that is on another one."""
        if stream == other:
            return
        with self._current() as driver:
            event = driver.address("cuEventCreate", 2)  # without a time
            driver.call("cuEventRecord", event, other)
            driver.call("cuStreamWaitEvent", stream, event, 0)
            driver.call("cuEventDestroy_v2", event)


class GpuArray:
    """An array on a GPU, in the order of C; PyTorch, JAX, CuPy and Warp take it in place.

    Parameters
    ----------
    gpu : Gpu
    address : int
    shape : tuple of int
    dtype : dtype
    base : object
        The owner of the memory; kept for as long as this array is.
    """

    def __init__(self, gpu: Gpu, address: int, shape: tuple[int, ...], dtype: np.dtype[Any], base: Any) -> None:
        self.gpu, self.address, self.shape, self.dtype, self._base = gpu, address, shape, dtype, base
        self._stream = 0

    @property
    def stream(self) -> int:
        """Handle of the stream on which its numbers are made."""
        return self._base.stream if isinstance(self._base, GpuArray) else self._stream

    @stream.setter
    def stream(self, stream: int) -> None:
        self._stream = stream

    def __len__(self) -> int:
        return self.shape[0]

    @property
    def nbytes(self) -> int:
        """Its size in bytes."""
        return math.prod(self.shape) * self.dtype.itemsize

    def row(self, k: int) -> GpuArray:
        """Return a row, in place."""
        size = self.nbytes // self.shape[0]
        return GpuArray(self.gpu, self.address + k * size, self.shape[1:], self.dtype, self)

    def write(self, values: NDArray[Any]) -> None:
        """Take numbers from the processor, when all that is on its stream is done."""
        values = np.ascontiguousarray(values, self.dtype)
        with self.gpu._current() as driver:
            driver.call("cuMemcpyHtoDAsync_v2", self.address, values.ctypes.data, self.nbytes, self.stream)
            driver.call("cuStreamSynchronize", self.stream)

    def read(self) -> NDArray[Any]:
        """Return its numbers on the processor, when all that is on its stream is done."""
        found = np.empty(self.shape, self.dtype)
        with self.gpu._current() as driver:
            driver.call("cuMemcpyDtoHAsync_v2", found.ctypes.data, self.address, self.nbytes, self.stream)
            driver.call("cuStreamSynchronize", self.stream)
        return found

    def clear(self) -> None:
        """Set all of it to 0, on its stream."""
        with self.gpu._current() as driver:
            driver.call("cuMemsetD8Async", self.address, 0, self.nbytes, self.stream)

    # --- for other libraries ------------------------------------------------------------------------------------------

    @property
    def __cuda_array_interface__(self) -> dict[str, Any]:
        return {"shape": self.shape, "typestr": self.dtype.str, "data": (self.address, False), "version": 3,
                "stream": self.stream or 1}

    def __dlpack_device__(self) -> tuple[int, int]:
        return KDL_CUDA, self.gpu.number

    def __dlpack__(self, *, stream: int | None = None, max_version: tuple[int, int] | None = None,
                   dl_device: tuple[int, int] | None = None, copy: bool | None = None) -> Any:
        """Return a capsule of DLPack; work on the stream that is given waits for what is on this array's."""
        if copy or dl_device not in (None, self.__dlpack_device__()):
            raise BufferError("an array on a GPU is given as it is, in place")
        if stream not in (None, -1):
            self.gpu.follows(_legacy(stream), self.stream)
        return _capsule(self)


def _legacy(stream: int | None) -> int:
    """Return the handle of a stream as DLPack and the CUDA Array Interface count them: 1 is the legacy one."""
    return 0 if stream in (None, 0, 1) else int(stream or 0)


def stream_of(stream: Any) -> int:
    """Return the handle of a stream of another library: a number, or what follows `__cuda_stream__`, PyTorch or CuPy.

    Raises
    ------
    InputError
        If it is none.
    """
    if stream is None or (isinstance(stream, int) and not isinstance(stream, bool)):
        return int(stream or 0)
    if hasattr(stream, "__cuda_stream__"):
        return int(stream.__cuda_stream__()[1])
    for name in ("cuda_stream", "ptr"):
        if isinstance(getattr(stream, name, None), int):
            return int(getattr(stream, name))
    raise InputError("stream", got=stream, allowed="the handle of one, or a stream of PyTorch, CuPy or Warp")


# --- DLPack -----------------------------------------------------------------------------------------------------------

KDL_CUDA = 2
_KINDS = {0: "i", 1: "u", 2: "f", 6: "b"}


class _Tensor(ctypes.Structure):
    _fields_ = [("data", ctypes.c_void_p), ("device_type", ctypes.c_int32), ("device_id", ctypes.c_int32),
                ("ndim", ctypes.c_int32), ("code", ctypes.c_uint8), ("bits", ctypes.c_uint8),
                ("lanes", ctypes.c_uint16), ("shape", ctypes.POINTER(ctypes.c_int64)),
                ("strides", ctypes.POINTER(ctypes.c_int64)), ("byte_offset", ctypes.c_uint64)]


class _Managed(ctypes.Structure):
    _fields_ = [("tensor", _Tensor), ("context", ctypes.c_void_p), ("deleter", ctypes.c_void_p)]


_prototype = ctypes.PYFUNCTYPE
_new = _prototype(ctypes.py_object, ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)(
    ("PyCapsule_New", ctypes.pythonapi))
_is_valid = _prototype(ctypes.c_int, ctypes.c_void_p, ctypes.c_char_p)(("PyCapsule_IsValid", ctypes.pythonapi))
_pointer = _prototype(ctypes.c_void_p, ctypes.c_void_p, ctypes.c_char_p)(("PyCapsule_GetPointer", ctypes.pythonapi))
_NAME = b"dltensor"
_given: dict[int, tuple[Any, ...]] = {}  # what has been handed out, until it is done with


def _delete(managed: int) -> None:
    _given.pop(managed, None)


def _destroy(capsule: int) -> None:
    if _is_valid(capsule, _NAME):  # nobody has taken it
        _delete(_pointer(capsule, _NAME))


_DELETER = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(_delete)
_DESTRUCTOR = _prototype(None, ctypes.c_void_p)(_destroy)


def _capsule(array: GpuArray) -> Any:
    """Return a capsule of DLPack that keeps an array for as long as somebody uses it."""
    shape = (ctypes.c_int64 * len(array.shape))(*array.shape)
    kind, number = array.__dlpack_device__()
    managed = _Managed(
        _Tensor(array.address, kind, number, len(array.shape), "iuf".index(array.dtype.kind),
                8 * array.dtype.itemsize, 1, shape, None, 0), None, ctypes.cast(_DELETER, ctypes.c_void_p))
    address = ctypes.addressof(managed)
    _given[address] = managed, shape, array
    return _new(address, _NAME, ctypes.cast(_DESTRUCTOR, ctypes.c_void_p))


def is_guest(values: Any) -> bool:
    """Tell whether something is an array on a GPU."""
    return hasattr(values, "__dlpack_device__") and int(values.__dlpack_device__()[0]) == KDL_CUDA


class Visit(NamedTuple):
    """An array of another library, as DLPack says: its address, shape and type, such as "f8", and what keeps it."""

    address: int
    shape: tuple[int, ...]
    kind: str
    capsule: Any


def guest(name: str, values: Any, gpu: Gpu, stream: int) -> Visit:
    """Return another library's array, which work on the stream may use.

    Raises
    ------
    InputError
        If it is on another device, or not in the order of C; names it.
    """
    device, number = values.__dlpack_device__()
    if (int(device), int(number)) != (KDL_CUDA, gpu.number):
        raise InputError(name, got="an array on another device", allowed=f"one on {gpu}")
    capsule = values.__dlpack__(stream=stream or 1)
    of = _Managed.from_address(_pointer(id(capsule), _NAME) or 0).tensor
    shape = tuple(of.shape[k] for k in range(of.ndim))
    wanted = [math.prod(shape[k + 1:]) for k in range(of.ndim)]
    if of.strides and 0 not in shape and any(shape[k] != 1 and of.strides[k] != wanted[k] for k in range(of.ndim)):
        raise InputError(name, got=f"an array of shape {shape}, not dense", allowed="a dense one")
    kind = f"{_KINDS.get(of.code, '?')}{of.bits // 8}" if of.lanes == 1 else "?"
    return Visit((of.data or 0) + of.byte_offset, shape, kind, capsule)


def for_each(name: str, values: Any, gpu: Gpu, shape: tuple[int, ...], dtype: np.dtype[Any], stream: int) -> Visit:
    """Return another library's array of a shape and a type.

    Raises
    ------
    InputError
        If it has others, or as `guest` has it.
    """
    found = guest(name, values, gpu, stream)
    kind = "u1" if found.kind == "b1" and dtype == np.uint8 else found.kind  # a mask
    if kind != f"{dtype.kind}{dtype.itemsize}":
        raise InputError(name, got=f"an array of {_named(kind)}", allowed=f"one of {dtype.name}")
    if found.shape != shape:
        raise InputError(name, got=f"an array of shape {found.shape}", allowed=f"a dense one of shape {shape}")
    return found


def _named(kept: str) -> str:
    try:
        return np.dtype(kept).name
    except TypeError:
        return "another kind of numbers"
