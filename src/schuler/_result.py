"""`Result`: what every result can do, whatever it is of.

A result says what it found by `to_dict` (the document of ``--json``) and by `columns` (its table);
everything else follows from these two and from its report: text, DataFrame, figures, files.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schuler._notebook import Shown
from schuler.errors import installed

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Result", "table_of_rows"]


class Result(Shown, ABC):
    """A result: JSON, a table, figures, and what a notebook shows of it."""

    @cached_property
    def _page(self) -> Any:
        """What its report shows, made once: some figures take a second to compute."""
        return _drawing("make_page")(self)

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Return the result as plain values, the document that ``--json`` writes."""

    def to_json(self) -> str:
        """Return the result as JSON text.

        Examples
        --------
        >>> import json
        >>> json.loads(fix.to_json())["method"]["name"]
        'optimal'
        """
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)

    def columns(self) -> dict[str, Any]:
        """Return the result's table: the name of each column with its values.

        Where a result has no rows of its own it is one row, whose columns are the keys of
        `to_dict`; a key within another follows it after a dot, as ``sigma_arcmin.up``.
        """
        return {name: [value] for name, value in _flat(self.to_dict())}

    def to_pandas(self) -> pd.DataFrame:
        """Return the result's table, see `columns`.

        Raises
        ------
        SchulerError
            If pandas is not installed.
        """
        with installed("a DataFrame needs pandas", "pandas"):
            import pandas as pd
        return pd.DataFrame(self.columns())

    def figures(self) -> dict[str, Any]:
        """Return the figures of the result's report by their names, as Plotly's.

        Raises
        ------
        SchulerError
            If Plotly is not installed.
        """
        figures: dict[str, Any] = _drawing("figures_of")(self)
        return figures

    def plot(self, name: str | None = None, *, ax: Any = None) -> Any:
        """Draw the figures of the result's report by Matplotlib.

        Parameters
        ----------
        name : str, optional
            One of them, as `figures` names it; all of them when not given.
        ax : matplotlib.axes.Axes, optional
            Where to draw one figure; a figure of its own when not given.

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        InputError
            If there is no figure of that name.
        SchulerError
            If Matplotlib is not installed.

        Examples
        --------
        >>> axes = fix.plot()
        """
        return _drawing("plot_of")(self, name, ax)

    def save_figures(self, folder: str | Path, kind: str = "svg") -> list[Path]:
        """Write each figure as a file, without a browser; return the files.

        Parameters
        ----------
        folder : str or Path
            Made where there is none.
        kind : {"svg", "png", "pdf"}

        Raises
        ------
        InputError
            If the folder cannot be written, or for another kind.
        SchulerError
            If Matplotlib is not installed.

        Examples
        --------
        >>> paths = fix.save_figures("figures")
        >>> paths[0].suffix
        '.svg'
        """
        written: list[Path] = _drawing("save_figures")(self, folder, kind)
        return written


def _drawing(name: str) -> Any:
    """Return a function of `schuler.reports.results`.

    Results lie below the reports, which import them: the module that draws is found by its name
    when a drawing is asked for, as pandas does with its plotting backends.
    """
    return getattr(import_module("schuler.reports.results"), name)


def _flat(values: Mapping[str, Any], before: str = "") -> list[tuple[str, Any]]:
    """Return names with plain values; lists of several values stay one cell."""
    out: list[tuple[str, Any]] = []
    for key, value in values.items():
        if isinstance(value, Mapping):
            out += _flat(value, f"{before}{key}.")
        else:
            out.append((f"{before}{key}", value))
    return out


def table_of_rows(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return rows with the same keys as columns; a key within another follows it after a dot."""
    flat = [dict(_flat(row)) for row in rows]
    names = dict.fromkeys(name for row in flat for name in row)
    return {name: [row.get(name) for row in flat] for name in names}
