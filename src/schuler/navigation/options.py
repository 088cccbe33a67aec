"""What a navigation takes for granted, as values: gravity and the vertical channel."""

from __future__ import annotations

import math
from dataclasses import dataclass

from schuler.errors import InputError

__all__ = ["GRAVITY_MODELS", "Gravity", "Vertical", "parse_gravity", "parse_vertical"]

GRAVITY_MODELS = ("somigliana", "somigliana1", "psins", "constant")
VERTICAL_MODES = ("free", "damped", "off")


@dataclass(frozen=True)
class Gravity:
    """A model of normal gravity, along the down axis alone.

    Parameters
    ----------
    model : {"somigliana", "somigliana1", "psins", "constant"}
        Somigliana on WGS-84 with the second-order term in height (NIMA TR8350.2, 2000, equations
        4-1 and 4-3); the same with 1 - 2h/a alone; PSINS's own series; one value everywhere.
    value : float or None
        For "constant", m/s^2; None takes Somigliana's at the start.

    Raises
    ------
    InputError
        For an unknown model, or a value that is no gravity.

    Examples
    --------
    >>> Gravity("constant", 9.7944).value
    9.7944
    """

    model: str = "somigliana"
    value: float | None = None

    def __post_init__(self) -> None:
        if self.model not in GRAVITY_MODELS:
            raise InputError(
                f"gravity must be one of {', '.join(GRAVITY_MODELS)}, got '{self.model}'"
            )
        if self.value is not None and self.model != "constant":
            raise InputError(f"gravity '{self.model}' takes no value; only 'constant' does")
        if self.value is not None and not 9.0 < self.value < 10.5:
            raise InputError(f"gravity on Earth is 9.76 to 9.84 m/s^2, got {self.value:g}")


@dataclass(frozen=True)
class Vertical:
    """What is done about the vertical channel, whose error grows by itself (e-fold in 9.5 min).

    Parameters
    ----------
    mode : {"free", "damped", "off"}
        Pure inertial; held to a height by a third-order loop; no vertical motion at all.
    height : float or None
        The height to hold to when damped, m; None takes the start's.
    time_constant : float
        Of the loop, s: its three poles are at -1/time_constant.

    Raises
    ------
    InputError
        For an unknown mode or a time constant that is not positive.

    Examples
    --------
    >>> start = sc.Start.from_alignment(site, fix)
    >>> path = sc.navigate(record, start, vertical=Vertical("damped", time_constant=20.0))
    >>> bool(abs(path.height[-1] - site.height) < 1.0)
    True
    """

    mode: str = "free"
    height: float | None = None
    time_constant: float = 30.0

    def __post_init__(self) -> None:
        if self.mode not in VERTICAL_MODES:
            raise InputError(
                f"vertical must be one of {', '.join(VERTICAL_MODES)}, got '{self.mode}'"
            )
        if self.height is not None and self.mode != "damped":
            raise InputError(f"vertical '{self.mode}' takes no height; only 'damped' does")
        if self.height is not None and not math.isfinite(self.height):
            raise InputError(f"the height to hold to must be finite, got {self.height}")
        if not (math.isfinite(self.time_constant) and self.time_constant > 0):
            raise InputError(f"a time constant must be positive, got {self.time_constant} s")

    @property
    def gains(self) -> tuple[float, float, float]:
        """Gains of velocity (1/s), acceleration (1/s^2) and its integral (1/s^3)."""
        r = 1.0 / self.time_constant
        # 2 g/R is what the pole of the free channel needs on top.
        return 3.0 * r, 3.0 * r * r + 3.08e-6, r**3


def _number(text: str, what: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{what}: expected a number, got '{text}'") from None


def parse_gravity(text: str | Gravity | None) -> Gravity:
    """Read ``"somigliana"`` ... or ``"constant=9.7944"``.

    Raises
    ------
    InputError
        If it is neither.

    Examples
    --------
    >>> parse_gravity("constant=9.7944").value
    9.7944
    """
    if isinstance(text, Gravity):
        return text
    model, equals, value = (text or "somigliana").partition("=")
    return Gravity(model.strip(), _number(value, "gravity") if equals else None)


def parse_vertical(text: str | Vertical | None) -> Vertical:
    """Read ``"free"``, ``"off"``, ``"damped"`` or ``"damped=HEIGHT"`` (m).

    Raises
    ------
    InputError
        If it is none of them.

    Examples
    --------
    >>> from schuler.navigation import parse_vertical
    >>> parse_vertical("free")
    Vertical(mode='free', height=None, time_constant=30.0)
    """
    if isinstance(text, Vertical):
        return text
    mode, equals, value = (text or "free").partition("=")
    return Vertical(mode.strip(), _number(value, "vertical") if equals else None)
