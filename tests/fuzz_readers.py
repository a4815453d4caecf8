"""Every reader of the package, a valid file for it, what is done with what it reads, and how the file is broken.

What a reader gives back must be usable: `use` does the next thing that the package would do, and says by an assertion
what was promised. It may still refuse, with an error of the package.
"""

import io
import math
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

import fuzzing
import numpy as np
import pandas as pd
import xarray as xr
from data_files import LABELS, binary_469d, header, sines, text_469d
from hypothesis import strategies as st
from motions_files import at2_text, cosmos_text, csmip_text, film_text, knet_text, v2_text
from run_cases import at_rest

from lhpost6_pin.control import load_controller, make_controller
from lhpost6_pin.control.inverse import InverseFilter, apply_inverse, load_inverse, save_inverse
from lhpost6_pin.core.files import models_folder
from lhpost6_pin.core.names import AXES
from lhpost6_pin.data.channels import LAYOUT, channel_unit
from lhpost6_pin.data.check import check_record
from lhpost6_pin.data.importing import channel_units, guess_map, load_map, load_raw, make_imported_record, save_map
from lhpost6_pin.data.importing.channel_map import Source, channels_of
from lhpost6_pin.data.importing.raw import make_raw
from lhpost6_pin.data.records import load_record, make_record, sample_interval, save_record
from lhpost6_pin.data.sensors import add_noise, load_sensors
from lhpost6_pin.machine.machine import Machine, load_machine
from lhpost6_pin.machine.parameters import load_parameters
from lhpost6_pin.motions import find_motion, library, list_motions, load_motion, make_target, motion_options
from lhpost6_pin.show.urdf import urdf_text
from lhpost6_pin.show.viewer import record_frames
from lhpost6_pin.simulation.simulated_campaign import tests_of
from lhpost6_pin.tuning.drives import circumstances, load_drive, save_drive

Breaks = st.SearchStrategy[bytes]


class Reader(NamedTuple):
    """A reader by name: `load` reads a file called `file`, `use` goes on with what it gave."""

    name: str
    file: str
    seed: Callable[[], bytes]
    load: Callable[[Path], Any]
    use: Callable[[Any], object]
    breaks: Callable[[bytes], Breaks]
    share: float = 0.5  # of a profile's examples, each a whole file

    def broken(self) -> Breaks:
        return self.breaks(self.seed())


# ------------------------------------------------------------------------------------------------- ground motions
WAVE = 0.3 * np.sin(np.arange(43) / 7)
CSV = "# a comment\ntime_s,ax_g,z [mm/s^2],roll_deg_s2\n" + "".join(
    f"{k / 100},{x},{9 * x},1\n" for k, x in enumerate(WAVE)
)
CLOCK = np.arange(43) / 200
NUMBERS = "".join(f"{x:.5f} {9 * x:.5f} 1\n" for x in WAVE)


def load_columns(path: Path) -> Any:
    """A motion from columns without names."""
    return load_motion(path, time_step=0.01, units="g", channels="x=1,z=2")


def use_motion(motion: Any) -> None:
    """A motion is finite and six wide; a target of it likewise."""
    assert motion.samples.shape[1] == 6 and np.isfinite(motion.samples).all() and motion.time_step > 0
    target = make_target(motion)
    assert all(np.isfinite(x).all() for x in (target.time, target.displacement, target.velocity, target.acceleration))


# ------------------------------------------------------------------------------------------------- netCDF
SIZES = {"axis": 6} | {dim: len(labels) for dim, labels in LABELS.items()}


def some_record(count: int, rate: float, *names: str) -> xr.Dataset:
    """Smooth channels of the layout, those named."""
    channels = {}
    for name in names:
        shape = (count, *(SIZES[dim] for dim in LAYOUT[name].dims[1:]))
        channels[name] = 0.001 * sines(count, math.prod(shape[1:]), rate).reshape(shape)
    labels = {dim: LABELS[dim] for dim in LABELS}
    return make_record(np.arange(count) / rate, channels, labels, {"kind": "simulated", "test": "sines"})


def file_of(save: Callable[[Path], object]) -> bytes:
    """Content of the file that a function writes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "seed"
        save(path)
        return path.read_bytes()


def short_record() -> bytes:
    """Sixteen samples of a bit of everything."""
    names = ("platen_displacement", "chamber_pressure_a", "chamber_pressure_b", "spool_position", "supply_pressure")
    return file_of(lambda path: save_record(some_record(16, 512.0, *names), path))


def long_record() -> bytes:
    """So many samples that the consistency of channels is looked at, too."""
    names = ("platen_displacement", "platen_velocity", "platen_acceleration", "actuator_force")
    return file_of(lambda path: save_record(some_record(300, 128.0, *names), path))


def drive_file() -> bytes:
    """A drive of a short motion."""
    target = make_target(find_motion("sine", amplitude=0.02, period=0.5, cycles=1, ramp_cycles=1), pad=0.1)
    target = replace(
        target, **{n: getattr(target, n)[:32] for n in ("time", "displacement", "velocity", "acceleration")}
    )
    attrs = circumstances(load_machine(), "lhpost6")
    return file_of(lambda path: save_drive(target.acceleration, "acceleration", target, path, attrs))


def inverse_file() -> bytes:
    """An inverse that does nothing."""
    taps = np.zeros((9, 2, 2))
    taps[4] = np.eye(2)
    inverse = InverseFilter(taps, 2048.0, (0.5, 30.0), ("x", "z"), circumstances(load_machine(), "lhpost6"))
    return file_of(lambda path: save_inverse(inverse, path))


def loaded_record(path: Path) -> xr.Dataset:
    """A record, of which `check` has said what it is."""
    assert check_record(path)
    return load_record(path)


def use_record(record: xr.Dataset) -> None:
    """Channels are finite numbers over uniform time, and can be looked at."""
    assert sample_interval(record) > 0 and all(np.isfinite(record[name]).all() for name in LAYOUT if name in record)
    assert all(len(values) == record.sizes["time"] for _, _, values in channel_units(record))
    record_frames(machine(), record)


def use_drive(drive: Any) -> None:
    """A drive and its target are finite, of one length."""
    n, t = len(drive.values), drive.target
    arrays = (drive.values, t.displacement, t.velocity, t.acceleration)
    assert all(x.shape == (n, 6) and np.isfinite(x).all() for x in arrays) and t.time.shape == (n,)
    r = t.reference
    assert all(map(math.isfinite, (r.scale, r.high_pass, r.low_pass, r.start)))
    assert all(name in AXES for pair in r.axes for name in pair)


def use_inverse(inverse: InverseFilter) -> None:
    """An inverse makes finite drives of finite signals."""
    assert 0 < inverse.rate < math.inf and 0 < inverse.band[0] < inverse.band[1] < math.inf
    assert np.isfinite(apply_inverse(inverse, np.ones((8, 6)))).all()


def opened(seed: bytes) -> xr.Dataset:
    with xr.open_dataset(io.BytesIO(seed), engine="h5netcdf", decode_times=False) as lazy:
        return lazy.load().drop_encoding()


def netcdf(seed: bytes) -> Breaks:
    structure = fuzzing.damaged_netcdf(opened(seed))
    return st.one_of(structure, structure, fuzzing.damaged_bytes(seed, fuzzing.outside_heaps(seed)))


# ------------------------------------------------------------------------------------------------- TOML
@cache
def machine() -> Machine:
    return load_machine()


def shipped(*parts: str) -> Callable[[], bytes]:
    return models_folder().joinpath(*parts).read_bytes


OVERRIDE = b"""
[hydraulics]
bulk_modulus = { value = 8e8, unit = "Pa", evidence = "assumed", source = "a try", rel_sd = 0.1 }
[platen]
mass = { value = [150.0, 150.0, 150.0], unit = "t" }
[component.H1]
seal_friction = { value = 3e3, unit = "N" }
[machine]
thrust = "normal"
[effect.rub]
family = "local_viscous"
components = ["H1"]
"""
MAP = """
[test]
name = "EQ1"
valves_per_horizontal_actuator = 1
rate = 128.0
fill_gaps = 3
[channel]
"supply_pressure" = { column = "c1", unit = "psi", gain = 1.002, offset = 3.5 }
"strut_pressure[S1]" = { column = 2, unit = "psi", sign = -1 }
"strut_pressure[S2]" = { column = "c3*", file = "run*", unit = "psi" }
"strut_pressure[S3]" = { constant = 0.0, unit = "Pa" }
"""
PROCEDURE = b"""
[recording]
rate = { value = 512.0, unit = "Hz", evidence = "assumed", source = "a quarter" }
[TX]
motion = "triangle"
axis = "x"
amplitude = { value = 0.2, unit = "m", evidence = "assumed", source = "as test TX5" }
seconds = { value = 11.0, unit = "s", evidence = "assumed", source = "three cycles" }
"""


def use_specimen(table: Machine) -> None:
    """A machine comes to rest, with a specimen too."""
    assert np.isfinite(at_rest(table)[1].spool).all()


def use_machine(table: Machine) -> None:
    assert urdf_text(table)
    use_specimen(table)


def use_controller(settings: Any) -> None:
    """Settings make a controller of finite numbers."""
    controller = make_controller(*at_rest(machine()), settings)
    assert all(np.isfinite(table.view(float)).all() for table in (controller.axis, controller.actuator))


def use_map(channels: Any) -> None:
    """A map makes a record, of files that have its columns; what is written of it reads the same."""
    values, time = 1e3 + sines(64, 3), np.arange(64) / 256.0
    raw = make_raw("run.csv", "table", ["c1", "c2", "c3"], ["psi"] * 3, values, time)
    with tempfile.TemporaryDirectory() as folder:
        save_map(channels, Path(folder) / "again.toml")
        again = load_map(Path(folder) / "again.toml")
    assert (again.test, again.channels) == (channels.test, channels.channels)
    record = make_imported_record([raw], channels, LABELS)
    file_of(lambda path: save_record(record, path))


def use_sensors(sensors: Any) -> None:
    """Sensors make a noisy record of a finite one."""
    rng = np.random.default_rng(1)
    noisy = add_noise(some_record(16, 512.0, "platen_displacement", "supply_pressure"), sensors, rng)
    assert all(np.isfinite(noisy[name]).all() for name in noisy.data_vars)
    assert all(np.isfinite(sensors.noise_sd(name)).all() for name in sensors.noise)


def use_procedure(numbers: Any) -> None:
    """What runs a procedure finds its tests and their numbers."""
    assert all(math.isfinite(numbers.number(f"{test}.seconds")) for test in tests_of(numbers))


def load_motions(path: Path) -> Any:
    """All motions known by name, and their options, with `path` in place of the shipped file of that name."""
    whole = {name: models_folder() / "ground_motions" / name for name in ("index.toml", "tests.toml")}
    read = library.load_toml
    table = {str(whole[path.name]): path}
    library._tables.cache_clear()
    with mock.patch.object(library, "load_toml", lambda file: read(table.get(str(file), file))):
        try:
            return [(entry, motion_options(entry.name)) for entry in list_motions()]
        finally:
            library._tables.cache_clear()


def use_motions(found: Any) -> None:
    """Every motion has a name, and says what to bring for it."""
    assert all(isinstance(entry.name, str) and isinstance(entry.request, str) for entry, _ in found)


def toml(seed: bytes) -> Breaks:
    tree = fuzzing.damaged_toml(seed)
    return st.one_of(tree, tree, fuzzing.damaged_lines(seed), fuzzing.damaged_bytes(seed))


def text(seed: bytes) -> Breaks:
    return st.one_of(fuzzing.damaged_lines(seed), fuzzing.damaged_lines(seed), fuzzing.damaged_bytes(seed))


# ------------------------------------------------------------------------------------------------- imports
COLUMNS = ("Long Displ fbk", "Lat Displ fbk", "Supply Press")
VALUES = sines(12, 3)
TABLE = "# test: EQ1\ntime [s],Long Displ fbk [in],Supply Press [psi]\n" + "".join(
    f"{k / 256},{a:.6g},{b:.6g}\n" for k, (a, b, _) in enumerate(VALUES)
)
FLAT = {"time": np.arange(12) / 256, "x_m": VALUES[:, 0], "y_in": VALUES[:, 1], "note": "a test"}
TREE = {"time": np.arange(12) / 256, "x_m": VALUES[:, 0], "b": {"fs": 256.0, "y": VALUES}}


def of_469d(write: Callable[..., bytes]) -> Callable[[], bytes]:
    channels = [
        (name, unit, VALUES[:, k]) for k, (name, unit) in enumerate(zip(COLUMNS, ("in", "in", "psi"), strict=True))
    ]
    return lambda: write(header(channels, 1 / 256), VALUES)


def use_raws(raws: Any) -> None:
    """Columns are of one length with their time, and a map guessed for them makes a record or says why not."""
    for raw in raws:
        assert raw.values.shape == (len(raw.values), len(raw.names)) and len(raw.units) == len(raw.names)
        assert raw.time is None or raw.time.shape == raw.values.shape[:1]
    guessed, remarks = guess_map(raws, LABELS)
    known = channels_of(LABELS)
    whole = {known[name][0] for name in guessed.channels}  # variables of which some channels were found
    rest = {name: Source(constant=0.0, unit=channel_unit(name)) for name in known if known[name][0] in whole}
    with tempfile.TemporaryDirectory() as folder:
        save_map(replace(guessed, channels=rest | dict(guessed.channels)), Path(folder) / "map.toml", remarks)
        channels = load_map(Path(folder) / "map.toml")
    record = make_imported_record(raws, channels, LABELS)
    file_of(lambda path: save_record(record, path))


def netcdf3() -> bytes:
    return bytes(some_record(12, 256.0, "platen_displacement", "supply_pressure").to_netcdf(engine="scipy"))


def tdms() -> bytes:
    from nptdms import ChannelObject, TdmsWriter

    def save(path: Path) -> None:
        with TdmsWriter(path) as writer:
            for k, name in enumerate(COLUMNS[:2]):
                about = {"wf_increment": 1 / 256, "unit_string": "in"}
                writer.write_segment([ChannelObject("g", name, VALUES[:, k], about)])

    return file_of(save)


def parquet() -> bytes:
    table = pd.DataFrame({"time [s]": np.arange(12) / 256, "Long Displ fbk [in]": VALUES[:, 0]})
    return file_of(lambda path: table.to_parquet(path, index=False))


def hdf5(seed: bytes) -> Breaks:
    places = fuzzing.outside_heaps(seed)
    return st.one_of(fuzzing.trees.map(fuzzing.hdf5_file), fuzzing.damaged_bytes(seed, places))


def mat73(seed: bytes) -> Breaks:
    places = fuzzing.outside_heaps(seed)
    any_tree = fuzzing.trees.map(lambda tree: fuzzing.hdf5_file(tree, matlab=True))
    return st.one_of(any_tree, fuzzing.damaged_bytes(seed, places))


def mat5(seed: bytes) -> Breaks:
    return st.one_of(fuzzing.trees.map(fuzzing.mat_file), fuzzing.damaged_bytes(seed))


CONTENT: dict[Callable[[Any], object], Callable[[Any], object]] = {
    use_motion: lambda motion: np.ptp(motion.samples) > 0,
    use_record: lambda record: record.attrs["test"] == "sines" and np.ptp(record["platen_displacement"].values) > 0,
    use_drive: lambda drive: drive.attrs["controller"] == "lhpost6" and len(drive.values) == 32,
    use_inverse: lambda inverse: inverse.axes == ("x", "z") and inverse.taps.shape == (9, 2, 2),
    use_machine: lambda table: table.actuators and table.platen.mass[0] > 0,
    use_controller: lambda settings: settings == load_controller("lhpost6"),
    use_map: lambda channels: channels.test.name == "EQ1" and len(channels.channels) == 4,
    use_sensors: lambda sensors: list(sensors.noise) == list(load_sensors().noise),
    use_procedure: lambda numbers: list(tests_of(numbers)) == ["TX"],
    use_motions: lambda found: [entry.name for entry, _ in found] == [entry.name for entry in list_motions()],
    use_raws: lambda raws: raws and all(np.ptp(raw.values, axis=0).all() for raw in raws),
    use_specimen: lambda table: table.specimen.file.stem == "broken",
}
"""What a valid file of each kind holds, by how it is used."""


def mounted(path: Path) -> Machine:
    return machine().with_specimen(path)


READERS = (
    Reader("csv", "broken.csv", CSV.encode, load_motion, use_motion, text),
    Reader("at2", "broken.AT2", lambda: at2_text(WAVE).encode(), load_motion, use_motion, text),
    Reader("csmip", "broken.RAW", lambda: csmip_text([("90", WAVE)]).encode(), load_motion, use_motion, text),
    Reader("cosmos", "broken.v1", lambda: cosmos_text([(90, WAVE)]).encode(), load_motion, use_motion, text),
    Reader(
        "film",
        "broken.RAW",
        lambda: film_text([("90 DEG", np.arange(43) / 200, WAVE)]).encode(),
        load_motion,
        use_motion,
        text,
    ),
    Reader("v2", "broken.V2", lambda: v2_text([("90 Deg", 100 * WAVE)]).encode(), load_motion, use_motion, text),
    Reader("knet", "broken.EW", lambda: knet_text(1e6 * WAVE).encode(), load_motion, use_motion, text),
    Reader("columns", "broken.txt", lambda: NUMBERS.encode(), load_columns, use_motion, text),
    Reader("motions", "index.toml", shipped("ground_motions", "index.toml"), load_motions, use_motions, toml, 0.3),
    Reader("tests", "tests.toml", shipped("ground_motions", "tests.toml"), load_motions, use_motions, toml, 0.3),
    Reader("record", "broken.nc", short_record, loaded_record, use_record, netcdf),
    Reader("long record", "broken.nc", long_record, loaded_record, use_record, netcdf, 0.5),
    Reader("drive", "broken.nc", drive_file, load_drive, use_drive, netcdf, 0.5),
    Reader("inverse", "broken.nc", inverse_file, load_inverse, use_inverse, netcdf),
    Reader("machine", "broken.toml", shipped("lhpost6.toml"), load_machine, use_machine, toml),
    Reader("uniaxial", "broken.toml", shipped("uniaxial.toml"), load_machine, use_machine, toml, 0.5),
    Reader("override", "broken.toml", lambda: OVERRIDE, lambda p: load_machine("lhpost6", p), use_machine, toml, 0.5),
    Reader(
        "controller", "bad.toml", shipped("controllers", "lhpost6.toml"), load_controller, use_controller, toml, 0.5
    ),
    Reader("map", "broken.toml", MAP.encode, load_map, use_map, toml),
    Reader("sensors", "broken.toml", shipped("sensors", "lhpost6.toml"), load_sensors, use_sensors, toml, 0.5),
    Reader("procedure", "broken.toml", lambda: PROCEDURE, load_parameters, use_procedure, toml),
    Reader("469d", "broken.bin", of_469d(binary_469d), load_raw, use_raws, fuzzing.damaged_bytes),
    Reader("469d text", "broken.txt", of_469d(text_469d), load_raw, use_raws, text),
    Reader("table", "broken.csv", TABLE.encode, load_raw, use_raws, text),
    Reader("mat5", "broken.mat", lambda: fuzzing.mat_file(TREE), load_raw, use_raws, mat5),
    Reader("mat4", "broken.mat", lambda: fuzzing.mat_file(FLAT, "4"), load_raw, use_raws, fuzzing.damaged_bytes),
    Reader("mat73", "broken.mat", lambda: fuzzing.hdf5_file(TREE, matlab=True), load_raw, use_raws, mat73),
    Reader("hdf5", "broken.h5", lambda: fuzzing.hdf5_file(TREE), load_raw, use_raws, hdf5),
    Reader("netcdf4", "broken.h5", short_record, load_raw, use_raws, netcdf, 0.5),
    Reader("netcdf3", "broken.nc", netcdf3, load_raw, use_raws, fuzzing.damaged_bytes),
    Reader("tdms", "broken.tdms", tdms, load_raw, use_raws, fuzzing.damaged_bytes),
    Reader("parquet", "broken.parquet", parquet, load_raw, use_raws, fuzzing.damaged_bytes),
    Reader("urdf", "broken.urdf", shipped("specimens", "pendulum.urdf"), mounted, use_specimen, text, 0.3),
    Reader("matrices", "broken.toml", shipped("specimens", "shear_frame.toml"), mounted, use_specimen, toml, 0.3),
)
