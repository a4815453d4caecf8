"""A plant of two axes whose response is known in closed form."""

import numpy as np
from scipy import signal

RATE = 256.0


class TwoAxes:
    """Second-order low-passes from two inputs to two outputs, `delay` samples late."""

    delay = 5

    def __init__(self, xx: tuple, xy: tuple, yx: tuple, yy: tuple) -> None:
        """Each of frequency, damping and gain; row output, column input."""
        self.filters = [[self._oscillator(*xx), self._oscillator(*xy)], [self._oscillator(*yx), self._oscillator(*yy)]]

    @staticmethod
    def _oscillator(frequency: float, damping: float, gain: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
        w = 2 * np.pi * frequency
        return signal.bilinear([gain * w**2], [1, 2 * damping * w, w**2], RATE)

    def respond(self, x: np.ndarray) -> np.ndarray:
        """Outputs (n, 2) of inputs (n, 2)."""
        y = np.stack([sum(signal.lfilter(*g, x[:, j]) for j, g in enumerate(row)) for row in self.filters], axis=1)
        return np.vstack([np.zeros((self.delay, 2)), y[: -self.delay]])

    def response(self, frequency: np.ndarray) -> np.ndarray:
        """Frequency response in closed form, (m, 2, 2)."""
        late = np.exp(-2j * np.pi * frequency * self.delay / RATE)
        rows = [[signal.freqz(*g, worN=frequency, fs=RATE)[1] * late for g in row] for row in self.filters]
        return np.moveaxis(np.array(rows), -1, 0)
