"""The command path of a valve: its delay, 5 ms on the LHPOST6, and the lag of its spool behind."""

import math

from ..core.compiled import compiled, compiled_inline

__all__ = ["delayed_spools"]


@compiled
def delayed_spools(command, first, sample, delays, rate, spool):
    """Spools over the model steps of one controller sample: the command delayed, averaged over each step.

    command (n, nu) is held over each controller sample; row 0 is controller sample `first`, earlier ones repeat it.
    delays (nu,) [s], rate [1/s] the controller's; spool (n_steps, nu) is filled. Exact for any delay.
    delays (2 nu,) hold time constants of lags behind them; spool then comes with what it held a sample before.
    """
    steps, nu = spool.shape
    for i in range(nu):
        shift = delays[i] * rate
        lag = delays[nu + i] * rate * steps if delays.size > nu else 0.0
        last = spool[steps - 1, i]
        for j in range(steps):
            value = _held(command, first, i, sample + j / steps - shift, steps)
            if lag > 0.0:  # means over steps of the answer to a command that is held over each
                before = _held(command, first, i, sample + (j - 1) / steps - shift, steps)
                stay = math.exp(-1.0 / lag)
                mean = (1.0 - stay) * lag
                value = stay * last + (1.0 - mean) * value + (mean - stay) * before
                last = value
            spool[j, i] = value


@compiled_inline
def _held(command, first, i, begin, steps):
    """Command i averaged over one model step, which begins at `begin` samples."""
    whole = math.floor(begin)
    share = min(1.0, max(0.0, (begin + 1.0 / steps - whole - 1.0) * steps))  # of the step, in the next sample
    at = max(0, int(whole) - first)
    after = max(0, int(whole) + 1 - first)
    value = command[at, i]
    if share > 0.0:
        value += share * (command[after, i] - value)
    return value
