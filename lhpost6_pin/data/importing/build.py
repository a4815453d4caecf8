"""From raw columns and a channel map to a record: units to SI, sign, gain, offset, holes, one rate."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...core.arrays import Array, Mask
from ...core.errors import ParameterError, RecordError
from ...core.names import AXES
from ...machine.components import Accelerometer
from ...machine.machine import Machine
from ...mechanics.accelerometers import accelerometer_rows
from ...mechanics.plant import make_plant
from ..accelerometers import accelerometer_channel, with_platen_acceleration
from ..channels import LAYOUT, channel_unit
from ..filled_samples import CONSTANT, FILLED, stated_runs
from ..records import make_record
from .channel_map import ChannelMap, channels_of, check_map, find_column, still_channels, with_labels
from .channel_units import si_factor
from .raw import RawTest
from .sampling import Sampling, common_time, fill_holes, resample, uniform

__all__ = ["described_sources", "make_imported_record"]


_OF_AN_EXPORT = ("machine", "controller", "noise", "cut", "trouble")
"""Attributes of a record that come back from its export: without `noise` a simulated one would have none."""


def make_imported_record(
    raws: Sequence[RawTest],
    channels: ChannelMap,
    labels: Mapping[str, Sequence[str]],
    machine: Machine | None = None,
) -> xr.Dataset:
    """Make a record from the raw columns of one test.

    `labels` are the machine's, by dimension (`actuator`, `horizontal`, `strut`). With a `machine`, axes in which it
    cannot move are zero. Attributes list what was filled or held constant.
    Raises RecordError naming map and key, or file, channel and sample.
    """
    labels = with_labels(labels, list(channels.channels))
    moves = machine.axis_names if machine else AXES
    check_map(channels, labels, moves)
    known = channels_of(labels)
    sources = {name: source for name, source in channels.channels.items() if source.constant is None}
    constant = [name for name in channels.channels if name not in sources]
    if not sources:
        raise RecordError(f"{channels.origin}, [channel]: every channel is constant; map a column")
    places = {name: find_column(source, raws, _key(channels, name)) for name, source in sources.items()}
    most = channels.test.fill_gaps
    used = sorted({file for file, _ in places.values()})
    samplings = {file: _sampling(raws[file], channels, most) for file in used}
    time = common_time(list(samplings.values()), channels.test.rate, channels.origin)
    filled = [f"{raws[f].source}: {_runs(s.gaps)}" for f, s in samplings.items() if s.gaps]
    missing = np.zeros(len(time), bool)
    for sampling in samplings.values():
        missing |= _within(time, sampling, sampling.gaps)
    columns: dict[str, Array] = {}
    for name, (file, column) in places.items():
        where, sampling = f"{raws[file].source}, {name} (column {raws[file].names[column]!r})", samplings[file]
        values, holes = fill_holes(_si(raws[file], column, channels, name), most, where)
        filled += [f"{name}: {_runs(holes)}"] * bool(holes)
        missing |= _within(time, sampling, [(int(sampling.place[k]), count) for k, count in holes])
        everywhere = np.full(len(sampling.time), np.nan)  # with rows that the file lacks
        everywhere[sampling.place] = values
        columns[name] = resample(fill_holes(everywhere, most, where)[0], sampling, time)
    columns |= {name: np.full(len(time), _constant(channels, name)) for name in constant}
    together: dict[str, list[Array]] = {}  # complete, by `check_map`
    mapped = {known[name][0] for name in columns}
    for name in still_channels(labels, moves):
        if known[name][0] in mapped:
            columns.setdefault(name, np.zeros(len(time)))
    for name, (variable, _) in known.items():
        if name in columns:
            together.setdefault(variable, []).append(columns[name])
    variables: dict[str, Any] = {
        v: np.column_stack(c) if len(LAYOUT[v].dims) > 1 else c[0] for v, c in together.items()
    }
    attrs = _attrs(raws, channels, used)
    if filled:
        attrs["filled"] = "interpolated samples: " + "; ".join(filled)
        attrs[FILLED] = stated_runs(missing)
    if constant:
        attrs[CONSTANT] = "not measured, stated in the map: " + ", ".join(constant)
    if "point_acceleration" in variables:
        rows = accelerometer_rows(_accelerometers(channels, labels["accelerometer"], machine))
        variables["point_acceleration"] = accelerometer_channel(rows, variables["point_acceleration"])
    try:
        record = make_record(time, variables, labels, attrs)
        if "point_acceleration" not in variables or "platen_acceleration" in variables or machine is None:
            return record
        return with_platen_acceleration(make_plant(machine), record)
    except (RecordError, ParameterError) as error:
        raise RecordError(f"{channels.origin}: {error}") from None


def _accelerometers(channels: ChannelMap, names: Sequence[str], machine: Machine | None) -> list[Accelerometer]:
    """Accelerometers with the points and directions of the map, else of the machine; raises RecordError."""
    known = {one.name: one for one in machine.accelerometers} if machine else {}
    found = []
    for name in names:
        key = f"point_acceleration[{name}]"
        source = channels.channels[key]
        if source.point is not None and source.direction is not None:
            found.append(Accelerometer(name, source.point, source.direction))
        elif name in known:
            found.append(known[name])
        else:
            raise RecordError(
                f"{_key(channels, key)}: where is it? add point = [x, y, z] in metres from C and direction, in platen "
                "axes, or name a sensors file that states it with --accelerometers"
            )
    return found


def described_sources(raws: Sequence[RawTest], channels: ChannelMap) -> dict[str, str]:
    """Source of each mapped channel, as in `run.csv: Long Displ fbk [in]`."""
    found = {}
    for name, source in channels.channels.items():
        if source.constant is not None:
            found[name] = f"constant {source.constant:g} [{source.unit}]"
            continue
        file, column = find_column(source, raws, _key(channels, name))
        raw, factor = raws[file], source.sign * source.gain
        unit = f" [{source.unit or raw.units[column] or ''}]"
        shift = f" + {source.offset:g}" if source.offset else ""
        times = "" if factor == 1 else f" x {factor:g}"
        shown = "" if raw.names[column].endswith(unit.strip()) else unit
        found[name] = f"{Path(raw.source).name}: {raw.names[column]}{shift}{times}{shown}"
    return found


def _key(channels: ChannelMap, name: str) -> str:
    return f"{channels.origin}, [channel] {name}"


def _runs(runs: Sequence[tuple[int, int]]) -> str:
    more = f" and {len(runs) - 20} more runs" if len(runs) > 20 else ""
    return ", ".join(f"{count} from sample {first}" for first, count in runs[:20]) + more


def _within(time: Array, sampling: Sampling, runs: Sequence[tuple[int, int]]) -> Mask:
    """Samples (m,) of a record in runs (first, count) of a file's samples, and those interpolated with their help."""
    mask = np.zeros(len(time), bool)
    for first, count in runs:
        start, end = sampling.time[first], sampling.time[first + count - 1]
        mask |= (time > start - sampling.step) & (time < end + sampling.step)
    return mask


def _sampling(raw: RawTest, channels: ChannelMap, most: int) -> Sampling:
    if raw.time is not None:
        return uniform(raw.time, most, raw.source)
    rate = channels.test.file_rate
    if rate is None:
        raise RecordError(f"{raw.source}: has no time; add a column `time [s]`, or file_rate [Hz] to [test] of the map")
    return Sampling(np.arange(len(raw.values)) / rate, np.arange(len(raw.values)))


def _si(raw: RawTest, column: int, channels: ChannelMap, name: str) -> Array:
    source, unit = channels.channels[name], channel_unit(name)
    written = source.unit or raw.units[column]
    where = f"{_key(channels, name)}: column {raw.names[column]!r} of {raw.source}"
    if written is None:
        raise RecordError(f'{where} has no unit in the file; add unit = "..." (a record has {unit})')
    factor = _factor(written, unit, where)
    with np.errstate(over="ignore", invalid="ignore"):  # infinite values are refused with their sample
        return source.sign * source.gain * factor * (raw.values[:, column] + source.offset)


def _constant(channels: ChannelMap, name: str) -> float:
    source, unit = channels.channels[name], channel_unit(name)
    factor = _factor(source.unit or unit, unit, _key(channels, name))
    return source.sign * source.gain * factor * float(source.constant or 0.0)


def _factor(unit: str, wanted: str, where: str) -> float:
    try:
        return si_factor(unit, wanted)
    except RecordError as error:
        raise RecordError(f"{where}: {error}") from None


def _attrs(raws: Sequence[RawTest], channels: ChannelMap, used: Sequence[int]) -> dict[str, Any]:
    test = channels.test
    name = test.name or Path(raws[used[0]].source).stem
    files = "; ".join(f"{Path(raws[k].source).name} ({raws[k].form})" for k in used)
    exported = [raws[k].facts for k in used if "layout_version" in raws[k].facts]
    return {
        **{key: facts[key] for facts in reversed(exported) for key in _OF_AN_EXPORT if key in facts},
        "title": name,
        "test": name,
        "kind": test.kind,
        "valves_per_horizontal_actuator": test.valves_per_horizontal_actuator,
        "specimen": test.specimen,
        "source": f"imported from {files}",
        "columns": "; ".join(f"{key} = {source}" for key, source in described_sources(raws, channels).items()),
    }
