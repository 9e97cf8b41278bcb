"""The workers of a dask scheduler, as an executor."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import warnings
from collections.abc import Iterator
from importlib import import_module
from typing import Any

from servotwin.errors import InputError, MissingExtraError

_PATIENCE = 5.0  # s until a scheduler has answered
_RETRIES = 3  # of a chunk whose worker is lost


@contextlib.contextmanager
def executor_at(address: str | None) -> Iterator[Any]:
    """Give an executor that hands work to a dask scheduler; None without an address.

    Raises
    ------
    MissingExtraError
        If dask is not installed.
    InputError
        If no scheduler answers at this address.
    """
    if address is None:
        yield None
        return
    try:
        distributed: Any = import_module("distributed")
    except ImportError:
        raise MissingExtraError("distributed", "sweep") from None
    for name in ("distributed", "tornado"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what matters becomes an error of one line
    try:  # first by hand: a client that found no scheduler complains again when it is collected
        asyncio.run(_greeted(address))
        client = distributed.Client(address, timeout=_PATIENCE, set_as_default=False)
    except (Exception, asyncio.CancelledError) as error:  # whatever answers there may say anything
        raise InputError("--scheduler", got=f"{address} ({type(error).__name__})",
                         allowed="the address of a dask scheduler that answers, such as tcp://host:8786") from None
    if not client.scheduler_info()["workers"]:
        warnings.warn(f"the scheduler at {address} has no worker yet: this waits for one", stacklevel=2)
    try:
        yield client.get_executor(pure=False, retries=_RETRIES)
    finally:
        client.close(timeout=_PATIENCE)


async def _greeted(address: str) -> None:
    core: Any = import_module("distributed.comm.core")
    comm = await asyncio.wait_for(core.connect(address, timeout=_PATIENCE), 1.2 * _PATIENCE)
    comm.abort()
