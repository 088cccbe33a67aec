"""What a repeated experiment gives: rows of printed and computed figures side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler._processes import cores, each
from schuler._result import Result, table_of_rows
from schuler.attitude import multiply, quat_to_rotvec
from schuler.constants import ARCMIN
from schuler.errors import InputError
from schuler.published.cases import changeable, conditions, instrument
from schuler.published.figures import Figure

__all__ = [
    "Experiment",
    "Options",
    "Row",
    "changeable",
    "conditions",
    "each_run",
    "instrument",
    "misalignment",
    "rms_error",
    "std_error",
]

Array = NDArray[np.float64]
T = TypeVar("T")


@dataclass(frozen=True)
class Row:
    """One figure, as printed and as it comes out; None where there is none.

    Parameters
    ----------
    quantity, unit : str
    printed : float or None
        In the document.
    document_method : float or None
        Ours by the document's method.
    best : float or None
        Ours by schuler's best method, on the same data.
    limit : float or None
        What no method can beat.
    note : str
    """

    quantity: str
    unit: str
    printed: float | None = None
    document_method: float | None = None
    best: float | None = None
    limit: float | None = None
    note: str = ""

    def __post_init__(self) -> None:
        # NumPy's numbers would not go into JSON.
        for name in ("printed", "document_method", "best", "limit"):
            value = getattr(self, name)
            object.__setattr__(self, name, None if value is None else float(value))


@dataclass(frozen=True)
class Experiment(Result):
    """A repeated experiment.

    Parameters
    ----------
    name, title, citation : str
    errata : tuple of str
        What was not printed and had to be assumed, and what contradicts itself.
    runs : int
        Independent runs to each random figure.
    rows : tuple of Row
    drawn : tuple of Figure
        What its page draws; not part of the JSON.
    """

    name: str
    title: str
    citation: str
    errata: tuple[str, ...]
    runs: int
    rows: tuple[Row, ...] = field(repr=False)
    drawn: tuple[Figure, ...] = field(default=(), repr=False)

    def row(self, quantity: str) -> Row:
        """Return the row of a quantity.

        Raises
        ------
        InputError
            If there is none.
        """
        for row in self.rows:
            if row.quantity == quantity:
                return row
        raise InputError(f"{self.name} has no quantity '{quantity}'")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, as an entry of the JSON schema `schuler.published/1`."""
        return {
            "title": self.title, "citation": self.citation, "errata": list(self.errata),
            "runs": self.runs, "rows": [asdict(row) for row in self.rows],
        }  # fmt: skip

    def columns(self) -> dict[str, Any]:
        """Return a row to each quantity."""
        return table_of_rows(self.to_dict()["rows"])

    def __str__(self) -> str:
        def cell(value: float | None) -> str:
            return "-" if value is None else f"{value:.4g}"

        width = max(len(f"{row.quantity}, {row.unit}") for row in self.rows)
        heads = ("printed", "document", "best", "limit")
        lines = [
            f"{self.name}: {self.title}",
            self.citation,
            "",
            f"{'':<{width}}" + "".join(f"{head:>11}" for head in heads),
        ]
        for row in self.rows:
            values = (row.printed, row.document_method, row.best, row.limit)
            lines.append(
                f"{f'{row.quantity}, {row.unit}':<{width}}"
                + "".join(f"{cell(value):>11}" for value in values)
                + (f"  {row.note}" if row.note else "")
            )
        lines += ["", *(f"* {text}" for text in self.errata)]
        return "\n".join(line.rstrip() for line in lines)


@dataclass(frozen=True)
class Options:
    """How an experiment is run.

    Parameters
    ----------
    runs : int, optional
        Independent runs; the experiment's own number when not given.
    seed : int
    workers : int, optional
        Processes; as many as there are cores when not given. Figures do not depend on it.
    progress : callable, optional
        Called with the number of jobs done and of all.
    changes : tuple of (str, value)
        Conditions that are other than the document's, as ``("site.lat", 50.0)``; see
        `changeable`.

    Examples
    --------
    >>> Options(runs=10, workers=1).runs
    10
    """

    runs: int | None = None
    seed: int = 0
    workers: int | None = None
    progress: Callable[[int, int], None] | None = None
    changes: tuple[tuple[str, Any], ...] = ()

    def __post_init__(self) -> None:
        if self.runs is not None and self.runs < 2:
            raise InputError(f"a spread needs two runs at least, got {self.runs}")
        if self.workers is not None and self.workers < 1:
            raise InputError(f"one worker at least has to work, got {self.workers}")
        if self.seed < 0:
            raise InputError(f"a seed is a number of 0 or more, got {self.seed}")


def rms_error(errors: ArrayLike) -> tuple[float, float]:
    """Return the rms of errors of independent runs, and its standard error.

    The latter is that of the mean square, divided by twice the rms: it needs no normal numbers.
    """
    squares = np.asarray(errors, np.float64) ** 2
    rms = float(np.sqrt(squares.mean()))
    spread = float(squares.std(ddof=1)) / np.sqrt(len(squares))
    return rms, 0.0 if rms == 0.0 else spread / (2.0 * rms)


def std_error(errors: ArrayLike) -> Array:
    """Return the standard error of the standard deviation (k,) of independent runs (n, k).

    That of the mean square about the mean, divided by twice the deviation, as in `rms_error`.
    """
    found = np.asarray(errors, np.float64)
    squares = (found - found.mean(axis=0)) ** 2
    spread = found.std(axis=0, ddof=1)
    return np.asarray(
        squares.std(axis=0, ddof=1)
        / np.sqrt(len(found))
        / np.where(spread > 0.0, 2.0 * spread, 1.0)
    )


def experiment(
    case: dict[str, Any], name: str, options: Options, runs: int, rows: Sequence[Row],
    figures: Sequence[Figure] = (),
) -> Experiment:  # fmt: skip
    """Put an experiment together; conditions that were changed are said first."""
    errata = tuple(case["errata"])
    if options.changes:
        said = ", ".join(f"{key} = {value}" for key, value in options.changes)
        errata = (f"Changed conditions: {said}. The printed figures are for others.", *errata)
    return Experiment(
        name, case["title"], case["citation"], errata, runs, tuple(rows), tuple(figures)
    )


def each_run(
    function: Callable[..., T], jobs: Iterable[tuple[Any, ...]], options: Options
) -> Iterator[T]:
    """Give what a function makes of each job, in their order; on processes where there are many.

    Parameters
    ----------
    function : callable
        At the top of a module, so that a process can find it; its jobs carry their own seeds.
    jobs : iterable of tuple
        Arguments.
    options : Options
    """
    todo = list(jobs)
    for k, found in enumerate(each(function, todo, options.workers or cores()), 1):
        yield found
        if options.progress is not None:
            options.progress(k, len(todo))


def call(function: Callable[..., T], *arguments: Any) -> T:
    """Call a function: a job of `each_run` where jobs have functions of their own."""
    return function(*arguments)


def misalignment(found: ArrayLike, true: ArrayLike) -> Array:
    """Return phi (3,), arcmin, of a quaternion against the true one: C_est = (I - [phi x]) C."""
    back = np.asarray(true, np.float64) * [1.0, -1.0, -1.0, -1.0]
    return np.asarray(-quat_to_rotvec(multiply(found, back)) / ARCMIN)
