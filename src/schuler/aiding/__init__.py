"""What else was measured on a vehicle that moves: GNSS fixes, speeds, and when it stood still.

These are values with their times and noise. How a filter takes them is in `schuler.ins`, how files
of them are read in `schuler.io.aiding`, and `schuler.navigation.navigate_aided` puts them together.
"""

from schuler.aiding.clock import CLOCKS, no_overlap
from schuler.aiding.gnss import GnssFixes
from schuler.aiding.speed import BodySpeed
from schuler.aiding.still import RestDetector, Rests, find_rest

__all__ = ["CLOCKS", "BodySpeed", "GnssFixes", "RestDetector", "Rests", "find_rest", "no_overlap"]
