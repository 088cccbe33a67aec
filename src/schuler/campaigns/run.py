"""`campaign`: from a campaign to its results, going on where it was stopped."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from schuler._arrow import numbers
from schuler._result import Result, table_of_rows
from schuler.campaigns.chunk import AXES
from schuler.campaigns.execute import execute
from schuler.campaigns.plan import Campaign
from schuler.campaigns.scatter import Scatter
from schuler.campaigns.store import Store
from schuler.errors import InputError, SchulerError

__all__ = ["Results", "campaign"]


@dataclass(frozen=True, eq=False)
class Results(Result):
    """What a campaign found.

    Parameters
    ----------
    campaign : Campaign
    path : Path
        The Parquet file with a row for each run and method.
    table : pyarrow.Table
        Its content.
    resumed : int
        Runs that an earlier start had done.
    notes : tuple of str
        What was found damaged and computed again.
    """

    campaign: Campaign
    path: Path
    table: Any = field(repr=False)
    resumed: int = 0
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the summary with the keys of the JSON schema `schuler.campaign/2`."""
        scenario = self.campaign.scenario
        return {
            "schema": "schuler.campaign/2",
            "scenario": scenario.name,
            "scenario_sha256": scenario.digest,
            "seed": scenario.seed,
            "runs": self.campaign.runs,
            "results": str(self.path),
            "points": [scatter.to_dict() for scatter in self.scatters()],
        }

    def columns(self) -> dict[str, Any]:
        """Return a row to each place of the sweep and method; `table` has one to each run."""
        return table_of_rows([scatter.to_dict() for scatter in self.scatters()])

    def __str__(self) -> str:
        scatters, scenario = self.scatters(), self.campaign.scenario
        width = max([8, *(len(s.label) for s in scatters)])
        swept = bool(self.campaign.sweep)
        head = f"{'place':<{width}}  " if swept else ""
        lines = [
            f"{scenario.name}: {self.campaign.runs} runs of {scenario.duration:g} s, heading error "
            "against the truth, arcmin",
            f"{head}{'method':<18}{'mean':>8}{'std':>8}{'rms':>8}{'sigma':>8}{'limit':>8}"
            f"{'rms/lim':>9}{'NEES/3':>8}  consistent within",
        ]
        for s in scatters:
            place = f"{s.label:<{width}}  " if swept else ""
            low, high = s.nees_band
            lines.append(
                f"{place}{s.method:<18}{s.mean:>8.3f}{_cell(s.std):>8}{s.rms:>8.3f}"
                f"{s.predicted:>8.3f}{_cell(s.bound):>8}{_cell(s.ratio, 2):>9}"
                f"{s.nees_ratio:>8.2f}  {low:.2f} to {high:.2f}"
            )
        return "\n".join([*lines, f"results {self.path}"])

    def scatters(self) -> list[Scatter]:
        """Return how the errors scatter, for each place of the sweep and each method."""
        point = numbers(self.table.column("point"))
        method = np.array(self.table.column("method").to_pylist())
        out = []

        def columns(name: str, rows: Any) -> Any:
            return np.column_stack([numbers(self.table.column(f"{name}_{a}"))[rows] for a in AXES])

        for place in self.campaign.points:
            for name in place.methods:
                rows = (point == place.number) & (method == name)
                out.append(
                    Scatter(
                        name, dict(place.values), columns("phi", rows), columns("sigma", rows),
                        columns("limit", rows), numbers(self.table.column("nees"))[rows],
                        numbers(self.table.column("heading_error"))[rows],
                    )
                )  # fmt: skip
        return out


def _cell(value: float | None, digits: int = 3) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def campaign(
    plan: Campaign,
    out: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Results:
    """Run a campaign into a folder; stopped at any moment and called again, it goes on.

    Results are the same bytes for any number of workers and any interruptions.

    Parameters
    ----------
    plan : Campaign
    out : str or Path
        Folder; `results.parquet` in it is the result.
    workers : int, optional
        None: a process for each core (a script must then guard its start by
        ``if __name__ == "__main__":``); 0: this process alone; else a local Dask cluster.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://host:8786``, whose workers have the same schuler.
    progress : callable, optional
        Called with the runs that are done and the runs in all.

    Raises
    ------
    InputError
        If the folder holds another campaign or is in use, or a run cannot be aligned.
    SchulerError
        If workers die again and again, or Dask is missing.

    Examples
    --------
    >>> plan = sc.Campaign(sc.load_scenario("truck.toml"), 2)
    >>> results = sc.campaign(plan, "out", workers=0)
    >>> len(results.scatters())
    1
    """
    if workers is not None and workers < 0:
        raise InputError(f"--workers must be 0 or more, got {workers}")
    if workers is not None and scheduler is not None:
        raise InputError("--workers makes a cluster and --scheduler names one: give one of them")
    store = Store(plan, out)
    tell = progress or (lambda done, total: None)
    with store.held():
        table = store.finished()
        if table is not None:
            store.clear()
            tell(plan.total, plan.total)
            return Results(plan, store.results, table, plan.total, tuple(store.notes))
        left, resumed = [], 0
        for chunk in plan.chunks():
            if store.load(chunk) is None:
                left.append(chunk)
            else:
                resumed += chunk.count
        done = resumed
        tell(done, plan.total)
        for chunk, data in execute(iter(left), workers, scheduler):
            store.save(chunk, data)
            done += chunk.count
            tell(done, plan.total)
        table = store.assemble()
    if table is None:
        raise SchulerError(f"{store.results}: was written but cannot be read; is the disk full?")
    return Results(plan, store.results, table, resumed, tuple(store.notes))
