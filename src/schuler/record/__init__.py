"""The record: what every reader makes and every method takes."""

from __future__ import annotations

from schuler.record.check import Reading, check_record
from schuler.record.imu import ImuRecord
from schuler.record.intake import Intake
from schuler.record.quality import Quality
from schuler.record.spikes import Spike, without_spikes
from schuler.record.summary import Stretch, Summariser, Summary

__all__ = [
    "ImuRecord", "Intake", "Quality", "Reading", "Spike", "Stretch", "Summariser", "Summary",
    "check_record", "without_spikes",
]  # fmt: skip
