"""What else was measured on a vehicle: fixes, speeds, heights, headings, and when it stood still.

These are values with their times and noise. How a filter takes them is in `schuler.ins`, how files
of them are read in `schuler.io`, and `schuler.navigation.navigate_aided` puts them together.
"""

from schuler.aiding.body_velocity import FRAMES, BodyVelocity
from schuler.aiding.clock import CLOCKS, no_overlap
from schuler.aiding.fix_rows import FixSetting, rows_of
from schuler.aiding.gnss import GnssFixes
from schuler.aiding.heading import HeadingFixes
from schuler.aiding.height import Height, pressure_height
from schuler.aiding.speed import BodySpeed
from schuler.aiding.still import RestDetector, Rests, find_rest
from schuler.aiding.stream_clock import StreamClock
from schuler.aiding.zero_rate import ZeroRate
from schuler.aiding.zero_velocity import ZeroVelocity

__all__ = [
    "CLOCKS",
    "FRAMES",
    "BodySpeed",
    "BodyVelocity",
    "FixSetting",
    "GnssFixes",
    "HeadingFixes",
    "Height",
    "RestDetector",
    "Rests",
    "StreamClock",
    "ZeroRate",
    "ZeroVelocity",
    "find_rest",
    "no_overlap",
    "pressure_height",
    "rows_of",
]
