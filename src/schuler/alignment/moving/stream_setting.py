"""What a stream of samples and fixes is aligned with."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from schuler.aiding.fix_rows import FixSetting
from schuler.errors import InputError
from schuler.sensors import ImuSpec

__all__ = ["StreamSetting"]


@dataclass(frozen=True)
class StreamSetting:
    """What a stream is aligned with.

    Parameters
    ----------
    spec : ImuSpec, str or path, optional
    antenna : FixSetting
    latency : float
        s by which a fix may be later than the samples of its instant: so long these wait for it.
    keep : float
        s of samples and fixes over which passes run back and forth.
    vibration : float, optional
        As of `align_moving`.

    Raises
    ------
    InputError
        For times that are too short or too long.

    Examples
    --------
    >>> StreamSetting("tactical-fog", keep=120.0).latency
    1.0
    """

    spec: ImuSpec | str | Path | None = None
    antenna: FixSetting = field(default_factory=FixSetting)
    latency: float = 1.0
    keep: float = 300.0
    vibration: float | None = None

    def __post_init__(self) -> None:
        if not 0.0 <= self.latency <= 60.0:
            raise InputError(f"the latency of fixes is 0 to 60 s, got {self.latency:g}")
        if not 20.0 <= self.keep <= 3600.0:
            raise InputError(f"20 to 3600 s of samples are kept, got {self.keep:g}")
