"""The prefilters by name, and chains of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from schuler._options import Registry, split_outside
from schuler.errors import InputError
from schuler.prefilter.base import Chain, Prefilter
from schuler.prefilter.emd import Emd
from schuler.prefilter.gate import Gate
from schuler.prefilter.hankel import Hankel
from schuler.prefilter.lowpass import LowPass
from schuler.prefilter.velocity import VelocityEmd
from schuler.prefilter.wavelet import Wavelet

__all__ = ["PREFILTERS", "parse_prefilter"]

#: the names of the command line and of scenario files
PREFILTERS: Registry[Prefilter] = Registry(
    "prefilter", Prefilter, "schuler.prefilters",
    lambda: {
        "emd": Emd(),
        "emd-velocity": VelocityEmd(),
        "emd-velocity-improved": VelocityEmd(ends="pattern", clean=20),
        "gate": Gate(),
        "gate-printed": Gate(two_sided=False),
        "hankel": Hankel(),
        "lowpass": LowPass(),
        "lowpass-zero-phase": LowPass(zero_phase=True),
        "wavelet": Wavelet(),
    },
)  # fmt: skip


def parse_prefilter(value: Any) -> Prefilter | None:
    """Return a prefilter, or a chain of them.

    Parameters
    ----------
    value : str, mapping, list or Prefilter
        ``"lowpass(0.05 Hz), gate(0.003)"`` (or with ``|``), a table with name and options, or a
        list of texts and tables; None and "none" are none.

    Raises
    ------
    InputError
        For an unknown name or option, or a value that cannot be meant.

    Examples
    --------
    >>> parse_prefilter("lowpass(0.05 Hz), gate(0.003)")
    Chain(filters=(LowPass(cutoff=0.05, order=2, kind='butterworth', zero_phase=False, \
start_span=300.0, channels='accel', frame='inertial'), \
Gate(width=0.003, two_sided=True, gravity=None)))
    """
    if value is None or isinstance(value, Prefilter):
        return value
    if isinstance(value, str):
        if value.strip().lower() == "none":
            return None
        links = [PREFILTERS.parse(part) for part in split_outside(value, ",|")]
    elif isinstance(value, Mapping):
        links = [PREFILTERS.from_table(value)]
    elif isinstance(value, list | tuple) and value:
        found = [parse_prefilter(part) for part in value]
        links = [each for each in found if each is not None]
        if len(links) < len(found):
            raise InputError("'none' is no part of a chain of prefilters")
    else:
        raise InputError(f"a prefilter is a text or a table with its name, got {value!r}")
    return links[0] if len(links) == 1 else Chain(tuple(links))
