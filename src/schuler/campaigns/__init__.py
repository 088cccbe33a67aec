"""Campaigns: a scenario simulated and aligned many times, to see whether sigma is what it says.

A campaign is cut into chunks of runs. Each is a pure function of scenario, place in the sweep and
numbers of its runs, so that it does not matter who works on it, when, or how often a machine was
switched off in between. Dask is imported only here.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from schuler.campaigns.plan import Campaign as Campaign
    from schuler.campaigns.run import Results as Results
    from schuler.campaigns.run import campaign as campaign

# Resolved on first use: a worker process sets its number of threads before NumPy is loaded.
_PUBLIC = {
    "Campaign": "schuler.campaigns.plan",
    "Results": "schuler.campaigns.run",
    "campaign": "schuler.campaigns.run",
}

__all__ = ["Campaign", "Results", "campaign"]


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'schuler.campaigns' has no attribute '{name}'")
    return getattr(import_module(_PUBLIC[name]), name)
