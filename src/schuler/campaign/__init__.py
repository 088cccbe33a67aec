"""Campaigns: a scenario simulated and aligned many times, to see whether sigma is what it says.

A campaign is cut into chunks of runs. Each is a pure function of scenario, place in the sweep and
numbers of its runs, so that it does not matter who works on it, when, or how often a machine was
switched off in between. Dask lives only here.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from schuler.campaign.plan import Campaign as Campaign
    from schuler.campaign.run import Results as Results
    from schuler.campaign.run import run_campaign as run_campaign

# Resolved on first use: a worker process sets its number of threads before NumPy is loaded.
_PUBLIC = {
    "Campaign": "schuler.campaign.plan",
    "Results": "schuler.campaign.run",
    "run_campaign": "schuler.campaign.run",
}

__all__ = ["Campaign", "Results", "run_campaign"]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'schuler.campaign' has no attribute '{name}'")
    return getattr(import_module(_PUBLIC[name]), name)
