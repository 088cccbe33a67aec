"""Bags of ROS opened through rosbags, once it is known that what they announce is bounded."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from schuler.errors import InputError, how_to_install, shown
from schuler.io.expansion import expansion
from schuler.io.limits import check_size, largest

__all__ = ["MCAP", "ROS1", "is_ros1", "opened", "raw_messages"]

ROS1 = b"#ROSBAG V2.0"
MCAP = b"\x89MCAP0\r\n"

_FOOTER = 37
_CHUNK, _CHUNK_INDEX = 0x06, 0x08
_CODECS = {b"BZh": "bz2", b"\x04\x22\x4d\x18": "lz4"}
#: a message of sensor_msgs/Imu has about 350 bytes
_MESSAGE = 1 << 20


def is_ros1(path: Path) -> bool:
    """Say whether a path is a bag of ROS 1."""
    if path.is_dir():
        return False
    with path.open("rb") as file:
        return file.read(len(ROS1)) == ROS1


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Open a bag, whatever its kind and name; say its damage in one sentence.

    Raises
    ------
    InputError
        If rosbags is missing, the bag is damaged, or a chunk expands to more than is taken.
    """
    try:
        from rosbags import rosbag1, rosbag2
    except ImportError:
        raise InputError(f"is a ROS bag, which needs rosbags: {how_to_install('ros')}") from None
    try:
        if path.is_dir():
            for part in sorted(path.iterdir()):
                _check_part(part)
            bag: Any = rosbag2.Reader(path)
        elif is_ros1(path):
            bag = rosbag1.Reader(path)
        else:
            _check_part(path)
            with path.open("rb") as file:
                kind = ".mcap" if file.read(len(MCAP)) == MCAP else ".db3"
            bag = rosbag2.Reader.STORAGE_PLUGINS[kind](path)
        bag.open()
    except InputError:
        raise
    except Exception as error:  # rosbags lets many kinds escape from damaged files
        raise _damaged(error) from None
    try:
        for storage in _storages(bag):
            _check_storage(storage)
        yield bag
    except (InputError, GeneratorExit):
        raise
    except Exception as error:  # as above
        raise _damaged(error) from None
    finally:
        bag.close()


def raw_messages(bag: Any, topic: str, types: tuple[str, ...]) -> Iterator[bytes]:
    """Yield the messages of a topic; those that are compressed one by one are expanded."""
    import pyarrow as pa

    if getattr(bag, "compression_mode", None) != "message":
        chosen = [c for c in bag.connections if c.topic == topic and c.msgtype in types]
        for _, _, data in bag.messages(chosen):
            yield data
        return
    for storage in _storages(bag):
        chosen = [c for c in storage.connections if c.topic == topic and c.msgtype in types]
        for _, _, data in storage.messages(chosen) if chosen else ():
            with pa.input_stream(pa.BufferReader(data), compression="zstd") as stream:
                whole = stream.read(_MESSAGE + 1)
            if len(whole) > _MESSAGE:
                raise InputError(f"topic '{topic}' has a message of more than {_MESSAGE} bytes")
            yield whole


def _storages(bag: Any) -> list[Any]:
    """Return the files of a bag as rosbags opened them: several in a folder."""
    inner = getattr(bag, "storage", bag)
    return getattr(inner, "storages", None) or [inner]


def _check_part(path: Path) -> None:
    """Check what rosbags expands while it opens a file: MCAP without an index, and .zstd."""
    if not path.is_file():
        return
    size = path.stat().st_size
    with path.open("rb") as file:
        if path.suffix == ".zstd":
            check_size(expansion(file, 0, size, "zstd", largest(size)), size, f"'{path.name}'")
        elif file.read(len(MCAP)) == MCAP and not _has_index(file, size):
            _walk(file, size)


def _has_index(file: IO[bytes], size: int) -> bool:
    """Say whether an MCAP file's summary names its chunks."""
    if size < 2 * _FOOTER:
        return False
    file.seek(size - _FOOTER + 9)
    place = int.from_bytes(file.read(8), "little")
    if not 0 < place < size:
        return False
    return any(kind == _CHUNK_INDEX for kind, _, _ in _records(file, place, size))


def _records(file: IO[bytes], place: int, size: int) -> Iterator[tuple[int, int, int]]:
    """Yield the kind of each record, where its content begins, and its length."""
    while place + 9 <= size:
        file.seek(place)
        kind, length = struct.unpack("<BQ", file.read(9))
        if not kind or length > size - place - 9:
            return
        yield kind, place + 9, length
        place += 9 + length


def _walk(file: IO[bytes], size: int) -> None:
    """Check the chunks of an MCAP file that is read from its beginning to its end."""
    end = len(MCAP)
    for kind, begin, length in _records(file, end, size - len(MCAP)):
        end = begin + length
        if kind == _CHUNK and length >= 40:
            file.seek(begin + 16)
            announced, _, name = struct.unpack("<QII", file.read(16))
            codec = file.read(min(name, 16)).decode("latin-1")
            data = begin + 40 + name
            _check_chunk(file, size, data, length - 40 - name, codec, announced)
    if size - len(MCAP) - end >= 9:
        raise InputError(f"is a damaged or truncated ROS bag (no record at byte {end})")


def _check_storage(storage: Any) -> None:
    """Check the chunks that an opened bag's index names."""
    chunks = getattr(storage, "chunks", None)
    if not chunks:
        return
    path = Path(storage.path)
    size = path.stat().st_size
    with path.open("rb") as file:
        if isinstance(chunks, dict):
            for chunk in chunks.values():
                file.seek(chunk.datapos)
                head = file.read(4)
                codec = next((name for mark, name in _CODECS.items() if head.startswith(mark)), "")
                _check_chunk(file, size, chunk.datapos, chunk.datasize, codec, 0)
            return
        for chunk in chunks:
            begin = chunk.chunk_start_offset + 9 + 40 + len(chunk.compression)
            _check_chunk(
                file, size, begin, chunk.compressed_size, chunk.compression, chunk.uncompressed_size
            )


def _check_chunk(
    file: IO[bytes], size: int, begin: int, length: int, codec: str, announced: int
) -> None:
    check_size(announced, size, f"the chunk at byte {begin}")
    if codec in ("zstd", "lz4", "bz2") and 0 < begin < size:
        found = expansion(file, begin, min(length, size - begin), codec, largest(size))
        check_size(found, size, f"the chunk at byte {begin}")


def _damaged(error: Exception) -> InputError:
    reason = (str(error).splitlines() or [""])[0] or type(error).__name__
    return InputError(f"is a damaged or truncated ROS bag ({shown(reason)[:120]})")
