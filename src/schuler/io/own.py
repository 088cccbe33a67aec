"""What schuler writes about a record into its own files, and how it is read back."""

from __future__ import annotations

from typing import Any

from schuler._files import parse_json
from schuler.errors import InputError
from schuler.io.mapping import Mapping

__all__ = ["own_mapping", "own_name", "parse_own"]


def parse_own(text: str | bytes, where: str) -> dict[str, Any]:
    """Return the description that schuler wrote.

    Parameters
    ----------
    text : str or bytes
        JSON.
    where : str
        What messages call its place, ``"in its metadata"``.

    Raises
    ------
    InputError
        If it is not what schuler writes.
    """
    try:
        own = parse_json(text)
    except ValueError:
        own = None
    flags = ("coning_corrected", "sculling_corrected")
    if (
        not isinstance(own, dict)
        or not isinstance(own.get("name", ""), str)
        or not all(isinstance(own.get(flag, False), bool) for flag in flags)
    ):
        raise InputError(f"the description that schuler wrote {where} is damaged")
    return own


def own_mapping(own: dict[str, Any]) -> Mapping:
    """Return what schuler wrote about a record as a mapping."""
    return Mapping(
        gyro="rad",
        accel="m/s",
        time="s",
        axes="RFU",
        coning_corrected=bool(own.get("coning_corrected", False)),
        sculling_corrected=bool(own.get("sculling_corrected", False)),
    )


def own_name(own: dict[str, Any] | None) -> str | None:
    """Return the record's name, where it is said."""
    return str(own["name"]) if own and "name" in own else None
