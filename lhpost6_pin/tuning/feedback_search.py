"""Search for the feedback gains of all axes on the linear model: displacement gain Kx and force feedback KF.

Both are raised from low values, each in turn, as far as the targets of gain margin, phase margin and sensitivity allow.
At the resonance of an axis whose valve delay is near a quarter of its period, the two partly cancel: the pairs allowed
lie in a narrow band of constant KF/Kx, in which neither can be raised alone. There both are raised at once.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..control import Controller, ControllerSettings
from ..core.names import AXES
from .margins import LoopModel, loop_gain, margins

__all__ = ["FeedbackSearch", "with_gains"]


def with_gains(settings: ControllerSettings, k: int, **numbers: float) -> ControllerSettings:
    """Settings with numbers of degree of freedom k replaced."""
    changes: dict[str, Any] = {}
    for name, value in numbers.items():
        values = list(getattr(settings, name))
        values[k] = float(value)
        changes[name] = tuple(values)
    return replace(settings, **changes)


class FeedbackSearch:
    """Search for Kx and KF of the free axes on a linear model, within `feedback_targets` of `tuning.toml`."""

    def __init__(
        self,
        model: LoopModel,
        controller: Callable[[ControllerSettings], Controller],
        axes: Sequence[int],
        targets: SimpleNamespace,
    ) -> None:
        """Prepare a search on the model of the plant of `controller`; `axes` (n,) are its free degrees of freedom."""
        self.model, self.controller, self.targets = model, controller, targets
        self.axes = axes
        self.slowest = _slowest_column(model)  # [Hz]
        self.most = targets.displacement_bandwidth * 2.0 * np.pi * self.slowest  # of Kx [1/s]
        self.first = self.most * targets.first_gain

    def lowest(self, settings: ControllerSettings) -> ControllerSettings:
        """Settings with the gains from which the search starts."""
        for k in self.axes:
            settings = with_gains(self._with_displacement_gain(settings, k, self.first), k, force_damping=0.0)
        return settings

    def raised(self, settings: ControllerSettings) -> ControllerSettings:
        """Settings with Kx and KF of all axes raised, each in turn and then both, until nothing changes."""
        tuned, reached = settings, None
        while tuned != reached:  # damping of the oil columns admits higher displacement gains, and so on
            reached = tuned
            for step in (self._raise_displacement_gain, self._raise_damping):
                for a in range(len(self.axes)):
                    tuned = step(tuned, a)
            if tuned == reached:
                for a in range(len(self.axes)):
                    tuned = self._raise_both(tuned, a)
        return tuned

    def limits(self, settings: ControllerSettings, a: int) -> tuple[str, str]:
        """What ends the search for Kx and for KF of free axis `a` at the settings found, as text."""
        k, targets = self.axes[a], self.targets
        value = settings.displacement_gain[k] * targets.growth
        if value > self.most:
            share = f"{targets.displacement_bandwidth:g} of the slowest oil column, {self.slowest:.3g} Hz"
            of_gain = f"bandwidth: the next value, {value:.3g} 1/s, is beyond {share}"
        else:
            of_gain = self._next(value, self._refusal(self._with_displacement_gain(settings, k, value), a))
        value, peak = self._next_damping(settings, k), self._resonance(settings, a)
        if peak <= targets.resonance:
            return of_gain, f"damped enough: velocity response at resonance {peak:.3g}, at most {targets.resonance:g}"
        if value > 1.0:
            return of_gain, f"the next value, {value:.3g}, is beyond critical damping"
        trial = with_gains(settings, k, force_damping=value)
        return of_gain, self._next(value, self._refusal(trial, a) or "no lower velocity response at resonance")

    def _next(self, value: float, refusal: str) -> str:
        return f"the next value, {value:.3g}, has {refusal}"

    def _with_displacement_gain(self, settings: ControllerSettings, k: int, value: float) -> ControllerSettings:
        """Settings with the displacement gain of degree of freedom k and the corresponding reset gain."""
        return with_gains(settings, k, displacement_gain=value, reset_gain=self.targets.reset_ratio * value**2)

    def _next_damping(self, settings: ControllerSettings, k: int) -> float:
        return max(self.targets.first_damping, settings.force_damping[k] * self.targets.growth)

    def _raise_displacement_gain(self, settings: ControllerSettings, a: int) -> ControllerSettings:
        """Settings with the highest displacement gain of free axis a that is allowed."""
        k = self.axes[a]
        best, value = settings, max(self.first, settings.displacement_gain[k])
        while value <= self.most:
            trial = self._with_displacement_gain(settings, k, value)
            if self._refusal(trial, a):
                break
            best, value = trial, value * self.targets.growth
        return best

    def _raise_damping(self, settings: ControllerSettings, a: int) -> ControllerSettings:
        """Settings with more force feedback on free axis a, as allowed, until its resonance is damped enough."""
        targets, k = self.targets, self.axes[a]
        best, value = settings, max(targets.first_damping, settings.force_damping[k])
        peak = self._resonance(settings, a)
        while value <= 1.0 and peak > targets.resonance:
            trial = with_gains(settings, k, force_damping=value)
            if self._refusal(trial, a) or (lowered := self._resonance(trial, a)) > peak:
                break
            best, peak, value = trial, lowered, value * targets.growth
        return best

    def _raise_both(self, settings: ControllerSettings, a: int) -> ControllerSettings:
        """Settings with a higher Kx and more KF on free axis a, the least KF with which a higher Kx is allowed."""
        targets, k = self.targets, self.axes[a]
        damping = self._next_damping(settings, k)
        while damping <= 1.0:
            value = settings.displacement_gain[k] * targets.growth
            while value <= self.most:
                trial = with_gains(self._with_displacement_gain(settings, k, value), k, force_damping=damping)
                if not self._refusal(trial, a):
                    return trial
                value *= targets.growth
            damping *= targets.growth
        return settings

    def _refusal(self, settings: ControllerSettings, a: int) -> str:
        """The first criterion that settings miss, as text; empty if axis a meets all and the other axes nearly do.

        Phase margins count below the oil columns; above them the sensitivity measures the distance of the loop from -1.
        """
        targets, controller = self.targets, self.controller(settings)
        inner = np.linalg.inv(np.eye(len(controller.axis)) + loop_gain(self.model, controller))
        sensitivity = np.abs(np.einsum("mkk->mk", inner))
        for n, m in enumerate(margins(self.model, controller, self.slowest)):
            slack, axis = 1.0 if n == a else targets.neighbours, AXES[self.axes[n]]
            if m.gain * slack < targets.gain_margin:
                size, least = (20.0 * np.log10(x) for x in (m.gain, targets.gain_margin / slack))
                return f"a gain margin of {size:.1f} dB in {axis} at {m.gain_frequency:.3g} Hz, below {least:.1f} dB"
            if m.phase * slack < targets.phase_margin:
                size, least = (np.degrees(x) for x in (m.phase, targets.phase_margin / slack))
                at_f = f"at {m.phase_frequency:.3g} Hz"
                return f"a phase margin of {size:.0f} deg in {axis} {at_f}, below {least:.0f} deg"
            at = int(np.argmax(sensitivity[:, n]))
            if (size := float(sensitivity[at, n])) > slack * targets.sensitivity:
                f, most = self.model.frequency[at], slack * targets.sensitivity
                return f"a sensitivity of {size:.2f} in {axis} at {f:.3g} Hz, beyond {most:g}"
        return ""

    def _resonance(self, settings: ControllerSettings, a: int) -> float:
        """Largest velocity response of an axis to its velocity command, its loops closed [1]."""
        model, controller = self.model, self.controller(settings)
        inner = np.linalg.inv(np.eye(len(controller.axis)) + loop_gain(model, controller))
        speed = 2.0 * np.pi * model.frequency * np.abs((model.displacement @ inner)[:, a, a])
        return float(speed[model.frequency > 2.0].max())


def _slowest_column(model: LoopModel) -> float:
    """Frequency [Hz] of the slowest oil column: the first peak of the plant's own velocity response."""
    speed = np.abs(np.einsum("mkk->mk", model.displacement)) * model.frequency[:, None]
    inside = model.frequency > 2.0
    return float(min(model.frequency[inside][np.argmax(column[inside])] for column in speed.T))
