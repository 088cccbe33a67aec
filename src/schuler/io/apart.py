"""Opening the accelerometers that a second file or topic holds, where the first has the gyros."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from schuler.errors import InputError, located
from schuler.io.content import Content, wrapped
from schuler.io.join import join
from schuler.io.mapping import Mapping
from schuler.io.registry import find_reader

__all__ = ["with_accelerometers"]

#: what a ROS 2 bag's folder is known by
_BAG = "metadata.yaml"
_HEAD = 1 << 16


def with_accelerometers(
    gyros: Content, mapping: Mapping, named: Path, path: Path, max_gap: float | None
) -> Content:
    """Open the accelerometers' file or topic, and join it with the gyros.

    Parameters
    ----------
    gyros : Content
    mapping : Mapping
        `accel_file` or `accel_topic` is said.
    named, path : Path
        The gyros' file as it was named, and where its content is.
    max_gap : float or None
        Longest gap that may be bridged, s.

    Raises
    ------
    InputError
        If there is no such file or topic, or the two cannot be joined.
    """
    label = f"topic '{mapping.accel_topic}'"
    own = Mapping()
    if mapping.accel_file is not None:
        path = Path(mapping.accel_file)
        label = f"'{path.name}'"
        # A mapping beside the first file names the second as it does itself.
        if not path.exists() and not path.is_absolute():
            path = named.parent / path
        if not path.is_file():
            raise InputError(f"the accelerometers' file {label} is not there")
        sidecar = path.with_name(path.name + ".toml")
        own = Mapping.from_toml(sidecar) if sidecar.is_file() else own
        mapping = replace(mapping, columns=None, format=None)
    mapping = replace(
        mapping.merged(own), sensor="accel", topic=mapping.accel_topic or mapping.topic
    )
    if path.is_dir():
        head = (path / _BAG).read_bytes()[:_HEAD]
    else:
        with path.open("rb") as file:
            head = file.read(_HEAD)
    with located(f"the accelerometers' {label}"):
        opened = find_reader(path, head, mapping.format).open(path, mapping)
    return join(gyros, wrapped(opened), mapping, max_gap, label)
