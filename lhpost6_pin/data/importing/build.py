"""From raw columns and a channel map to a record: units to SI, sign, gain, offset, holes, one rate."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...core.errors import RecordError
from ..channels import LAYOUT, channel_unit
from ..records import make_record
from .channel_map import ChannelMap, Source, channels_of, check_map, find_column
from .channel_units import si_factor
from .raw import Array, RawTest
from .sampling import Sampling, common_time, fill_holes, resample, uniform

__all__ = ["described_sources", "make_imported_record"]


def make_imported_record(
    raws: Sequence[RawTest],
    channels: ChannelMap,
    labels: Mapping[str, Sequence[str]],
    areas: Mapping[str, tuple[float, float]] | None = None,
) -> xr.Dataset:
    """Make a record from the raw columns of one test.

    `labels` are the machine's, by dimension (`actuator`, `horizontal`, `strut`). `areas` are piston areas (A_1, A_2)
    [m2] by actuator; with them actuator forces that were not mapped follow from chamber pressures that were.
    What was filled, held constant or derived is said in the attributes. Raises RecordError naming map and key, or
    file, channel and sample.
    """
    check_map(channels, labels)
    known = channels_of(labels)
    places = {
        name: find_column(source, raws, _key(channels, name))
        for name, source in channels.channels.items()
        if source.constant is None
    }
    if not places:
        raise RecordError(f"{channels.origin}, [channel]: every channel is constant; map a column")
    most = channels.test.fill_gaps
    used = sorted({file for file, _ in places.values()})
    samplings = {file: _sampling(raws[file], channels, most) for file in used}
    time = common_time(list(samplings.values()), channels.test.rate, channels.origin)
    filled = [f"{raws[f].source}: {_runs(s.gaps)}" for f, s in samplings.items() if s.gaps]
    columns: dict[str, Array] = {}
    for name, source in channels.channels.items():
        unit = channel_unit(name)
        if source.constant is not None:
            columns[name] = np.full(len(time), _constant(source, unit, _key(channels, name)))
            continue
        file, column = places[name]
        values = _si(raws[file], column, source, unit, channels, name)
        where = f"{raws[file].source}, {name} (column {raws[file].names[column]!r})"
        values, holes = fill_holes(values, most, where)
        filled += [f"{name}: {_runs(holes)}"] * bool(holes)
        columns[name] = resample(_without_gaps(values, samplings[file], most, where), samplings[file], time)
    variables = _variables(columns, known)
    attrs = _attrs(raws, channels, used)
    if areas and "actuator_force" not in variables and (force := _force(variables, labels, areas)) is not None:
        variables["actuator_force"] = force
        attrs["derived"] = "actuator_force from chamber pressures times piston areas"
    if filled:
        attrs["filled"] = "interpolated samples: " + "; ".join(filled)
    constant = [name for name, source in channels.channels.items() if source.constant is not None]
    if constant:
        attrs["constant"] = "not measured, stated in the map: " + ", ".join(constant)
    try:
        return make_record(time, variables, labels, attrs)
    except RecordError as error:
        raise RecordError(f"{channels.origin}: {error}") from None


def described_sources(raws: Sequence[RawTest], channels: ChannelMap) -> dict[str, str]:
    """Say for each mapped channel where it comes from, as in `run.csv: Long Displ fbk [in]`."""
    found = {}
    for name, source in channels.channels.items():
        if source.constant is not None:
            found[name] = f"constant {source.constant:g} [{source.unit}]"
            continue
        file, column = find_column(source, raws, _key(channels, name))
        unit = source.unit or raws[file].units[column] or ""
        said = "" if raws[file].names[column].endswith(f"[{unit}]") else f" [{unit}]"
        shift = f" + {source.offset:g}" if source.offset else ""
        factor = source.sign * source.gain
        times = "" if factor == 1 else f" x {factor:g}"
        found[name] = f"{Path(raws[file].source).name}: {raws[file].names[column]}{shift}{times}{said}"
    return found


def _key(channels: ChannelMap, name: str) -> str:
    return f"{channels.origin}, [channel] {name}"


def _runs(runs: Sequence[tuple[int, int]]) -> str:
    more = f" and {len(runs) - 20} more runs" if len(runs) > 20 else ""
    return ", ".join(f"{count} from sample {first}" for first, count in runs[:20]) + more


def _sampling(raw: RawTest, channels: ChannelMap, most: int) -> Sampling:
    if raw.time is not None:
        return uniform(raw.time, most, raw.source)
    rate = channels.test.file_rate
    if rate is None:
        raise RecordError(
            f"{raw.source}: says nothing about time; add a column `time [s]`, or file_rate [Hz] to [test] of the map"
        )
    return Sampling(np.arange(len(raw.values)) / rate, np.arange(len(raw.values)))


def _si(raw: RawTest, column: int, source: Source, unit: str, channels: ChannelMap, name: str) -> Array:
    written = source.unit or raw.units[column]
    said = f"{_key(channels, name)}: column {raw.names[column]!r} of {raw.source}"
    if written is None:
        raise RecordError(f'{said} has no unit in the file; add unit = "..." (a record has {unit})')
    try:
        factor = si_factor(written, unit)
    except RecordError as error:
        raise RecordError(f"{said}: {error}") from None
    with np.errstate(over="ignore", invalid="ignore"):  # what becomes infinite is refused with its sample
        return source.sign * source.gain * factor * (raw.values[:, column] + source.offset)


def _without_gaps(values: Array, sampling: Sampling, most: int, where: str) -> Array:
    """Values at all of the uniform times, interpolated where the file has no row."""
    spread = np.full(len(sampling.time), np.nan)
    spread[sampling.place] = values
    return fill_holes(spread, most, where)[0]


def _constant(source: Source, unit: str, where: str) -> float:
    try:
        return source.sign * source.gain * si_factor(source.unit or unit, unit) * float(source.constant or 0.0)
    except RecordError as error:
        raise RecordError(f"{where}: {error}") from None


def _variables(columns: Mapping[str, Array], known: Mapping[str, tuple[str, str | None]]) -> dict[str, Any]:
    """Arrays by variable; `check_map` has seen to it that all their channels are there."""
    together: dict[str, list[Array]] = {}
    for name, (variable, _) in known.items():
        if name in columns:
            together.setdefault(variable, []).append(columns[name])
    return {v: np.column_stack(c) if len(LAYOUT[v].dims) > 1 else c[0] for v, c in together.items()}


def _force(
    variables: Mapping[str, Array], labels: Mapping[str, Sequence[str]], areas: Mapping[str, tuple[float, float]]
) -> Array | None:
    """Actuator forces P_A A_1 - P_B A_2 (n, actuators) [N]; None if an area or a pressure is not known."""
    actuators, double = list(labels.get("actuator", ())), list(labels.get("horizontal", ()))
    if "chamber_pressure_a" not in variables or (double and "chamber_pressure_b" not in variables):
        return None
    if not all(name in areas for name in actuators):
        return None
    force = variables["chamber_pressure_a"] * [areas[name][0] for name in actuators]
    for k, name in enumerate(double):
        force[:, actuators.index(name)] -= variables["chamber_pressure_b"][:, k] * areas[name][1]
    return force


def _attrs(raws: Sequence[RawTest], channels: ChannelMap, used: Sequence[int]) -> dict[str, Any]:
    test = channels.test
    name = test.name or Path(raws[used[0]].source).stem
    files = "; ".join(f"{Path(raws[k].source).name} ({raws[k].form})" for k in used)
    return {
        "title": name,
        "test": name,
        "kind": test.kind,
        "valves_per_horizontal_actuator": test.valves_per_horizontal_actuator,
        "specimen": test.specimen,
        "source": f"imported from {files}",
        "columns": "; ".join(f"{key} = {said}" for key, said in described_sources(raws, channels).items()),
    }
