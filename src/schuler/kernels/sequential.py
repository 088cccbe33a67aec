"""Wald's sequential probability ratio test, for many channels and both signs at once."""

from __future__ import annotations

from schuler.kernels._jit import kernel


@kernel
def sprt(x, shift, upper, lower, alarms, ended):
    """Test unit-variance samples for a mean of +-shift; begin again after each end.

    Parameters
    ----------
    x : (k, n) float64
        Samples, each with unit variance.
    shift : (n,) float64
        The mean that is looked for; a channel with 0 is passed over.
    upper, lower : float
        Wald's bounds of the log likelihood ratio.
    alarms : (k, n) bool
        Set where a test ends in an alarm.
    ended : (n,) int64
        Counts the tests that ended.
    """
    for j in range(x.shape[1]):
        d = shift[j]
        if d <= 0.0:
            continue
        plus = 0.0
        minus = 0.0
        for i in range(x.shape[0]):
            plus += d * (x[i, j] - 0.5 * d)
            minus += d * (-x[i, j] - 0.5 * d)
            if plus >= upper:
                alarms[i, j] = True
                ended[j] += 1
                plus = 0.0
            elif plus <= lower:
                ended[j] += 1
                plus = 0.0
            if minus >= upper:
                alarms[i, j] = True
                ended[j] += 1
                minus = 0.0
            elif minus <= lower:
                ended[j] += 1
                minus = 0.0
