"""Tests of schuler."""

import os

# Two workers with as many BLAS threads each would only wait for one another; before NumPy is there.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
