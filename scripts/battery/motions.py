"""The motions of a campaign's tests: displacement of C in six axes at 2048 Hz, from rest to rest, each from a seed."""

from collections.abc import Callable

import numpy as np

from .simulate import RATE

__all__ = ["CALM", "make_motion"]

CALM = 0.5  # s of rest before and after


def make_motion(test: dict, seed: int) -> np.ndarray:
    """Reference displacement (n, 6) of one test of `numbers.toml`; its sizes vary by some percent with the seed."""
    random = np.random.default_rng(seed)
    n = round(test["duration"] * RATE)
    size = np.array(test["size"]) * random.uniform(0.8, 1.0, 6)
    inner = n - 2 * round(CALM * RATE)
    time = np.arange(inner) / RATE
    motion = MAKERS[test["kind"]](time, size, test, random)
    return np.pad(motion, ((round(CALM * RATE), n - inner - round(CALM * RATE)), (0, 0)))


def _triangles(time: np.ndarray, size: np.ndarray, test: dict, random: np.random.Generator) -> np.ndarray:
    """Constant speed to and fro, corners rounded over `rounding` seconds; one whole number of cycles."""
    span, rounding = time[-1], test["rounding"]
    cycles = test["cycles"]
    phase = np.clip((time - rounding) / (span - 2 * rounding), 0.0, 1.0) * cycles
    wave = np.interp(phase % 1.0, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
    return _rounded(wave, rounding)[:, None] * size * random.choice([-1.0, 1.0])


def _steps(time: np.ndarray, size: np.ndarray, test: dict, random: np.random.Generator) -> np.ndarray:
    """Poses held still one after another, smooth moves between them."""
    count = test["holds"]
    poses = np.zeros((count + 2, 6))
    poses[1:-1] = random.uniform(0.4, 1.0, (count, 6)) * random.choice([-1.0, 1.0], (count, 6))
    index = np.minimum((time / time[-1] * (count + 2)).astype(int), count + 1)
    held = poses[index]
    return np.column_stack([_rounded(held[:, j], test["rounding"]) for j in range(6)]) * size


def _noise(time: np.ndarray, size: np.ndarray, test: dict, random: np.random.Generator) -> np.ndarray:
    """Noise of flat acceleration within `band`; size is the root mean square of acceleration."""
    return _faded(_shaped(time, size, random, lambda f: _band(f, *test["band"])), test["fade"])


def _earthquake(time: np.ndarray, size: np.ndarray, test: dict, random: np.random.Generator) -> np.ndarray:
    """A ground's resonance under band-limited noise, rising fast and dying away; size is the peak velocity."""
    ground, damping = random.uniform(*test["ground"]), random.uniform(*test["ground_damping"])

    def spectrum(f: np.ndarray) -> np.ndarray:
        ratio = f / ground
        filtered = np.sqrt((1 + (2 * damping * ratio) ** 2) / ((1 - ratio**2) ** 2 + (2 * damping * ratio) ** 2))
        return _band(f, *test["band"]) * filtered

    strong = random.uniform(0.15, 0.35) * time[-1]
    envelope = (time / strong) ** 2 * np.exp(2 * (1 - time / strong))
    motion = _faded(_shaped(time, np.ones(6), random, spectrum) * envelope[:, None], test["fade"])
    peak = np.abs(np.gradient(motion, 1 / RATE, axis=0)).max(axis=0)
    return motion * size / peak


def _sway(time: np.ndarray, size: np.ndarray, test: dict, random: np.random.Generator) -> np.ndarray:
    """Each axis a slow sine of its own, its frequency within `band` and drifting."""
    low, high = test["band"]
    start, end = random.uniform(low, high, 6), random.uniform(low, high, 6)
    turns = start * time[:, None] + 0.5 * (end - start) * time[:, None] ** 2 / time[-1]
    return _faded(np.sin(2 * np.pi * turns) * size, test["fade"])


MAKERS: dict[str, Callable[[np.ndarray, np.ndarray, dict, np.random.Generator], np.ndarray]] = {
    "triangles": _triangles,
    "steps": _steps,
    "noise": _noise,
    "earthquake": _earthquake,
    "sway": _sway,
}


def _rounded(wave: np.ndarray, over: float) -> np.ndarray:
    """A wave averaged under a raised cosine of some seconds; it must be at rest that long at both ends."""
    window = np.hanning(2 * round(over * RATE / 2) + 1)
    half = len(window) // 2
    return np.convolve(np.pad(wave, half, mode="edge"), window / window.sum(), mode="valid")


def _faded(motion: np.ndarray, over: float) -> np.ndarray:
    """Motion let in and out by half cosines of some seconds."""
    n = len(motion)
    ramp = np.clip(np.minimum(np.arange(n), n - 1 - np.arange(n)) / (over * RATE), 0.0, 1.0)
    return motion * (0.5 - 0.5 * np.cos(np.pi * ramp))[:, None]


def _band(f: np.ndarray, low: float, high: float) -> np.ndarray:
    """Gain of a band with soft shoulders."""
    return (f / low) ** 4 / (1 + (f / low) ** 4) / (1 + (f / high) ** 8)


def _shaped(
    time: np.ndarray, size: np.ndarray, random: np.random.Generator, spectrum: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Displacement whose acceleration is Gaussian noise of a given spectrum and of root mean square `size` (n, 6)."""
    n = len(time)
    f = np.fft.rfftfreq(n, 1 / RATE)
    noise = random.standard_normal((6, len(f))) + 1j * random.standard_normal((6, len(f)))
    acceleration = noise * spectrum(np.maximum(f, f[1]))
    acceleration[:, 0] = 0.0
    displacement = -acceleration / np.maximum((2 * np.pi * f) ** 2, (2 * np.pi * f[1]) ** 2)
    rms = np.fft.irfft(acceleration, n).std(axis=1)
    return (np.fft.irfft(displacement, n) * (size / rms)[:, None]).T
