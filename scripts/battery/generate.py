"""Run a case's tests and write them: a folder of records, as a recorder would leave it."""

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from .cases import Case, Test, draw_cases, model, numbers
from .hidden import Effect, switch_on
from .machines import loop_of
from .motions import make_motion
from .sealing import seal, unseal
from .sensors import VARIABLES, observe, truth
from .simulate import RATE, Channels, make_gains, simulate
from .table import ACTUATORS, LEGS, make_table, nominal_values

__all__ = ["draw_cases", "machine", "run_test", "seal", "unseal", "write_case"]

AXES = ("x", "y", "z", "roll", "pitch", "yaw")
COORDS = {"axis": AXES, "actuator": ACTUATORS, "horizontal": ACTUATORS[:4], "strut": LEGS[10:]}


class Run(NamedTuple):
    """One test as it was, at 2048 Hz."""

    channels: Channels
    legs: np.ndarray
    platen: np.ndarray
    reference: np.ndarray
    surge: np.ndarray

    def truth(self) -> dict[str, np.ndarray]:
        """The variables of a record, without noise."""
        return truth(self.channels, self.reference, np.array([self.platen[0][f"cog_{axis}"] for axis in "xyz"]))


def machine(case: Case, test: Test, effects: tuple[Effect, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Legs and platen of a case in a test, with these effects."""
    legs, platen = make_table(case.values, numbers()["integration"]["yield_factor"])
    for name, factor in case.scatter.items():
        legs[name] *= factor
    platen["bulk"] *= 1.0 + test.oil * case.oil["bulk"]
    legs["viscous"] *= 1.0 + test.oil * case.oil["viscous"]
    for effect in effects:
        switch_on(effect, legs, platen, LEGS)
    return legs, platen


def run_test(case: Case, test: Test, effects: tuple[Effect, ...] | None = None) -> Run:
    """Run a test with the case's effects, or others in their place."""
    settings = numbers()["integration"]
    legs, platen = machine(case, test, case.effects if effects is None else effects)
    nominal = make_table(nominal_values(case.model), settings["yield_factor"])
    reference = make_motion(test.settings, test.seed)
    surge = platen[0]["surge"] * _bursts(len(reference), test.seed)
    gains = make_gains(*nominal, loop_of(case.model, model(), numbers()["loop"]))
    held = _held(numbers()["start"]["held"], np.random.default_rng([test.seed, 3]))
    channels = simulate(legs, platen, nominal, gains, reference, surge, settings["substeps"], held)
    return Run(channels, legs, platen, reference, surge)


def _held(most: float, random: np.random.Generator) -> np.ndarray:
    """Shares of friction that seals (13) and pads (6 along two axes) hold at the start, up to `most` of it (25)."""
    size, way = most * np.sqrt(random.random(6)), random.uniform(0.0, 2.0 * np.pi, 6)
    pads = np.stack([size * np.cos(way), size * np.sin(way)], axis=1)
    return np.concatenate([random.uniform(-most, most, 13), pads.ravel()])


def _bursts(n: int, seed: int) -> np.ndarray:
    """Surges that come and go without cause: slow noise of unit root mean square, at rest at first (n)."""
    rule = numbers()["surge"]
    random = np.random.default_rng([seed, 1])
    f = np.fft.rfftfreq(n, 1 / RATE)
    spectrum = (random.standard_normal(len(f)) + 1j * random.standard_normal(len(f))) * (f > 0)
    wave = np.fft.irfft(spectrum / (1 + (f / rule["corner"]) ** 4), n)
    return wave / wave.std() * np.clip(np.arange(n) / (rule["rise"] * RATE), 0.0, 1.0)


def write_case(case: Case, folder: Path) -> Path:
    """Write `folder/<id>/<test>.nc` for each test and `campaign.toml` with the tests to hold out; the case's folder."""
    home = Path(folder) / case.id
    home.mkdir(parents=True, exist_ok=True)
    for test in case.tests:
        random = np.random.default_rng([test.seed, 2])
        seen = observe(run_test(case, test).truth(), case.instruments, numbers()["sensors"], random)
        _save(_record(seen, test.name).drop_vars(case.left_out), home / f"{test.name}.nc")
    names = ", ".join(f'"{name}"' for name in case.hold_out)
    (home / "campaign.toml").write_text(f"hold_out = [{names}]\n", encoding="utf-8")
    return home


def _record(seen: dict[str, np.ndarray], name: str) -> xr.Dataset:
    """One test in the layout of records."""
    rate = numbers()["sensors"]["rate"]
    variables = {}
    for variable, values in seen.items():
        dim, units, text = VARIABLES[variable]
        data = values if dim else values[:, 0]
        dims = ("time", dim) if dim else ("time",)
        variables[variable] = (dims, data.astype(np.float32), {"units": units, "long_name": text})
    time = np.arange(len(seen["platen_displacement"])) / rate
    attrs = {
        "title": name,
        "test": name,
        "kind": "measured",
        "sample_rate_hz": rate,
        "valves_per_horizontal_actuator": 1,
        "specimen": "none",
        "source": "blind battery",
    }
    coords = {"time": ("time", time, {"units": "s"}), **{dim: list(names) for dim, names in COORDS.items()}}
    return xr.Dataset(variables, coords, attrs)


def _save(record: xr.Dataset, path: Path) -> None:
    """Write whole or not at all."""
    beside = path.with_suffix(".part")
    packed = {name: {"zlib": True, "complevel": 1, "shuffle": True} for name in record.data_vars}
    record.to_netcdf(beside, engine="h5netcdf", encoding=packed)
    os.replace(beside, path)
