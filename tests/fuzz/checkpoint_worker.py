"""Mutated and crafted checkpoints, loaded in a process of its own that may crash.

``python -m tests.fuzz.checkpoint_worker FOLDER FIRST LAST`` makes the cases of these numbers, each
from its own seed, loads them, feeds the rest of the stream where one is accepted, and prints one
line of JSON for each.
"""

from __future__ import annotations

import hashlib
import io
import json
import sys
import zipfile
from pathlib import Path

import numpy as np

from schuler.errors import InputError
from tests.alignment.live_tools import SENDER, Feed, frame, make_samples, make_session, right

STAGES = (10, 200, 700, 1200)
"""Samples before the state is saved: held, waiting for their rate, aligned, and thinned out."""

VALUES = (
    np.nan, np.inf, -np.inf, 1e300, -1e300, -1.0, 0.0, 0.5, 1.0, 1e9, -1e9, 2.0**53, 2.0**63,
    5e-324,
)  # fmt: skip


SAMPLES = ("held", "before", "intake", "intake_rows")
"""Hold samples as they came: one that is possible in the place of another cannot be told, so
that values for them are taken from the impossible ones."""


def sign(arrays: dict[str, np.ndarray], compressed: bool = False) -> bytes:
    """Return a file with the right digest of whatever is in it, as the format is documented."""
    total = hashlib.sha256()
    for name in sorted(arrays):
        array = arrays[name]
        total.update(f"{name} {array.dtype.str} {array.shape}\n".encode() + array.tobytes())
    held = {**arrays, "digest": np.frombuffer(total.digest(), np.uint8)}
    made = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(made, **held)
    return made.getvalue()


def make_states(folder: Path, items) -> list[tuple[int, bytes]]:
    """Return states that were saved on the way, with the number of samples before each."""
    out = []
    for count in STAGES:
        path = folder / f"stage-{count}.npz"
        feed = Feed(make_session(checkpoint=path))
        # One sample is missing, so that others are held; sixteen begin a stream.
        feed.real([item for item in items[: count + 16] if item[0] != count + 12])
        feed.session.save()
        out.append((count + 16, path.read_bytes()))
    return out


def spoil_bytes(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    """Return a file with bytes that were changed, lost, moved or added."""
    out = bytearray(data)
    how = int(rng.integers(7))
    at = int(rng.integers(len(out)))
    if how == 0:
        for _ in range(int(rng.integers(1, 9))):
            out[int(rng.integers(len(out)))] ^= 1 << int(rng.integers(8))
    elif how == 1:
        del out[at:]
    elif how == 2:
        del out[at : at + int(rng.integers(1, 1000))]
    elif how == 3:
        out[at : at + 64] = bytes(64)
    elif how == 4:
        out[at:at] = rng.bytes(int(rng.integers(1, 200)))
    elif how == 5:
        out[at:] = other[at:]
    else:
        # The directory of the archive, and the heads of its members.
        where = out.rfind(b"PK\x01\x02") if rng.random() < 0.5 else out.find(b"PK\x03\x04")
        out[where + int(rng.integers(4, 46))] = int(rng.integers(256))
    return bytes(out)


def spoil_state(rng: np.random.Generator, data: bytes, other: bytes) -> bytes:
    """Return a file with a right digest whose arrays or description are not those of a state."""
    with np.load(io.BytesIO(data)) as file:
        arrays = {name: file[name] for name in file.files if name != "digest"}
    names = sorted(set(arrays) - {"meta"})
    how = int(rng.integers(12))
    name = names[int(rng.integers(len(names)))]
    array = arrays[name].copy()
    values = VALUES[:5] if name in SAMPLES else VALUES
    value = values[int(rng.integers(len(values)))]
    if how <= 3 and array.size:
        array.reshape(-1)[int(rng.integers(array.size))] = value
    elif how == 4:
        array[...] = value
    elif how == 5:
        array = array[:-1] if rng.random() < 0.5 else np.concatenate([array, array[-1:]])
    elif how == 6:
        array = array.astype(["<f4", ">f8", "<i8", "<c16", "|b1"][int(rng.integers(5))])
    elif how == 7:
        array = array.T if array.ndim > 1 else array[:, None]
    elif how == 8:
        with np.load(io.BytesIO(other)) as file:
            array = file[name]
    elif how == 9:
        arrays[f"more-{name}"] = array
    elif how == 10:
        meta = json.loads(arrays["meta"].tobytes())
        spots = [(meta, key) for key in meta]
        spots += [(meta["more"]["stream"], key) for key in meta["more"]["stream"]]
        spots += [(meta["more"]["stream"]["key"], k) for k in range(4)]
        spot, key = spots[int(rng.integers(len(spots)))]
        wrong = (None, -1, 1e300, "x" * 5000, [], {}, True, 2**70, [[]] * 20, float("nan"))
        spot[key] = wrong[int(rng.integers(len(wrong)))]
        text = json.dumps(meta) if rng.random() < 0.9 else "[" * 100_000
        arrays["meta"] = np.frombuffer(text.encode(), np.uint8)
        return sign(arrays)
    else:
        del arrays[name]
        return sign(arrays, compressed=rng.random() < 0.5)
    return sign({**arrays, name: array}, compressed=rng.random() < 0.03)


def bomb(rng: np.random.Generator) -> bytes:
    """Return a small archive that declares far more than it holds."""
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        size = int(10 ** rng.uniform(3, 12))
        head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({size},), }}".ljust(117) + "\n"
        archive.writestr("tracker.npy", b"\x93NUMPY\x01\x00v\x00" + head.encode() + bytes(10**6))
    return made.getvalue()


def run_case(case: int, folder: Path, items, states) -> str:
    """Return what became of one file: refused, right, or a fault."""
    rng = np.random.default_rng([20261127, case])
    stage, other = (int(k) for k in rng.choice(len(states), 2, replace=False))
    fed, data = states[stage]
    way = rng.random()
    if way < 0.35:
        data = spoil_bytes(rng, data, states[other][1])
    elif way < 0.97:
        data = spoil_state(rng, data, states[other][1])
    else:
        data = bomb(rng)
    path = folder / "state.npz"
    path.write_bytes(data)
    # The session saves over its own: this one stays, to look at after a fault.
    (folder / "case.npz").write_bytes(data)
    try:
        session = make_session(checkpoint=path)
    except InputError as error:
        text = str(error)
        return "refused" if str(path) in text and "\n" not in text else f"fault: {text!r}"
    feed = Feed(session)
    for item in items[fed:]:
        feed.now += 0.02
        session.feed(frame(item), SENDER, feed.now)
    try:
        outcome = feed.end()
    except InputError as error:
        return f"refused late: {error}"
    fix = outcome.best.alignment
    return "right" if right(fix) else f"wrong: {fix.headline()}"


def main(folder: Path, first: int, last: int) -> None:
    """Run the cases from `first` up to `last`."""
    items = make_samples(30.0)
    states = make_states(folder, items)
    for case in range(first, last):
        print(json.dumps({"case": case}), flush=True)
        print(json.dumps({"case": case, "end": run_case(case, folder, items, states)}), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
