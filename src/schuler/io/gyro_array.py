"""The gyros of an array are compared with each other before three axes are made of them."""

from __future__ import annotations

import numpy as np

from schuler.io.clock import Clock
from schuler.io.content import Content
from schuler.io.flow import prefetch
from schuler.io.meaning import Meaning
from schuler.io.span import Span
from schuler.sensors.array_check import ArrayCheck, ArrayVerdict

__all__ = ["compare_gyros", "say_gyros"]


def compare_gyros(
    check: ArrayCheck, content: Content, meaning: Meaning, clock: Clock, span: Span
) -> ArrayVerdict:
    """Return what the gyros of a stretch of a file say of each other, in a pass of its own.

    Parameters
    ----------
    check : ArrayCheck
        Not used yet.
    content : Content
    meaning : Meaning
    clock : Clock
        For this pass alone.
    span : Span
        The stretch.
    """
    stretch, done = Span(*span.said), 0
    for block in prefetch(content.blocks()):
        time = meaning.convert(block, done, clock)[0]
        done += len(time)
        stretch.see(time)
        stop = np.inf if stretch.stop is None else stretch.stop
        inside = (time >= stretch.first) & (time < stop)
        check.push(meaning.gyros(block, time)[inside])
        if np.any(time >= stop):
            break
    return check.verdict()


def say_gyros(
    verdict: ArrayVerdict, notes: list[str], contradictions: list[str], *, streamed: bool
) -> None:
    """Add to a file's notes and contradictions what its gyros say of each other.

    Parameters
    ----------
    verdict : ArrayVerdict
    notes, contradictions : list of str
        To be added to.
    streamed : bool
        Whether the gyros were used before anything was known of them.
    """
    for note in verdict.notes:
        text = note.replace("was left out: it", "is faulty, and was used: it") if streamed else note
        target = contradictions if streamed else notes
        if text not in target:
            target.append(text)
    contradictions += [text for text in verdict.contradictions if text not in contradictions]
