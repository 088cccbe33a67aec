"""Every compiled loop of schuler, and nothing else.

Kernels take plain float64 arrays and scalars, use SI units, allocate nothing inside their loops,
and are resumable: a loop over samples takes its state, works through one chunk, and leaves the
state ready for the next, so that any chunking of a record gives bit-identical results.

The whole convention is in the package docstring (`schuler`). Frames are named by suffix:
``quat_nb`` maps body vectors to n. Small vectors are tuples of scalars (`vec`, `quat`).
"""
