"""Limits of connections, which uvicorn leaves to a proxy before it. In: its events. Out: connections that end in time.

A connection is dropped where the client is slow to ask, or to take what it asked for. Beyond a number of connections,
new ones are told 503 and those that are served go on; beyond a few more, new ones are dropped.
"""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import socket
import struct
import sys
import threading
import time
from dataclasses import dataclass
from functools import partial
from types import FrameType
from typing import Any

import h11
import uvicorn
from starlette.responses import PlainTextResponse
from uvicorn.protocols.http.h11_impl import H11Protocol

LAST_RESORT = 1.5  # s after a signal, when the process ends even if a thread hangs: within the 2 s that are promised
BACKLOG = 64  # connections that the system accepts before the server does (guess): a burst takes no more files at once
NO_LINGER = struct.pack("hh" if sys.platform == "win32" else "ii", 1, 0)  # the system forgets what it has not sent
BUSY = PlainTextResponse("too many connections\n", 503, {"Retry-After": "5", "Connection": "close"})


@dataclass(frozen=True, slots=True)
class Limits:
    """Time and number of connections."""

    request: float = 10.0
    """Seconds from the connection, or the end of the last response, until a request is complete (guess)."""
    stall: float = 60.0
    """Seconds without progress of a response, as nginx has them: systems report progress in steps of up to 1 MB."""
    connections: int = 256
    """Connections that are served at once: those of 42 browsers, which open 6 each."""
    refused: int = 64
    """Further connections that are told so (guess); those beyond are dropped."""


class Connection(H11Protocol):
    """HTTP connection with deadlines. In a server that is full, it tells the client so."""

    def __init__(self, limits: Limits, **made: Any) -> None:
        super().__init__(**made)
        self.is_refused = False
        self._limits, self._drains = limits, 0
        self._state: tuple[object, ...] = ()
        self._since = 0.0  # s, when the state was first seen

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        served = sum(not one.is_refused for one in self.connections if isinstance(one, Connection))
        super().connection_made(transport)
        self.is_refused = served >= self._limits.connections
        if self.is_refused:
            self.app = BUSY
        if len(self.connections) > self._limits.connections + self._limits.refused:
            transport.abort()

    def resume_writing(self) -> None:
        self._drains += 1
        super().resume_writing()

    def send_400_response(self, msg: str) -> None:
        if self.cycle is not None and not self.cycle.response_complete:
            self.cycle.disconnected = True  # or its response would follow, which is an error now
            self.cycle.message_event.set()
        try:
            super().send_400_response(msg)
        except h11.LocalProtocolError:  # what is malformed arrives during a response
            self.transport.abort()

    def expire(self, now: float) -> None:
        """Close the connection if it has been in the same state for too long; to be called often, `now` in seconds."""
        unsent = self.transport.get_write_buffer_size() > 0
        is_asking = self.cycle is None or self.cycle.response_complete
        state = (self.cycle, is_asking, unsent, self._drains)
        if state != self._state:
            self._state, self._since = state, now
        elif unsent and now - self._since > self._limits.stall:
            line: socket.socket = self.transport.get_extra_info("socket")
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, NO_LINGER)
            self.transport.abort()
        elif is_asking and not unsent and now - self._since > self._limits.request:
            self.transport.close()


class Server(uvicorn.Server):
    """Server with limits of connections, whose process ends soon after a signal."""

    def __init__(self, config: uvicorn.Config, limits: Limits) -> None:
        super().__init__(config)
        self._limits, self._ended = limits, threading.Event()

    async def startup(self, sockets: Any = None) -> None:
        await super().startup(sockets=[])  # listens to none: uvicorn has no limit for the handshake of TLS
        loop, encryption = asyncio.get_running_loop(), self.config.ssl
        patience = self._limits.request if encryption else None
        made = {"config": self.config, "server_state": self.server_state, "app_state": self.lifespan.state}
        for one in sockets:
            options = {"sock": one, "ssl": encryption, "ssl_handshake_timeout": patience, "backlog": BACKLOG}
            self.servers.append(await loop.create_server(partial(Connection, self._limits, **made), **options))

    async def on_tick(self, counter: int) -> bool:
        for connection in list(self.server_state.connections):
            if isinstance(connection, Connection):
                connection.expire(time.monotonic())
        return await super().on_tick(counter)

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        super().handle_exit(sig, frame)
        code = 0 if sig == signal.SIGINT else 128 + sig  # also where it takes long, Ctrl-C is the regular end
        timer = threading.Timer(LAST_RESORT, self._leave, [code])
        timer.daemon = True
        timer.start()

    def run(self, sockets: Any = None) -> None:
        try:
            super().run(sockets)
        finally:
            self._ended.set()

    def _leave(self, code: int) -> None:
        """End the process if the server still runs, or if the program has ended but a thread does not."""
        if not self._ended.is_set() or not threading.main_thread().is_alive():
            os._exit(code)


def is_news(record: logging.LogRecord) -> bool:
    """Return whether a log record reports more than a response that ends with the server, or one that we cut short."""
    cancelled = record.exc_info is not None and isinstance(record.exc_info[1], asyncio.CancelledError)
    known = ("timeout graceful shutdown exceeded", "returned without completing response")
    return not cancelled and not any(text in record.getMessage() for text in known)


def room_for_files(limits: Limits) -> Limits:
    """Let this process open the files that the limits need; where the system refuses, return limits that fit."""
    try:
        import resource
    except ModuleNotFoundError:  # Windows has no such limit
        return limits
    own, each = 64, 2  # files of the process itself (guess), and for a connection: its socket and a file
    wanted = own + limits.refused + each * limits.connections
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    unlimited = resource.RLIM_INFINITY
    if soft == unlimited or soft >= wanted:
        return limits
    allowed = wanted if hard == unlimited else min(wanted, hard)
    resource.setrlimit(resource.RLIMIT_NOFILE, (allowed, hard))
    return Limits(limits.request, limits.stall, max((allowed - own - limits.refused) // each, 1), limits.refused)
