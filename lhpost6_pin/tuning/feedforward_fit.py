"""Feed-forward gains of an axis by least squares on its measured response (equation in `tune`)."""

from collections.abc import Sequence

import numpy as np

from ..control import ControllerSettings
from ..core.arrays import Complex, Mask
from ..data.transfer import Transfer

__all__ = ["FEEDFORWARD", "FeedforwardFit", "best_delay"]

FEEDFORWARD = ("velocity_feedforward", "acceleration_feedforward", "jerk_feedforward")
"""Gains on s, s^2 and s^3."""


class FeedforwardFit:
    """Least-squares fit of the feed-forward gains of one axis to its measured response.

    Kvf is fitted in the low band, where the table integrates the command; then the other terms (1 Kaf, 2 Kjf) over the
    whole band, so that an oil column within the band does not affect Kvf.
    """

    def __init__(
        self,
        transfer: Transfer,
        settings: ControllerSettings,
        k: int,
        bands: tuple[tuple[float, float], tuple[float, float]],
        terms: tuple[int, ...],
    ) -> None:
        """Fit the response of axis `k` with the given settings; `bands` [Hz] of Kvf and of the other `terms`."""
        f = transfer.frequency
        self.bands, self.terms = [(f >= low) & (f <= high) for low, high in bands], terms
        self.s = 2j * np.pi * f
        self.weight = np.sqrt(transfer.coherence[:, 0])
        fed_back = (settings.displacement_gain, settings.velocity_gain, settings.acceleration_gain)
        self.fixed = settings.displacement_feedforward[k] + sum(g[k] * self.s**n for n, g in enumerate(fed_back))
        self.before = [float(getattr(settings, name)[k]) for name in FEEDFORWARD]
        self.plant = transfer.response[:, 0, 0] / (self.fixed + self._ahead(self.before))

    def gains(self, delay: float) -> tuple[list[float], float]:
        """Gains on s, s^2, s^3 with the response closest to a pure delay [s], and the relative error."""
        found = self._solve(self.before, (0,), self.bands[0], delay)
        found = self._solve(found, self.terms, self.bands[1], delay)
        inside = self.bands[1 if self.terms else 0]
        error = (self.plant * (self.fixed + self._ahead(found)) - np.exp(-self.s * delay)) * self.weight
        return found, float(np.linalg.norm(error[inside]) / np.linalg.norm(self.weight[inside]))

    def _ahead(self, gains: Sequence[float]) -> Complex:
        return np.asarray(sum(g * self.s ** (n + 1) for n, g in enumerate(gains)))

    def _solve(self, gains: Sequence[float], terms: tuple[int, ...], inside: Mask, delay: float) -> list[float]:
        """Gains with those of `terms` fitted."""
        out = [0.0 if n in terms else g for n, g in enumerate(gains)]
        if not terms:
            return out
        missing = (np.exp(-self.s * delay) - self.plant * (self.fixed + self._ahead(out)))[inside]
        columns = np.column_stack([self.plant * self.s ** (n + 1) for n in terms])[inside]
        size = np.abs(columns).max(axis=0)  # s^3 is a million times s
        left, right = columns / size * self.weight[inside, None], missing * self.weight[inside]
        found, *_ = np.linalg.lstsq(
            np.vstack([left.real, left.imag]), np.concatenate([right.real, right.imag]), rcond=None
        )
        for n, gain in zip(terms, (found / size).tolist(), strict=True):
            out[n] = gain
        return out


def best_delay(fits: Sequence[FeedforwardFit], largest: float) -> float:
    """Delay [s] with the least sum of squared errors over all axes, to a tenth of a millisecond."""
    delays = np.arange(0.0, largest + 1e-9, 1e-4)
    errors = [sum(fit.gains(delay)[1] ** 2 for fit in fits) for delay in delays]
    return float(delays[int(np.argmin(errors))])
