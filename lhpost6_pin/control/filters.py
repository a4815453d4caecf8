"""The controller's linear filters, in continuous time and as sampled matrices.

Reference generator, by mode: from the drive d follow xr, vr, ar, jr, each the derivative of the preceding one (in
acceleration mode jr is a filtered derivative).

    acceleration   xr = d / (s^2 + 2 zeta w s + w^2): a second-order high-pass, integrated twice; jr = s ar / (1 + s/w2)
    velocity       xr = L(s) d / (s + w): a high-pass of first order, integrated; L a low-pass of third order
    displacement   xr = L(s) d, L a low-pass of fourth order

Feedback generator: xf = L xs + H as / s^2, vf = s xf, af = s^2 xf with L + H = 1 and three poles at the crossover c,

    L = (3 c^2 s + c^3) / (s + c)^3,   H = (s^3 + 3 c s^2) / (s + c)^3

the lowest order whose three outputs are all proper. Notch: N = 1 + d B s / (s^2 + B s + w0^2).

Low-passes are Bessel filters, whose delay is constant in their pass band. Inputs are interpolated linearly between
samples (first-order hold), except for generators with a low-pass, which are discretised by the bilinear transform so
that each output remains the derivative of the preceding one at all frequencies. Notches are discretised by the bilinear
transform that is exact at w0.
"""

from functools import cache

import numpy as np

from ..core.arrays import Array, Complex

__all__ = ["MODES", "NOTCHES", "drive_for"]
__all__ += ["feedback_generator", "notch_section", "reference_generator", "sampled_response"]

Matrices = tuple[Array, Array, Array, Array]

MODES = ("acceleration", "velocity", "displacement")
"""Modes of the reference generator; the first is the default."""

NOTCHES = 5
"""Notches of each degree of freedom."""


@cache  # tuning needs the same ones many times; the arrays are read only
def reference_generator(mode: str, high_pass: float, damping: float, low_pass: float, rate: float) -> Matrices:
    """Sampled matrices a (4, 4), b (4,), c (4, 4), d (4,) of a mode, with its corners [Hz] (see above)."""
    w, w2 = 2.0 * np.pi * high_pass, 2.0 * np.pi * low_pass
    a, b, c, d = np.zeros((4, 4)), np.zeros((4, 1)), np.zeros((4, 4)), np.zeros((4, 1))
    if mode == "acceleration":  # states: xr, vr, low-passed ar; one is not needed
        spring = np.array([-(w**2), -2.0 * damping * w, 0.0, 0.0])
        a[0, 1], a[1], b[1] = 1.0, spring, 1.0
        a[2], b[2] = w2 * spring, w2
        a[2, 2] -= w2
        a[3, 3] = -w2
        c[0, 0] = c[1, 1] = 1.0
        c[2], d[2] = spring, 1.0
        c[3], d[3] = a[2], b[2]
    elif mode == "velocity":  # states: xr, then the chain
        a[0, 0], a[0, 1] = -w, 1.0
        _chain(a[1:, 1:], b[1:], w2)
        c[0, 0] = 1.0
        for k in range(1, 4):  # vr = s xr, and so on
            c[k] = c[k - 1] @ a
    else:
        _chain(a, b, w2)
        np.fill_diagonal(c, w2 ** np.arange(4))
    a, b, c, d = _sampled(a, b, c, d, rate, "foh" if mode == "acceleration" else "bilinear")
    return a, b[:, 0], c, d[:, 0]


def drive_for(
    mode: str, displacement: Array, velocity: Array, acceleration: Array, high_pass: Array, damping: Array
) -> Array:
    """Drive (n, 6) whose reference is the given motion, (n, 6) each; it compensates the generator's high-pass.

    Low-passes are not compensated: in velocity and displacement mode the reference lags by their delay.
    """
    w = 2.0 * np.pi * np.asarray(high_pass)
    if mode == "acceleration":
        return acceleration + 2.0 * np.asarray(damping) * w * velocity + w**2 * displacement
    return velocity + w * displacement if mode == "velocity" else displacement.copy()


def sampled_response(matrices: Matrices, frequency: Array, rate: float) -> Complex:
    """Frequency response (m, outputs, inputs) of sampled matrices at `frequency` (m,) [Hz]; one input may be flat."""
    a, b, c, d = (np.asarray(x) for x in matrices)
    b, d = b.reshape(len(b), -1), d.reshape(len(d), -1)
    z = np.exp(2j * np.pi * np.asarray(frequency) / rate)[:, None, None]
    return np.asarray(c @ np.linalg.solve(z * np.eye(len(a)) - a, b + 0 * z) + d)


@cache
def feedback_generator(crossover: float, rate: float) -> Matrices:
    """Sampled matrices a (3, 3), b (3, 2), c (3, 3), d (3, 2); inputs xs, as; outputs xf, vf, af; crossover [Hz].

    With e = xs - xf its states are xf, vf and p:  vf' = as + p + 3 c^2 e,  p' = -3 c p - 8 c^3 e.
    """
    w = 2.0 * np.pi * crossover
    a = np.array([[0.0, 1.0, 0.0], [-3.0 * w**2, 0.0, 1.0], [8.0 * w**3, 0.0, -3.0 * w]])
    b = np.array([[0.0, 0.0], [3.0 * w**2, 1.0], [-8.0 * w**3, 0.0]])
    c = np.vstack([np.eye(3)[:2], a[1]])
    d = np.vstack([np.zeros((2, 2)), b[1]])
    return _sampled(a, b, c, d, rate, "foh")


def notch_section(frequency: float, bandwidth: float, depth: float, rate: float) -> Array:
    """Coefficients (5,) b0 b1 b2 a1 a2 of N = 1 + d B s / (s^2 + B s + w0^2); frequency, bandwidth B/2pi [Hz]."""
    t = np.tan(np.pi * frequency / rate)
    breadth = t * bandwidth / frequency  # B s over w0^2 at s = (1 - z^-1) / (t (1 + z^-1))
    whole = 1.0 + breadth + t**2
    b = np.array([whole + depth * breadth, 2.0 * (t**2 - 1.0), 1.0 - breadth - depth * breadth + t**2])
    return np.concatenate([b, [2.0 * (t**2 - 1.0), 1.0 - breadth + t**2]]) / whole


def _chain(a: Array, b: Array, corner: float) -> None:
    """Fill a (n, n), b (n, 1) with a Bessel low-pass: state k is the k-th derivative of its output over corner^k."""
    from scipy import signal

    _, poles = signal.bessel(len(a), 1.0, analog=True, norm="mag")
    np.fill_diagonal(a[:, 1:], corner)
    a[-1] = -corner * np.asarray(poles)[:0:-1]
    b[-1] = corner * poles[-1]


def _sampled(a: Array, b: Array, c: Array, d: Array, rate: float, method: str) -> Matrices:
    """Matrices sampled by first-order hold ("foh") or by the bilinear transform.

    As `scipy.signal.cont2discrete`, whose import takes longer than all else that a controller needs.
    """
    from scipy import linalg

    n, inputs = b.shape
    if method == "foh":  # exponential of the system extended by an input and its slope
        whole = np.zeros((n + 2 * inputs, n + 2 * inputs))
        whole[:n, :n], whole[:n, n : n + inputs] = a / rate, b / rate
        whole[n : n + inputs, n + inputs :] = np.eye(inputs)
        ends = linalg.expm(whole)[:n]
        held, slope = ends[:, n : n + inputs], ends[:, n + inputs :]
        return ends[:, :n], held - slope + ends[:, :n] @ slope, c, d + c @ slope
    half = np.eye(n) - 0.5 / rate * a
    sampled = linalg.solve(half, b / rate)
    return (
        linalg.solve(half, np.eye(n) + 0.5 / rate * a),
        sampled,
        linalg.solve(half.T, c.T).T,
        d + 0.5 * c @ sampled,
    )
