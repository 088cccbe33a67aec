"""Scenario files: site, motion, instrument and seed in TOML, checked line by line.

pydantic is imported only here.
"""

from __future__ import annotations

from schuler.config.load import load_scenario, parse_scenario
from schuler.config.override import parse_overrides, parse_sweep
from schuler.config.scenario import Scenario

__all__ = ["Scenario", "load_scenario", "parse_overrides", "parse_scenario", "parse_sweep"]
