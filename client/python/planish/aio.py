"""The client for asyncio."""

from __future__ import annotations

import asyncio
from typing import Any, Optional

from ._connection import ConnectionOptions
from ._methods import Connected, Methods
from ._retry import RetryPolicy
from ._transport import AioTransport
from .result import Result


class AsyncClient(Connected, Methods):
    """:class:`planish.Client` for asyncio, with the same parameters and errors. An asynchronous context manager.

    Cancelling the task of an unwrap cancels its job on the server. Callbacks are called in the event loop. Not thread-safe, but
    several event loops may use it one after the other, and a forked child may use it in a loop of its own.
    """

    def __init__(
        self,
        target: Optional[str] = None,
        *,
        connection: Optional[ConnectionOptions] = None,
        retry: Optional[RetryPolicy] = None,
    ) -> None:
        """Like :class:`planish.Client`. Without a target and $PLANISH_SERVER this may start a private server, which
        blocks for some tenths of a second."""
        super().__init__(AioTransport, target, connection, retry)

    async def __aenter__(self) -> "AsyncClient":
        return self

    async def __aexit__(self, *_: Any) -> None:
        await self.close()

    async def close(self) -> None:
        """Ends the connection and running calls."""
        await self._calls.transport.close()

    def start_unwrap(self, positions: Any, triangles: Any, **arguments: Any) -> "asyncio.Task[Result]":
        """:meth:`unwrap` as a task of the running event loop."""
        return asyncio.get_running_loop().create_task(self.unwrap(positions, triangles, **arguments))
