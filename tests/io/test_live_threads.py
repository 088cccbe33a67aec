"""Two sources read by threads: what comes in the order of its arrival, and an end."""

from __future__ import annotations

import socket
import threading

from schuler.io.live_sources import Chunk, LiveSource, in_threads, open_live_source


def source(name, chunks, real_time=False):
    return LiveSource(name, real_time, iter(chunks), lambda: None)


def test_the_end_of_the_first_is_the_end():
    endless = (Chunk(b"") for _ in iter(int, 1))
    before = threading.active_count()
    with in_threads(source("one", [Chunk(b"a"), Chunk(b""), Chunk(b"b")]),
                    source("other", endless)) as both:  # fmt: skip
        got = [chunk for chunk in both.chunks if chunk.data]
        assert both.name == "one and other"
    assert [(chunk.data, chunk.second, chunk.arrived) for chunk in got] == [
        (b"a", False, None), (b"b", False, None),
    ]  # fmt: skip
    assert threading.active_count() == before


def test_datagrams_have_their_source_sender_and_arrival():
    with (
        in_threads(open_live_source("udp:0"), open_live_source("udp:0")) as both,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        ports = [int(part.rpartition(":")[2]) for part in both.name.split(" and ")]
        chunks = both.chunks
        for port, data in zip(ports, (b"imu", b"nmea"), strict=True):
            sender.sendto(data, ("127.0.0.1", port))
        got = {}
        while len(got) < 2:
            chunk = next(chunks)
            if chunk.data:
                got[chunk.second] = chunk
        assert (got[False].data, got[True].data) == (b"imu", b"nmea")
        for chunk in got.values():
            assert chunk.address == f"127.0.0.1:{sender.getsockname()[1]}"
            assert chunk.arrived is not None


def test_one_source_alone():
    with in_threads(source("one", [Chunk(b"a")])) as alone:
        assert [chunk.data for chunk in alone.chunks if chunk.data] == [b"a"]


def test_it_can_be_left_before_it_was_read():
    with in_threads(source("one", [Chunk(b"a")]), source("other", [Chunk(b"b")])):
        pass
