"""Stability of the controlled table: eigenvalues of the closed loop, sample by sample.

The linear table at rest without dry friction (`margins`) is discretised exactly: commands are held over a sample and
arrive after the delay of their valves, a whole number of samples and a part. The controller's own difference equations
(high-pass of the force feedback, reset integrator, notches, force balance) close the loop. Margins assume a stable
loop; this says whether it is.
"""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
from scipy.linalg import block_diag, expm

from ..control import Controller
from ..core.arrays import Array
from ..core.names import AXES, SAMPLE_RATE
from ..mechanics.specimen_modes import specimen_growth
from .identify import section, tuning_numbers
from .margins import LinearTable, Margin, linear_table, loop_frequencies, make_loop_model, margins

__all__ = ["LoopCheck", "check_loop", "closed_loop", "closed_loop_rates"]


@dataclass(frozen=True)
class LoopCheck:
    """Stability and margins of a controller on its plant, by the linear model without dry friction."""

    growth: float  # rate of the fastest growing motion [1/s]; negative where all decay
    growth_frequency: float  # of that motion [Hz]
    growth_axis: str  # platen axis that moves most in it
    axes: tuple[str, ...]
    margins: tuple[Margin, ...]  # of each axis; they mean something where the loop is stable only
    specimen_growth: float  # the same of the specimen's joints on a platen held fast; minus infinity without [1/s]
    limits: SimpleNamespace  # growth [1/s], gain_margin [1], phase_margin [rad] of `tuning.toml`

    @property
    def stable(self) -> bool:
        """Whether no motion grows faster than can be distinguished from rounding."""
        return self.growth <= self.limits.growth

    @property
    def thin(self) -> tuple[str, ...]:
        """Axes whose margins are below the limits; none where the loop is unstable."""
        least = self.limits
        return tuple(
            axis
            for axis, m in zip(self.axes, self.margins, strict=True)
            if self.stable and (m.gain < least.gain_margin or m.phase < least.phase_margin)
        )

    @property
    def falls(self) -> bool:
        """Whether the specimen is unstable by itself, so that no controller holds it."""
        return self.specimen_growth > self.limits.growth

    @property
    def verdict(self) -> str:
        """`stable`, `thin` or `unstable`."""
        return "unstable" if self.falls or not self.stable else "thin" if self.thin else "stable"

    @property
    def summary(self) -> str:
        """The verdict in a sentence."""
        if self.falls:
            return (
                "The specimen is unstable in this pose, whatever the controller: on a platen held fast a motion of its "
                f"joints grows by {self.specimen_growth:.3g} 1/s; lock it (--locked) or give its joints springs"
            )
        if not self.stable:
            return (
                f"The control loop is unstable by the linear model: a motion at {self.growth_frequency:.3g} Hz, mostly "
                f"in {self.growth_axis}, grows by {self.growth:.3g} 1/s"
            )
        shown = self.thin or (min(zip(self.axes, self.margins, strict=True), key=lambda x: x[1].gain)[0],)
        parts = []
        for axis, m in zip(self.axes, self.margins, strict=True):
            if axis in shown:
                gain = (
                    f"{20.0 * np.log10(m.gain):.1f} dB at {m.gain_frequency:.3g} Hz" if np.isfinite(m.gain) else "any"
                )
                turn = f", {np.degrees(m.phase):.0f} deg at {m.phase_frequency:.3g} Hz" if np.isfinite(m.phase) else ""
                parts.append(f"{axis} {gain}{turn}")
        start = "The control loop is stable, with thin margins" if self.thin else "The control loop is stable"
        return f"{start}: {'; '.join(parts)}"


def check_loop(controller: Controller, table: LinearTable | None = None) -> LoopCheck:
    """Stability and margins of a controller on its plant; table: that of `linear_table`, if known."""
    table = linear_table(controller) if table is None else table
    limits = section(tuning_numbers(), "run_margins")
    axes = tuple(AXES[k] for k in controller.plant.axes)
    rates, shapes = closed_loop_rates(controller, table)
    worst = int(np.argmax(rates.real))
    moved = np.abs(table.to_c @ shapes[: len(table.a), worst])
    lever = np.where(np.isin(axes, AXES[3:]), float(np.linalg.norm(controller.plant.machine.platen.size)) / 2.0, 1.0)
    resonances = np.concatenate([np.linalg.eigvals(table.a), rates])
    model = make_loop_model(controller, loop_frequencies(resonances), table)
    return LoopCheck(
        growth=float(rates[worst].real),
        growth_frequency=float(abs(rates[worst].imag) / (2.0 * np.pi)),
        growth_axis=axes[int(np.argmax(moved * lever))],
        axes=axes,
        margins=margins(model, controller),
        specimen_growth=specimen_growth(controller.plant),
        limits=limits,
    )


def closed_loop_rates(controller: Controller, table: LinearTable) -> tuple[Array, Array]:
    """Rates s [1/s] of the closed loop's motions exp(s t), and their shapes, a column each (`closed_loop`)."""
    values, shapes = np.linalg.eig(closed_loop(controller, table))
    tiny = np.finfo(float).tiny  # finite memory decays in a few samples: rates of minus infinity
    return SAMPLE_RATE * np.log(np.maximum(np.abs(values), tiny)) + 1j * SAMPLE_RATE * np.angle(values), shapes


def closed_loop(controller: Controller, table: LinearTable) -> Array:
    """Matrix of the closed loop from one sample to the next; the table's states come first, then lags of valves.

    Then past commands of every actuator, the states of high-passes and reset integrators, and those of the notches.
    """
    plant, rows = controller.plant, controller.axis
    n, actuators, axes = len(table.a), plant.spools, len(rows)
    lagging = np.flatnonzero(plant.lags > 0.0)
    a = block_diag(table.a, -np.diag(1.0 / plant.lags[lagging]))
    a[:n, n:] = table.b[:, lagging]
    b = np.vstack([table.b * (plant.lags <= 0.0), np.zeros((lagging.size, actuators))])
    b[n + np.arange(lagging.size), lagging] = 1.0 / plant.lags[lagging]
    whole, part = np.divmod(plant.delays * SAMPLE_RATE, 1.0)
    past, sections = int(whole.max()) + 1, int(rows["notches"].max(initial=0))
    sizes = [len(a), *[actuators] * past, axes, axes, *[axes] * (2 * sections)]
    one = np.split(np.eye(sum(sizes)), np.cumsum(sizes)[:-1])
    x, commands, passed, summed, notches = one[0], one[1 : 1 + past], one[1 + past], one[2 + past], one[3 + past :]

    place, force = table.to_c @ x[:n], table.to_force @ x[:n]
    speed = table.to_c[:, : plant.axes.size] @ x[table.nv : table.nv + plant.axes.size]
    rise = table.to_c[:, : plant.axes.size] @ (a[table.nv : table.nv + plant.axes.size] @ x)
    on_axes, high = controller.jacobian[:, plant.axes].T @ force, rows["high_pass"][:, None]
    gains = {name: rows[f"{name}_gain"][:, None] for name in ("displacement", "velocity", "acceleration", "reset")}
    wanted = gains["displacement"] * place + gains["velocity"] * speed + gains["acceleration"] * rise
    wanted = wanted + gains["reset"] * (summed + place) + rows["force_gain"][:, None] * (high * on_axes + passed)
    after = []
    for k in range(sections):
        b0, b1, b2, a1, a2 = np.where((rows["notches"] > k)[:, None], rows["notch"][:, k], [1.0, 0, 0, 0, 0]).T[
            ..., None
        ]
        first, second = notches[2 * k : 2 * k + 2]
        out = b0 * wanted + first
        after += [b1 * wanted - a1 * out + second, b2 * wanted - a2 * out]
        wanted = out
    command = -controller.jacobian[:, plant.axes] @ (rows["master_gain"][:, None] * wanted) - controller.balance @ force
    commands = [command, *commands]
    moved = expm(a / SAMPLE_RATE) @ x
    for share in np.unique(part):  # the older command acts over this part of the sample, the newer over the rest
        newer = _held(a, b, (1.0 - share) / SAMPLE_RATE)
        older = _held(a, b, 1.0 / SAMPLE_RATE) - newer
        for i in np.flatnonzero(part == share):
            k = int(whole[i])
            moved = moved + np.outer(newer[:, i], commands[k][i]) + np.outer(older[:, i], commands[k + 1][i])
    passed = high * passed + high * (high - 1.0) * on_axes
    return np.vstack([moved, *commands[:past], passed, summed + place, *after])


def _held(a: Array, b: Array, t: float) -> Array:
    """Integral of exp(a s) b over s from 0 to t."""
    n, m = b.shape
    return np.asarray(expm(t * np.block([[a, b], [np.zeros((m, n + m))]]))[:n, n:])
