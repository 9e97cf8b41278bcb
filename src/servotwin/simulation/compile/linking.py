"""How functions are compiled that nothing but other compiled functions call.

numba makes machine code of every function, and to that end optimises each with all that it calls. For functions called
by others alone that is work for nothing: these take them in and are optimised as a whole. So they get no machine code,
and are left as they are, for whoever calls them.

Source: numba's developer manual, "Customizing the compiler".
"""

# numba's own types are not annotated
# mypy: disable-error-code="no-untyped-call, misc, no-any-unimported"

from __future__ import annotations

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, PassManager, register_pass
from numba.core.typed_passes import NopythonTypeInference

_MOST = 150_000  # bytes of bitcode, of a function and of all that it calls, that are still optimised by themselves


class _Nowhere:
    """What a function without machine code has for an engine."""

    def set_env(self, name: str, environment: object) -> None:
        """Do nothing: there is no address at which to set it."""


class _Part(JITCodeLibrary):
    """The code of a function that is only linked into others."""

    @property
    def codegen(self) -> _Nowhere:
        """Return what the addresses of this function are asked of."""
        return _Nowhere()

    def get_pointer_to_function(self, name: str) -> int:
        """Return no address."""
        self._ensure_finalized()
        return 0

    def _optimize_final_module(self) -> None:
        if len(self._final_module.as_bitcode()) <= _MOST:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


@register_pass(mutates_CFG=False, analysis_only=True)
class _AsPart(FunctionPass):
    """Says that a function is to be linked into others alone."""

    _name = "servotwin_as_part"

    def __init__(self) -> None:
        FunctionPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        """Give the function its library."""
        state.library = _Part(state.targetctx.codegen(), state.func_id.func_qualname)
        return False


class Part(CompilerBase):
    """The compiler of such functions."""

    def define_pipelines(self) -> list[PassManager]:
        """Return numba's passes with that one among them."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_AsPart, NopythonTypeInference)
        passes.finalize()
        return [passes]
