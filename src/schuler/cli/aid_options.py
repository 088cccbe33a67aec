"""What the options of aids say, for every command that takes aids."""

from __future__ import annotations

from schuler.cli.path_output import triple
from schuler.errors import InputError, near

__all__ = ["estimates_of", "lever_of", "sigmas_of"]

_ESTIMATES = ("delay", "lever", "mount", "scale")


def lever_of(text: str | None, option: str) -> tuple[float, float, float]:
    """Return three numbers with commas; nothing is a lever arm of nothing."""
    return (0.0, 0.0, 0.0) if text is None else triple(text, option)


def sigmas_of(text: str | None) -> tuple[float | None, float | None]:
    """Return 1-sigma of position and velocity, m and m/s."""
    if text is None:
        return None, None
    try:
        position, speed = (float(cell.strip().rstrip("m/s")) for cell in text.split(","))
    except ValueError:
        raise InputError(f"--gnss-sigma: expected two numbers as 3,0.1, got '{text}'") from None
    if not (position > 0.0 and speed > 0.0):
        raise InputError(f"--gnss-sigma: both must be positive, got '{text}'")
    return position, speed


def estimates_of(text: str | None) -> set[str]:
    """Return which of delay, lever, mount and scale are estimated."""
    wanted = {part.strip() for part in text.split(",")} if text else set()
    unknown = wanted - set(_ESTIMATES)
    if unknown:
        name = min(unknown)
        raise InputError(
            f"--estimate: '{name}'{near(name, _ESTIMATES)} is none of {', '.join(_ESTIMATES)}"
        )
    return wanted
