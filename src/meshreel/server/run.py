"""Runs the server until it is interrupted. In: an application, a host, a port. Out: nothing; addresses are told."""

from __future__ import annotations

import asyncio
import logging
import socket
import ssl
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Annotated

import uvicorn
from cyclopts import Parameter
from starlette.applications import Starlette

from ..errors import InputError

LOCAL = ("localhost", "127.0.0.1", "::1")
EVERYWHERE = ("0.0.0.0", "::")
PATIENCE = 1  # s, for answers that are under way when the server is stopped
UNKNOWN = "meshreel, for one run of its server"  # who signs
VALID = timedelta(days=365)  # of a certificate; browsers refuse those that hold for many years


@dataclass(frozen=True, slots=True)
class ServerOptions:
    """Where the server listens."""

    host: str = LOCAL[1]
    """The address to listen on; 0.0.0.0: all of this machine, for a headset in the same network."""
    port: int = 0
    """The port; 0: any that is free."""
    https: Annotated[bool, Parameter(negative="")] = False
    """Encrypt, with a certificate made for this run: headsets enter VR from other machines only so."""

    def __post_init__(self) -> None:
        if not 0 <= self.port <= 65_535:
            raise InputError(f"--port {self.port}: give a number in 0 .. 65535, or none for any that is free")

    @property
    def hosts(self) -> tuple[str, ...]:
        """The names that a browser may know the server by; those of this machine alone where nobody else can ask.

        A page of another site, whose name is made to lead here, so reads nothing (DNS rebinding).
        """
        return tuple(map(_bracketed, LOCAL)) if self.host in LOCAL else ("*",)


def run(app: Starlette, options: ServerOptions, told: Callable[[list[str]], None]) -> None:
    """Serves until SIGINT or SIGTERM. `told` hears the addresses as soon as they answer.

    Raises InputError where the host is not known or the port is taken.
    """
    logging.getLogger("uvicorn.error").addFilter(_is_news)
    with _listening(options) as listener:
        encryption = _encryption(listener.getsockname()[0]) if options.https else None
        config = uvicorn.Config(
            app,
            lifespan="off",
            ws="none",
            log_level="error",
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=PATIENCE,
            ssl_context_factory=(lambda *_: encryption) if encryption else None,
        )
        told(addresses(options, listener.getsockname()[1]))
        uvicorn.Server(config).run(sockets=[listener])


def addresses(options: ServerOptions, port: int) -> list[str]:
    """What to type into a browser: here, and, where the server listens to all, on other machines."""
    scheme = "https" if options.https else "http"
    hosts = ["localhost", *_own_addresses()] if options.host in EVERYWHERE else [options.host]
    return [f"{scheme}://{_bracketed(host)}:{port}/" for host in hosts]


def _bracketed(host: str) -> str:
    """As an address has it: one of version 6 in brackets."""
    return f"[{host}]" if ":" in host else host


@contextmanager
def _listening(options: ServerOptions) -> Iterator[socket.socket]:
    place = f"{options.host}:{options.port}"
    try:
        found = socket.getaddrinfo(options.host, options.port, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError) as error:  # UnicodeError: a name that is too long, or has empty parts
        raise InputError(f"cannot listen on {place}: {error}; give another --host, 0.0.0.0 for all") from error
    both = options.host == "::" and socket.has_dualstack_ipv6()
    try:
        listener = socket.create_server(found[4], family=found[0], dualstack_ipv6=both)
    except OSError as error:
        remedy = "give another --port, or none for any that is free" if options.port else "give another --host"
        raise InputError(f"cannot listen on {place}: {error.strerror or error}; {remedy}") from error
    with listener:
        yield listener


def _encryption(address: str) -> ssl.SSLContext:
    """TLS by a certificate that nobody else has signed, for the address and for this machine's own; it is not kept."""
    import trustme

    names = [name for name in dict.fromkeys([*LOCAL, *_own_addresses(), address]) if name not in EVERYWHERE]
    maker = trustme.CA(organization_name=UNKNOWN)
    now = datetime.now(UTC)
    made = maker.issue_cert(
        *names, organization_name=UNKNOWN, not_before=now - timedelta(days=1), not_after=now + VALID
    )
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    made.configure_cert(context)
    return context


def _own_addresses() -> list[str]:
    """This machine's own addresses of version 4, as far as its name and its routes tell."""
    found: dict[str, None] = {}
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(("192.0.2.1", 9))  # sends nothing: asks which address would be used
            found[probe.getsockname()[0]] = None
    except OSError:
        pass
    try:
        for *_, place in socket.getaddrinfo(socket.gethostname(), None, family=socket.AF_INET):
            found[str(place[0])] = None
    except OSError:
        pass
    return [address for address in found if not address.startswith("127.")]


def _is_news(record: logging.LogRecord) -> bool:
    """Whether a line of the log tells a fault: that answers under way end with the server is none."""
    cancelled = record.exc_info is not None and isinstance(record.exc_info[1], asyncio.CancelledError)
    return not cancelled and "timeout graceful shutdown exceeded" not in record.getMessage()
