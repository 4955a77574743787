"""Server loop until an interrupt. In: an application, a host and a port. Out: its addresses, by a callback."""

from __future__ import annotations

import asyncio
import logging
import socket
import ssl
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Annotated

import h11
import uvicorn
from cyclopts import Parameter
from starlette.applications import Starlette

from ..errors import InputError

LOCAL = ("localhost", "127.0.0.1", "::1")
EVERYWHERE = ("0.0.0.0", "::")
PATIENCE = 0  # s for responses in progress when the server stops, beyond the 0.1 s that uvicorn gives them
MOST_CONNECTIONS = 256  # at once, those of 42 browsers, which open 6 each; further requests are answered 503
IDLE = 10  # s until a connection is closed that asks for nothing more (guess)
UNKNOWN = "meshreel, for one run of its server"  # organization that signs the certificate
VALID = timedelta(days=365)  # validity of the certificate; Apple's systems refuse more than 825 days


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class ServerOptions:
    """Address and encryption of the server."""

    host: str = LOCAL[1]
    """Address to listen on; 0.0.0.0 for all addresses of this machine, as for a headset in the same network."""
    port: int = 0
    """Port; 0 for any free one."""
    https: Annotated[bool, Parameter(negative="")] = False
    """Encrypt with a certificate made for this run: headsets enter VR only from https pages of other machines."""

    def __post_init__(self) -> None:
        if not 0 <= self.port <= 65_535:
            raise InputError(f"--port {self.port}: give a number in 0 .. 65535, or 0 for any free port")

    @property
    def hosts(self) -> tuple[str, ...]:
        """Host names that requests may have; of a local server only local ones, against DNS rebinding by a site."""
        return tuple(map(_bracketed, LOCAL)) if self.host in LOCAL else ("*",)


def run(app: Starlette, options: ServerOptions, announce: Callable[[list[str]], None]) -> None:
    """Serve until SIGINT or SIGTERM; `announce` gets the addresses. Raises InputError for a host or a taken port."""
    logging.getLogger("uvicorn.error").addFilter(_is_news)
    with _listening(options) as listener:
        encryption = _encryption(listener.getsockname()[0]) if options.https else None
        config = uvicorn.Config(
            app,
            http="h11",
            lifespan="off",
            ws="none",
            log_level="error",
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=PATIENCE,
            timeout_keep_alive=IDLE,
            limit_concurrency=MOST_CONNECTIONS,
            ssl_context_factory=(lambda *_: encryption) if encryption else None,
        )
        with suppress(KeyboardInterrupt):
            announce(addresses(options, listener.getsockname()[1]))
            uvicorn.Server(config).run(sockets=[listener])


def _is_news(record: logging.LogRecord) -> bool:
    """Return whether a log record is worth reading: not of a response broken off by the server's end or a client."""
    error = record.exc_info and record.exc_info[1]
    is_broken_off = isinstance(error, asyncio.CancelledError | h11.LocalProtocolError)
    return not is_broken_off and "timeout graceful shutdown exceeded" not in record.getMessage()


def addresses(options: ServerOptions, port: int) -> list[str]:
    """Return the URLs of the server on this machine and, if it listens to all addresses, on others."""
    scheme = "https" if options.https else "http"
    hosts = ["localhost", *_own_addresses()] if options.host in EVERYWHERE else [options.host]
    return [f"{scheme}://{_bracketed(host)}:{port}/" for host in hosts]


def _bracketed(host: str) -> str:
    """Return a host as URLs contain it: IPv6 addresses in brackets."""
    return f"[{host}]" if ":" in host else host


def _listening(options: ServerOptions) -> socket.socket:
    place = f"{options.host}:{options.port}"
    try:
        found = socket.getaddrinfo(options.host, options.port, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError) as error:  # UnicodeError: a name that is too long or has empty parts
        raise InputError(f"cannot listen on {place}: {error}; give another --host, 0.0.0.0 for all") from error
    both = options.host == "::" and socket.has_dualstack_ipv6()
    try:
        return socket.create_server(found[4], family=found[0], dualstack_ipv6=both)
    except OSError as error:
        remedy = "give another --port, or 0 for any free port" if options.port else "give another --host"
        raise InputError(f"cannot listen on {place}: {error.strerror or error}; {remedy}") from error


def _encryption(address: str) -> ssl.SSLContext:
    """Return a TLS context with a self-signed certificate for the address and those of this machine; it is not kept."""
    import trustme

    names = [name for name in dict.fromkeys([*LOCAL, *_own_addresses(), address]) if name not in EVERYWHERE]
    maker = trustme.CA(organization_name=UNKNOWN)
    begin, end = datetime.now(UTC) - timedelta(days=1), datetime.now(UTC) + VALID
    made = maker.issue_cert(*names, organization_name=UNKNOWN, not_before=begin, not_after=end)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    made.configure_cert(context)
    return context


def _own_addresses() -> list[str]:
    """Return the IPv4 addresses of this machine that its host name and its routes reveal."""
    found: dict[str, None] = {}
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.connect(("192.0.2.1", 9))  # sends nothing; the socket then knows the local address
        found[probe.getsockname()[0]] = None
    with suppress(OSError):
        for *_, place in socket.getaddrinfo(socket.gethostname(), None, family=socket.AF_INET):
            found[str(place[0])] = None
    return [address for address in found if not address.startswith("127.")]
