"""Where live samples come from: UDP, a serial port or standard input."""

from __future__ import annotations

import ipaddress
import sys
import time as clock
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from queue import Empty, Queue
from threading import Event, Thread
from typing import NamedTuple

from schuler.errors import InputError, installed

__all__ = ["Chunk", "LiveSource", "check_sender", "in_threads", "open_live_source"]

STEP = 0.1
"""Longest wait for data, s."""

_QUEUED = 100_000
"""Chunks of two sources that wait to be taken."""


class Chunk(NamedTuple):
    """Bytes as they came, none after a wait; the sender of a datagram; when; of which source."""

    data: bytes
    address: str | None = None
    arrived: float | None = None
    second: bool = False


class LiveSource(AbstractContextManager["LiveSource"]):
    """An open source.

    Parameters
    ----------
    name : str
        As ``udp:127.0.0.1:5005``: for port 0 with the port that the system chose.
    real_time : bool
        Whether data come when they are measured, and not as fast as a pipe lets them.
    """

    def __init__(
        self, name: str, real_time: bool, chunks: Iterator[Chunk], close: Callable[[], None]
    ) -> None:
        self.name, self.real_time, self.chunks = name, real_time, chunks
        self._close = close

    def close(self) -> None:
        """Release the source."""
        self._close()

    def __exit__(self, *_: object) -> None:
        self._close()


def open_live_source(source: str, baud: int = 115200) -> LiveSource:
    """Open ``udp:PORT``, ``udp:HOST:PORT``, ``serial:DEVICE`` or ``-``.

    Raises
    ------
    InputError
        If the source is none of these, or cannot be opened.
    """
    if source == "-":
        return LiveSource("standard input", False, _piped(), lambda: None)
    kind, _, rest = source.partition(":")
    if kind == "udp" and rest:
        return _udp(rest)
    if kind == "serial" and rest:
        return _serial(rest, baud)
    raise InputError(
        f"'{source}': a live source is udp:PORT, udp:HOST:PORT, serial:DEVICE or - (standard input)"
    )


def in_threads(first: LiveSource, second: LiveSource | None = None) -> LiveSource:
    """Return the chunks of one or two sources as they come; the end of the first is the end.

    Each is read by a thread of its own, so that nothing is lost while an alignment is computed.
    """
    sources = [source for source in (first, second) if source is not None]
    queue: Queue[Chunk | None] = Queue(_QUEUED)
    over = Event()

    def read(source: LiveSource, is_second: bool) -> None:
        """Put the chunks of a source into the queue, with the time of their arrival."""
        try:
            for chunk in source.chunks:
                if over.is_set():
                    return
                if chunk.data:
                    arrived = clock.monotonic() if source.real_time else None
                    queue.put(chunk._replace(arrived=arrived, second=is_second))
        finally:
            if not is_second:
                queue.put(None)

    threads = [
        Thread(target=read, args=(source, source is second), daemon=True) for source in sources
    ]

    def chunks() -> Iterator[Chunk]:
        """Yield the chunks of both as they come."""
        for thread in threads:
            thread.start()
        while True:
            try:
                chunk = queue.get(timeout=STEP)
            except Empty:
                yield Chunk(b"")
                continue
            if chunk is None:
                return
            yield chunk

    def close() -> None:
        """End the threads, then release the sources."""
        over.set()
        for thread in threads:
            # A reader looks up after a step, unless it waits for a queue that is full.
            while thread.is_alive():
                while not queue.empty():
                    queue.get_nowait()
                thread.join(STEP)
        for source in sources:
            source.close()

    name = " and ".join(source.name for source in sources)
    return LiveSource(name, first.real_time, chunks(), close)


def check_sender(text: str, source: str, option: str = "--from") -> str:
    """Return ``ADDRESS`` or ``ADDRESS:PORT`` of a sender of datagrams as it is compared.

    Raises
    ------
    InputError
        If it is no IPv4 address, or the source has no addresses.
    """
    if not source.startswith("udp:"):
        raise InputError(f"{option} {text}: only udp: sources have senders with addresses")
    host, colon, port = text.partition(":")
    try:
        host = str(ipaddress.IPv4Address(host))
        if colon and not 0 < int(port) < 65536:
            raise ValueError
    except ValueError:
        raise InputError(
            f"{option} {text}: expected an IPv4 address, as 192.168.0.7 or 192.168.0.7:5005"
        ) from None
    return f"{host}:{int(port)}" if colon else host


def _piped() -> Iterator[Chunk]:
    from schuler.io.flow import readable

    file = sys.stdin.buffer
    while True:
        if not readable(file, STEP):
            yield Chunk(b"")
            continue
        data = file.read1(65536)  # type: ignore[union-attr]
        if not data:
            return
        yield Chunk(data)


def _udp(where: str) -> LiveSource:
    import socket

    host, _, text = where.rpartition(":")
    if not (text.isascii() and text.isdigit() and int(text[:6]) < 65536):
        raise InputError(f"udp:{where}: expected a port from 0 to 65535, got '{text}'")
    receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
    receiver.settimeout(STEP)
    try:
        receiver.bind((host or "127.0.0.1", int(text)))
    except (OSError, UnicodeError, ValueError) as error:
        receiver.close()
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"udp:{where}: cannot listen there ({reason})") from None
    bound = "{}:{}".format(*receiver.getsockname())

    def chunks() -> Iterator[Chunk]:
        """Yield what arrives, with its sender."""
        while True:
            try:
                data, (sender, port) = receiver.recvfrom(65536)
            except TimeoutError:
                yield Chunk(b"")
                continue
            except OSError:
                # The interface is gone: what came is what there is.
                return
            yield Chunk(data, f"{sender}:{port}")

    return LiveSource(f"udp:{bound}", True, chunks(), receiver.close)


def _serial(device: str, baud: int) -> LiveSource:
    with installed("a serial port needs pyserial", "live"):
        import serial
    try:
        port = serial.Serial(device, baud, timeout=STEP)
    except (OSError, ValueError) as error:
        raise InputError(f"serial:{device}: cannot be opened ({error})") from None

    def chunks() -> Iterator[Chunk]:
        while True:
            try:
                yield Chunk(port.read(max(1, port.in_waiting)))
            except OSError:
                # The port is gone: what came is what there is.
                return

    return LiveSource(f"serial:{device}", True, chunks(), port.close)
