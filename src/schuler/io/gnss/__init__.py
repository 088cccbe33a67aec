"""Reading GNSS fixes: a reader for each format, chosen by what a file begins with."""

from schuler.io.gnss.registry import aid_reader, gnss_readers
from schuler.io.gnss.table import FixTable, GnssOptions, GnssReader

__all__ = ["FixTable", "GnssOptions", "GnssReader", "aid_reader", "gnss_readers"]
