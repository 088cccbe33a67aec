"""A process that runs command lines one after the other and tells how each ended.

It reads a JSON list of words from its standard input and answers with a JSON line on the descriptor
that its first argument names; standard output and error of the command go into files.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import traceback

import click.testing  # noqa: F401  (before the streams are changed)

from schuler.cli import main
from tests.fuzz.worker import peak


def run(words: list[str]) -> dict[str, object]:
    """Run one command line; return its exit code and what it printed."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        kept = os.dup(1), os.dup(2)
        os.dup2(out.fileno(), 1)
        os.dup2(err.fileno(), 2)
        try:
            main(words)
            code: object = "returned"
        except SystemExit as stop:
            code = stop.code
        except BaseException:
            code = "escaped"
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for descriptor, saved in zip((1, 2), kept, strict=True):
                os.dup2(saved, descriptor)
                os.close(saved)
        texts = []
        for file in (out, err):
            file.seek(0)
            texts.append(file.read(200_000).decode(errors="replace"))
    return {"code": code, "out": texts[0], "err": texts[1], "peak_kb": peak() // 1024}


if __name__ == "__main__":
    answers = os.fdopen(int(sys.argv[1]), "w")
    lines = os.fdopen(os.dup(0))
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    for line in lines:
        print(json.dumps(run(json.loads(line))), file=answers, flush=True)
