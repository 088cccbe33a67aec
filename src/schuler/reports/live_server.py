"""Serve the page of a live alignment: one page, and its state as server-sent events.

On loopback anybody on this machine may look; on any other address only who has the key. A page of
another site cannot read it: there are no headers that would allow that, and a request whose Host
is a name that somebody else's name server could answer for is refused (DNS rebinding).
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import threading
from contextlib import AbstractContextManager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from socket import AF_INET6
from typing import Any
from urllib.parse import parse_qs, urlsplit

from schuler.errors import InputError
from schuler.reports.live_page import LivePage, page_html

__all__ = ["LiveServer", "allowed_host", "parse_address", "right_key"]

_PATIENCE = 10.0
"""A browser that neither asks nor takes for so long is let go, s."""

_ALIVE = 10.0
"""Time after which an unchanged stream shows that it is alive, s."""

_LAST = 3.0
"""Time that browsers have for the last state when the stream ends, s."""

_WATCHERS = 16
"""Most browsers at once."""


def parse_address(text: str, keyed: bool) -> tuple[str, int]:
    """Return host and port of ``HOST:PORT``, ``:PORT`` or ``PORT``.

    Parameters
    ----------
    text : str
        Without a host: loopback. Port 0 lets the system choose.
    keyed : bool
        Whether there is a key, without which only loopback is allowed.

    Raises
    ------
    InputError
        If it is no address, or one that others reach and there is no key.

    Examples
    --------
    >>> parse_address(":8700", keyed=False)
    ('127.0.0.1', 8700)
    """
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]") if colon else ""
    if not (port.isascii() and port.isdigit() and int(port[:6]) < 65536):
        raise InputError(
            f"--page {text}: expected HOST:PORT or a port from 0 to 65535, as 127.0.0.1:8700"
        )
    host = "127.0.0.1" if host in ("", "localhost") else host
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        raise InputError(
            f"--page {text}: '{host}' is no IP address; say one of this machine, or 0.0.0.0; "
            "--page without an address stands behind the source"
        ) from None
    if not address.is_loopback and not keyed:
        raise InputError(
            f"--page {text}: others reach this address: say --page-key-file, and only who has "
            "the key sees the page"
        )
    return host, int(port)


def allowed_host(header: str | None, loopback: bool) -> bool:
    """Say whether a request's Host is one that nobody else's name server can answer for.

    Parameters
    ----------
    header : str or None
        The header as it came.
    loopback : bool
        Whether the page is served on loopback, where other addresses are refused too.

    Examples
    --------
    >>> allowed_host("127.0.0.1:8700", loopback=True), allowed_host("evil.example:8700", True)
    (True, False)
    """
    # The port is left out: an SSH tunnel has another at its other end.
    try:
        host = urlsplit(f"//{header or ''}").hostname or ""
        if host == "localhost":
            return True
        address = ipaddress.ip_address(host)
    except ValueError:
        return False
    return address.is_loopback or not loopback


def right_key(key: bytes | None, query: str, authorization: str | None) -> bool:
    """Say whether a request has the key, in its address or a header, in constant time.

    Parameters
    ----------
    key : bytes or None
        None: there is no key, and all may look.
    query : str
        What follows the question mark of the address: ``key=...``.
    authorization : str or None
        The header: ``Bearer ...``.

    Examples
    --------
    >>> right_key(b"sixteen bytes ..", "key=sixteen+bytes+..", None)
    True
    >>> right_key(b"sixteen bytes ..", "", "Bearer another key")
    False
    """
    if key is None:
        return True
    # Bytes that are no text travel as percent signs and digits.
    values = parse_qs(query, encoding="latin-1", keep_blank_values=True)
    scheme, _, token = (authorization or "").partition(" ")
    given = [value.encode("latin-1", "replace") for value in values.get("key", ())[:1]]
    if scheme.lower() == "bearer":
        given.append(token.strip().encode("latin-1", "replace"))
    # Digests have one length: how long it takes says nothing of the key's length either.
    wanted = hashlib.sha256(key).digest()
    found = [hmac.compare_digest(hashlib.sha256(value).digest(), wanted) for value in given]
    return any(found)


class LiveServer(AbstractContextManager["LiveServer"]):
    """A page of a live alignment, served from threads of its own until it is closed.

    Parameters
    ----------
    page : LivePage
    address : tuple of str and int
        Host and port, of `parse_address`; port 0 lets the system choose.
    key : bytes, optional
        The key, without which a request is refused (403).

    Raises
    ------
    InputError
        If nothing can listen there.

    Examples
    --------
    >>> with LiveServer(LivePage("udp:127.0.0.1:5005"), ("127.0.0.1", 0)) as server:
    ...     server.url.startswith("http://127.0.0.1:"), server.watchers
    (True, 0)
    """

    def __init__(self, page: LivePage, address: tuple[str, int], key: bytes | None = None) -> None:
        self._page, self._key = page, key
        self._changed = threading.Condition()
        self._event, self._number, self._ended = page.event(), 1, False
        self.watchers = 0
        host, port = address
        server = type("_Server", (_Server,), {"address_family": AF_INET6} if ":" in host else {})
        try:
            self._server = server(address, _Handler)
        except (OSError, OverflowError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InputError(f"--page {host}:{port}: cannot listen there ({reason})") from None
        self._server.live = self
        self._loopback = ipaddress.ip_address(host).is_loopback
        self.port: int = self._server.server_address[1]
        self._host = f"[{host}]" if ":" in host else host
        self._thread = threading.Thread(
            target=self._server.serve_forever, args=(0.1,), name="schuler live page", daemon=True
        )
        self._thread.start()

    @property
    def url(self) -> str:
        """Where the page is, without the key."""
        return f"http://{self._host}:{self.port}/"

    def show(self) -> None:
        """Send the page's state, as it is now, to all browsers."""
        with self._changed:
            self._event, self._number = self._page.event(), self._number + 1
            self._changed.notify_all()

    def __exit__(self, *_: object) -> None:
        """Send the last state, wait until browsers have it, and close."""
        with self._changed:
            self._event, self._number, self._ended = self._page.event(), self._number + 1, True
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self.watchers, _LAST)
        self._server.shutdown()
        self._server.server_close()
        self._thread.join(_LAST)

    # -- for the threads of requests ------------------------------------------------------

    def refusal(self, headers: Any, query: str) -> tuple[HTTPStatus, str] | None:
        """Return why a request gets nothing, or None."""
        if not allowed_host(headers.get("Host"), self._loopback):
            return HTTPStatus.FORBIDDEN, "the Host of the request is not this server's address"
        if not right_key(self._key, query, headers.get("Authorization")):
            return HTTPStatus.FORBIDDEN, "the key is missing or wrong: add ?key=... to the address"
        return None

    def _next(self, sent: int) -> tuple[bytes, int, bool]:
        """Wait for a state that was not sent; return what to write, its number, whether it ends."""
        with self._changed:
            self._changed.wait_for(lambda: self._number > sent, _ALIVE)
            event = self._event if self._number > sent else b": alive\n\n"
            return event, self._number, self._ended

    def watch(self, write: Any) -> bool:
        """Write events until the stream ends; say no where there are too many browsers."""
        with self._changed:
            if self.watchers >= _WATCHERS:
                return False
            self.watchers += 1
        try:
            write(b"")
            sent, ended = 0, False
            while not ended:
                event, sent, ended = self._next(sent)
                write(event)
            return True
        finally:
            with self._changed:
                self.watchers -= 1
                self._changed.notify_all()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False
    live: LiveServer

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Let a browser go that closed, or was too slow; a fault of ours is said."""
        import sys

        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    server_version, sys_version = "schuler", ""
    timeout = _PATIENCE

    def do_GET(self) -> None:
        """Answer with the page or its events."""
        path, _, query = self.path.partition("?")
        live = self.server.live
        refused = live.refusal(self.headers, query)
        if refused is not None:
            self._text(*refused)
        elif path == "/":
            html, policy = page_html()
            self._begin(HTTPStatus.OK, "text/html; charset=utf-8", policy, html.encode())
        elif path == "/events":
            if not live.watch(self._events):
                self._text(HTTPStatus.SERVICE_UNAVAILABLE, "too many browsers look at this page")
        else:
            self._text(HTTPStatus.NOT_FOUND, "there is one page here: /")

    def _events(self, data: bytes) -> None:
        if not data:
            self._begin(HTTPStatus.OK, "text/event-stream", "default-src 'none'")
        self.wfile.write(data)
        self.wfile.flush()

    def _text(self, status: HTTPStatus, text: str) -> None:
        body = f"{text}\n".encode()
        self._begin(status, "text/plain; charset=utf-8", "default-src 'none'", body)

    def _begin(self, status: HTTPStatus, kind: str, policy: str, body: bytes | None = None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        if body is not None:
            self.send_header("Content-Length", str(len(body)))
        for name, value in (
            ("Cache-Control", "no-store"), ("Content-Security-Policy", policy),
            ("X-Content-Type-Options", "nosniff"), ("Referrer-Policy", "no-referrer"),
            ("Cross-Origin-Resource-Policy", "same-origin"),
        ):  # fmt: skip
            self.send_header(name, value)
        self.end_headers()
        if body is not None:
            self.wfile.write(body)

    def log_message(self, *_: Any) -> None:
        """Stay silent: standard error is the command's, and an address may hold the key."""
