"""Transfer alignment: a slave unit is aligned by a master on the same vehicle."""

from schuler.alignment.transfer.free import FreeRun, free_run
from schuler.alignment.transfer.master import MasterNoise
from schuler.alignment.transfer.result import ByMaster, TransferAlignment
from schuler.alignment.transfer.run import transfer
from schuler.alignment.transfer.setup import MATCHES, Flexure

__all__ = [
    "MATCHES",
    "ByMaster",
    "Flexure",
    "FreeRun",
    "MasterNoise",
    "TransferAlignment",
    "free_run",
    "transfer",
]
