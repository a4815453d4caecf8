"""Rests: stretches of a record in which neither the platen nor any command moves, so that channels show noise alone.

Channels are smoothed over some periods of the mains' hum, and a block of them is still where its deviation from its own
mean is within a few times that of the quietest blocks of the campaign, for every channel of motion and every command.
Smoothing and blocks have a finite length: a strong motion nearby reaches no further. What is quiet must also be noise:
a displacement or command that smoothing leaves as it was moves slowly, and then no record with that channel rests.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from ..core.arrays import Array, Mask
from ..core.files import models_folder
from ..machine.parameters import Parameters, load_parameters
from .channels import LAYOUT, channel_name, columns_of
from .conditioning import resolution
from .records import sample_interval

__all__ = ["find_rests", "rest_numbers", "restless", "seconds_of"]

LENGTHS = ("platen_displacement", "actuator_displacement")
"""Displacements: in motion most of their power is slow."""

_Key = tuple[str, int]  # channel, column
_Blocks = dict[_Key, tuple[Array, Array, float]]  # as `_blocks`


def rest_numbers() -> Parameters:
    """Numbers of `models/procedures/rests.toml`."""
    return load_parameters(models_folder() / "procedures" / "rests.toml")


def find_rests(records: Sequence[xr.Dataset], numbers: Parameters | None = None) -> list[tuple[slice, ...]]:
    """Rests of every record of a campaign, as slices of its samples; none where it never rests."""
    numbers = numbers or rest_numbers()
    found, limits, slow = _judged(records, numbers)
    each = [(blocks, _still(blocks, limits), record) for blocks, record in zip(found, records, strict=True)]
    return [() if slow & set(blocks) else tuple(_runs(mask, record, numbers)) for blocks, mask, record in each]


def restless(records: Sequence[xr.Dataset], numbers: Parameters | None = None) -> str:
    """The channel that moves on where all others rest longest, as `platen_displacement[z]`; empty if none does."""
    found, limits, slow = _judged(records, numbers or rest_numbers())
    blocks = {key: sum(int(_still(b, limits, but=key).sum()) for b in found) for key in limits}
    whole = sum(int(_still(b, limits).sum()) for b in found)
    moving = [key for key in blocks if key in slow] or [key for key, count in blocks.items() if count > whole]
    if not moving:
        return ""
    name, column = max(moving, key=lambda key: blocks[key])
    return channel_name(next(record[name] for record in records if name in record), column)


def _judged(records: Sequence[xr.Dataset], numbers: Parameters) -> tuple[list[_Blocks], dict[_Key, float], set[_Key]]:
    """Blocks of every record, the deviation up to which each column is still, and columns that move slowly in those."""
    found = [dict(_blocks(record, numbers)) for record in records]
    quantile, factor, command = (numbers.number(f"rest.{key}") for key in ("quantile", "factor", "command"))
    limits: dict[_Key, float] = {}
    allowed: dict[_Key, float] = {}
    for key in dict.fromkeys(key for blocks in found for key in blocks):
        pooled = np.concatenate([blocks[key][0] for blocks in found if key in blocks])
        step = max(blocks[key][2] for blocks in found if key in blocks)
        limits[key] = max(factor * float(np.quantile(pooled, quantile, method="lower")), 0.5 * step)
        if LAYOUT[key[0]].role == "command":  # free of noise: what still moves the channels of motion show
            allowed[key] = command * float(pooled.max())
            limits[key] = max(limits[key], allowed[key])
    still = [_still(blocks, limits) for blocks in found]
    return found, limits, _slow(found, still, allowed, numbers.number("rest.motion_share"))


def seconds_of(records: Sequence[xr.Dataset], rests: Sequence[tuple[slice, ...]]) -> float:
    """Seconds of rest in all records together."""
    each = zip(records, rests, strict=True)
    return float(sum((s.stop - s.start) * sample_interval(r) for r, slices in each for s in slices))


def _lengths(record: xr.Dataset, numbers: Parameters) -> tuple[int, int, int]:
    """Samples of a box, of a block and from block to block."""
    dt = sample_interval(record)
    block = max(4, round(numbers.number("rest.block") / dt))
    return max(1, round(numbers.number("rest.smooth") / dt)), block, max(1, block // 4)


def _blocks(record: xr.Dataset, numbers: Parameters) -> Iterator[tuple[_Key, tuple[Array, Array, float]]]:
    """Deviations in blocks of every column of motion and of commands, smoothed and not, with its digital resolution."""
    from scipy.ndimage import uniform_filter1d

    box, block, hop = _lengths(record, numbers)
    if record.sizes["time"] < block:
        return
    for name, channel in LAYOUT.items():
        if name not in record or (channel.role == "sensor" and name not in LENGTHS):
            continue
        for column, x in enumerate(columns_of(record[name]).T):
            smooth = x
            for _ in range(3):
                smooth = uniform_filter1d(smooth, box, mode="nearest")
            yield (name, column), (_deviations(smooth, block, hop), _deviations(x, block, hop), resolution(x))


def _deviations(x: Array, block: int, hop: int) -> Array:
    return np.asarray(np.lib.stride_tricks.sliding_window_view(x, block)[::hop].std(axis=1))


def _still(blocks: _Blocks, limits: dict[_Key, float], but: _Key | None = None) -> Mask:
    """Blocks in which all columns are still, `but` one that does not count."""
    judged = [smooth <= limits[key] for key, (smooth, _, _) in blocks.items() if key != but]
    return np.asarray(np.all(judged, axis=0)) if judged else np.zeros(0, bool)


def _slow(
    found: Sequence[_Blocks],
    still: Sequence[Mask],
    allowed: dict[_Key, float],
    most: float,
) -> set[_Key]:
    """Displacements and commands that move in the blocks that are still: smooth, above what is allowed."""
    slow = set()
    for key in {key for blocks in found for key in blocks if key[0] in LENGTHS or LAYOUT[key[0]].role == "command"}:
        kept = [(blocks[key], mask) for blocks, mask in zip(found, still, strict=True) if key in blocks and mask.any()]
        if kept:
            smooth = float(np.median(np.concatenate([b[0][mask] for b, mask in kept])))
            raw = float(np.median(np.concatenate([b[1][mask] for b, mask in kept])))
            if smooth > max(*(b[2] for b, _ in kept), allowed.get(key, 0.0), most * raw):
                slow.add(key)
    return slow


def _runs(mask: Mask, record: xr.Dataset, numbers: Parameters) -> Iterator[slice]:
    """Stretches of blocks that are still, without the reach of smoothing at either end, if long enough."""
    box, block, hop = _lengths(record, numbers)
    least = numbers.number("rest.shortest") / sample_interval(record)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(int)))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        whole = last == len(mask)
        start = 0 if first == 0 else int(first) * hop + 2 * box
        stop = record.sizes["time"] if whole else int(last - 1) * hop + block - 2 * box
        if stop - start >= least:
            yield slice(start, stop)
