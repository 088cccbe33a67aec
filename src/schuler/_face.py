"""Rooms that share their name with the function they are for: `schuler.align(record, site)`."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

__all__ = ["callable_room"]


class _CallableRoom(ModuleType):
    """A module that, called, calls its function of the same name."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return self.__dict__[self.__name__.rpartition(".")[2]](*args, **kwargs)


def callable_room(name: str) -> None:
    """Let ``schuler.align`` be both the room and its function.

    Python binds a subpackage's name in its parent as soon as it is imported, so a function of the
    same name would be hidden by whichever import came last.

    Parameters
    ----------
    name : str
        The room's ``__name__``.
    """
    sys.modules[name].__class__ = _CallableRoom
