"""Runs the server until it is interrupted. In: an application, a host, a port. Out: nothing; addresses are told."""

from __future__ import annotations

import socket
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import uvicorn
from cyclopts import Parameter
from starlette.applications import Starlette

from ..errors import InputError

LOCAL = "127.0.0.1"
EVERYWHERE = ("0.0.0.0", "::")


@dataclass(frozen=True, slots=True)
class ServerOptions:
    """Where the server listens."""

    host: str = LOCAL
    """The address to listen on; 0.0.0.0: all of this machine, for a headset in the same network."""
    port: int = 0
    """The port; 0: any that is free."""
    https: Annotated[bool, Parameter(negative="")] = False
    """Encrypt, with a certificate made for this run: headsets enter VR from other machines only so."""

    def __post_init__(self) -> None:
        if not 0 <= self.port <= 65_535:
            raise InputError(f"--port {self.port}: give a number in 0 .. 65535, or none for any that is free")


def run(app: Starlette, options: ServerOptions, told: Callable[[list[str]], None]) -> None:
    """Serves until SIGINT or SIGTERM. `told` hears the addresses as soon as they answer.

    Raises InputError where the host is not known or the port is taken.
    """
    with _listening(options) as listener, _certificate(options) as (key, chain):
        config = uvicorn.Config(app, log_level="warning", access_log=False, ssl_keyfile=key, ssl_certfile=chain)
        told(addresses(options, listener.getsockname()[1]))
        uvicorn.Server(config).run(sockets=[listener])


def addresses(options: ServerOptions, port: int) -> list[str]:
    """What to type into a browser: here, and, where the server listens to all, on other machines."""
    scheme = "https" if options.https else "http"
    hosts = ["localhost", *_own_addresses()] if options.host in EVERYWHERE else [options.host]
    return [f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}/" for host in hosts]


@contextmanager
def _listening(options: ServerOptions) -> Iterator[socket.socket]:
    try:
        found = socket.getaddrinfo(options.host, options.port, type=socket.SOCK_STREAM)[0]
        listener = socket.create_server(found[4][:2], family=found[0])
    except OSError as error:
        remedy = "give another --port, or none for any that is free" if options.port else "give another --host"
        place, why = f"{options.host}:{options.port}", error.strerror or error
        raise InputError(f"cannot listen on {place}: {why}; {remedy}") from error
    with listener:
        yield listener


@contextmanager
def _certificate(options: ServerOptions) -> Iterator[tuple[Path | None, Path | None]]:
    """Files of a key and a certificate that nobody else has signed, gone when the server ends; none without HTTPS."""
    if not options.https:
        yield None, None
        return
    import trustme

    names = dict.fromkeys(["localhost", LOCAL, *_own_addresses()])
    made = trustme.CA().issue_cert(*names)
    with tempfile.TemporaryDirectory() as folder:
        key, chain = Path(folder) / "key.pem", Path(folder) / "chain.pem"
        made.private_key_pem.write_to_path(str(key))
        for number, part in enumerate(made.cert_chain_pems):
            part.write_to_path(str(chain), append=number > 0)
        yield key, chain


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
