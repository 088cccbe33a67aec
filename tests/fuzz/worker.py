"""A process that does what it is told on one file after the other, and says how that ended.

Requests and answers are lines of JSON. The kernel ends the process after ten seconds of computing
on one request: what never comes back is seen by whoever waits.
"""

from __future__ import annotations

import hashlib
import json
import os
import resource
import signal
import sys
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: seconds of computing for one request
LIMIT = 10.0


def peak() -> int:
    """Return the most memory that this process has had, bytes."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    # Not getrusage, which counts what the parent had when it started this process.
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM:"))


def digest(*parts: Any) -> str:
    whole = hashlib.sha256()
    for part in parts:
        whole.update(part.tobytes() if hasattr(part, "tobytes") else repr(part).encode())
    return whole.hexdigest()


def read_record(path: str, options: dict[str, Any]) -> str:
    from schuler import open_source

    source = open_source(path, max_gap=1e9, **options)
    record = source.read()
    return digest(record.time, record.dt, record.dtheta, record.dvel, record.name,
                  record.coning_corrected, record.sculling_corrected)  # fmt: skip


def read_reference(path: str, options: dict[str, Any]) -> str:
    from schuler.io import read_trajectory as read

    found = read(path)
    return digest(found.time, found.position, found.v_n, found.quat_nb)


def read_fixes(path: str, options: dict[str, Any]) -> str:
    from schuler.io import read_gnss

    found = read_gnss(path, **options)
    found.describe()
    found.contradictions()
    return digest(found.time, found.lat, found.lon, found.height, found.sigma, found.v_n)


def read_aid(path: str, options: dict[str, Any]) -> str:
    import schuler.io

    found = getattr(schuler.io, options.pop("read"))(path, **options)
    return digest(found.time, found.sigma)


def read_store(path: str, options: dict[str, Any]) -> str:
    """Open a campaign's folder; name what of it is used."""
    from schuler.campaigns.store import Store
    from tests.fuzz.stores import campaign

    store = Store(campaign(), path)
    with store.held():
        used = [digest(*_columns(store.finished()))]
        used += [digest(*_columns(store.load(chunk))) for chunk in store.campaign.chunks()]
    return " ".join(used)


def _columns(table: Any) -> list[Any]:
    return [] if table is None else [repr(table.to_pydict())]


WORK: dict[str, Callable[[str, dict[str, Any]], str]] = {
    "record": read_record, "reference": read_reference, "store": read_store,
    "gnss": read_fixes, "aid": read_aid,
}  # fmt: skip


def main() -> None:
    from schuler import SchulerError

    warnings.simplefilter("ignore")
    # What libraries print must not be taken for an answer.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        request = json.loads(line)
        signal.setitimer(signal.ITIMER_PROF, LIMIT)
        try:
            answer = {"end": "used", "text": WORK[request["work"]](
                request["path"], request["options"])}  # fmt: skip
        except SchulerError as error:
            answer = {"end": "refused", "text": str(error)}
        except BaseException:
            answer = {"end": "traceback", "text": traceback.format_exc()[-1500:]}
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        answers.write(json.dumps({**answer, "peak": peak()}) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
