"""What a worker process does before anything else is imported; so nothing is, here."""

from __future__ import annotations

import os
import signal
import threading

__all__ = ["ONE_THREAD", "start"]

#: runs are independent: more threads inside one only get in the way of the others
ONE_THREAD = dict.fromkeys(
    ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)


def start() -> None:
    """Take one thread, leave Ctrl-C to the driver, and end when the driver does."""
    from multiprocessing import parent_process

    os.environ.update(ONE_THREAD)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    driver = parent_process()

    def watch() -> None:
        if driver is not None:
            driver.join()
            # A driver that was killed has closed nothing: its workers would wait for ever.
            os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
