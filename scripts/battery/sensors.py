"""What instruments make of a test: gains, offsets, skews, coloured noise, low-pass, 512 samples a second, 16 bits."""

from dataclasses import dataclass, field

import numpy as np
from scipy.signal import butter, lfilter, sosfiltfilt

from .rates import GAS_PRESSURE, PA, PB, PULL, SUPPLY_PRESSURE, X
from .simulate import RATE, Channels
from .table import rotation

__all__ = [
    "VARIABLES",
    "Fault",
    "Instruments",
    "coloured_noise",
    "delayed",
    "draw_instruments",
    "floor_of",
    "low_pass",
    "observe",
    "truth",
]

# variable: dimension beside time, units, long name
VARIABLES = {
    "platen_displacement": ("axis", "m, rad", "displacement of C, Euler angles"),
    "platen_velocity": ("axis", "m/s, rad/s", "velocity of C, Euler angle rates"),
    "platen_acceleration": ("axis", "m/s2, rad/s2", "acceleration of C, second derivatives of the Euler angles"),
    "actuator_displacement": ("actuator", "m", "length less length in the control zero-position"),
    "actuator_force": ("actuator", "N", "hydraulic force of the actuator"),
    "chamber_pressure_a": ("actuator", "Pa", "pressure in chamber A"),
    "chamber_pressure_b": ("horizontal", "Pa", "pressure in chamber B"),
    "strut_pressure": ("strut", "Pa", "nitrogen pressure"),
    "supply_pressure": ("", "Pa", "supply pressure"),
    "spool_command": ("actuator", "1", "fourth-stage spool command"),
    "spool_position": ("actuator", "1", "fourth-stage spool feedback"),
    "reference_displacement": ("axis", "m, rad", "commanded displacement of C"),
}
COMPUTED = ("spool_command", "reference_displacement")  # the controller's own numbers: exact


@dataclass(frozen=True)
class Fault:
    """One instrument out of its usual range: a channel's gain, offset, cross-talk, or a group's delay."""

    family: str
    channels: tuple[tuple[str, int], ...]
    gain: float = 0.0
    offset: float = 0.0
    cross: float = 0.0  # share of the next axis
    delay: float = 0.0  # [s]


@dataclass(frozen=True)
class Instruments:
    """Calibration errors of a campaign: gain errors and offsets by variable, delays by group [s], and faults."""

    gain: dict[str, np.ndarray]
    offset: dict[str, np.ndarray]
    delay: dict[str, float]
    faults: tuple[Fault, ...] = field(default=())


def group_of(name: str) -> str:
    """Channels that are sampled together: both chambers' pressures are one group."""
    return name.removesuffix("_a").removesuffix("_b") if name.startswith("chamber") else name


def draw_instruments(numbers: dict, random: np.random.Generator, faults: tuple[Fault, ...] = ()) -> Instruments:
    """Errors within the usual ranges, uniform."""
    width = {"axis": 6, "actuator": 10, "horizontal": 4, "strut": 3, "": 1}
    gain: dict[str, np.ndarray] = {}
    offset: dict[str, np.ndarray] = {}
    delay: dict[str, float] = {}
    for name, (dim, *_) in VARIABLES.items():
        usual = 0.0 if name in COMPUTED else 1.0
        gain[name] = usual * random.uniform(-1, 1, width[dim]) * numbers["gain"]
        offset[name] = random.uniform(-1, 1, width[dim]) * numbers["offset"].get(name, 0.0)
        delay.setdefault(group_of(name), usual * random.uniform(-0.5, 0.5) * numbers["skew"])
    return Instruments(gain, offset, delay, faults)


def truth(channels: Channels, reference: np.ndarray, cog: np.ndarray) -> dict[str, np.ndarray]:
    """The variables of a record as they were, at 2048 Hz: (n, channels) each."""
    y, acceleration = channels.state, channels.twist_rate
    R = np.array([rotation(pose) for pose in y[:, :6]])
    v, w, dv, dw = y[:, 6:9], y[:, 9:12], acceleration[:, :3], acceleration[:, 3:]
    velocity = np.einsum("nij,nj->ni", R, v - np.cross(w, cog))
    own = dv + np.cross(w, v) - np.cross(dw, cog) - np.cross(w, np.cross(w, cog))
    (p, q, r), (dp, dq, dr) = w.T, dw.T
    sa, ca, sb, cb = np.sin(y[:, 3]), np.cos(y[:, 3]), np.sin(y[:, 4]), np.cos(y[:, 4])
    yaw = (q * sa + r * ca) / cb
    pitch, roll = q * ca - r * sa, p + yaw * sb
    turn = dq * sa + dr * ca + roll * pitch  # d/dt of (yaw cb)
    yaw2 = (turn + yaw * sb * pitch) / cb
    pitch2 = dq * ca - dr * sa - roll * yaw * cb
    roll2 = dp + yaw2 * sb + yaw * cb * pitch
    shown = channels.shown
    return {
        "platen_displacement": y[:, :6],
        "platen_velocity": np.column_stack([velocity, roll, pitch, yaw]),
        "platen_acceleration": np.column_stack([np.einsum("nij,nj->ni", R, own), roll2, pitch2, yaw2]),
        "actuator_displacement": shown[:, X : X + 10],
        "actuator_force": shown[:, PULL : PULL + 10],
        "chamber_pressure_a": y[:, PA : PA + 10],
        "chamber_pressure_b": y[:, PB : PB + 4],
        "strut_pressure": shown[:, GAS_PRESSURE : GAS_PRESSURE + 3],
        "supply_pressure": shown[:, SUPPLY_PRESSURE : SUPPLY_PRESSURE + 1],
        "spool_command": channels.command,
        "spool_position": channels.spool,
        "reference_displacement": reference,
    }


def observe(
    true: dict[str, np.ndarray], instruments: Instruments, numbers: dict, random: np.random.Generator
) -> dict[str, np.ndarray]:
    """The recorded variables at 512 Hz."""
    late = dict(instruments.delay)
    for fault in instruments.faults:
        for group in {group_of(name) for name, _ in fault.channels}:
            late[group] += fault.delay
    seen = {}
    for name, values in true.items():
        values = np.array(values)
        for fault in instruments.faults:
            for variable, column in fault.channels:
                if variable == name:
                    beside = true[name][:, (column + 1) % 3] if fault.cross else 0.0
                    values[:, column] += fault.gain * values[:, column] + fault.offset + fault.cross * beside
        values = values * (1.0 + instruments.gain[name]) + instruments.offset[name]
        if delay := late[group_of(name)]:
            values = delayed(values, delay * RATE)
        if name not in COMPUTED:
            values = values + coloured_noise(values.shape, numbers, random) * np.array(numbers["noise"][name])
            values = low_pass(values, numbers)
        seen[name] = _sixteen_bits(values[:: round(RATE / numbers["rate"])], VARIABLES[name][0])
    return seen


def delayed(values: np.ndarray, samples: float) -> np.ndarray:
    """Values some samples late, by Lagrange's cubic through four neighbours; held at the ends."""
    whole = int(np.floor(samples))
    f = 1.0 - (samples - whole)  # place between the samples before and after
    first, last = -f * (f - 1) * (f - 2) / 6, (f + 1) * f * (f - 1) / 6
    weights = np.array([first, (f + 1) * (f - 1) * (f - 2) / 2, -(f + 1) * f * (f - 2) / 2, last])
    rows = np.clip(np.arange(len(values))[:, None] - whole - 2 + np.arange(4), 0, len(values) - 1)
    return np.einsum("k,nkc->nc", weights, values[rows])


def low_pass(values: np.ndarray, numbers: dict) -> np.ndarray:
    """Zero-phase Butterworth of the recorder."""
    sos = butter(numbers["low_pass_order"], numbers["low_pass"], fs=RATE, output="sos")
    return sosfiltfilt(sos, values, axis=0)


def floor_of(name: str, numbers: dict) -> np.ndarray:
    """Standard deviation of a recorded variable's noise, white noise through the low-pass taken as its measure."""
    return np.array(numbers["noise"][name]) * numbers["noise_left"]


def coloured_noise(shape: tuple[int, ...], numbers: dict, random: np.random.Generator) -> np.ndarray:
    """Noise of unit variance: mostly white, a share of it slower."""
    share, pole = numbers["colour_share"], np.exp(-2 * np.pi * numbers["colour_corner"] / RATE)
    slow = lfilter([np.sqrt(1 - pole**2)], [1, -pole], random.standard_normal(shape), axis=0)
    return np.sqrt(1 - share) * random.standard_normal(shape) + np.sqrt(share) * slow


def _sixteen_bits(values: np.ndarray, dim: str) -> np.ndarray:
    """Steps of a converter set to the test's range, one range for translations and one for rotations."""
    parts = [slice(0, 3), slice(3, 6)] if dim == "axis" else [slice(None)]
    out = np.empty_like(values)
    for part in parts:
        step = max(float(np.abs(values[:, part]).max()), 1e-9) * 1.02 / 2**15
        out[:, part] = np.round(values[:, part] / step) * step
    return out
