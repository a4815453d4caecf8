"""The C step of c_step.c: compiled by the C compiler of this computer with -O3 -ffast-math, and called from Python.

A yardstick for `bench.py`: how fast one step of the plant's equations can be where everything but them is left out.
"""

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from plain_loop import PlainPlant

FLAGS = ("-O3", "-ffast-math")


def compiler() -> str | None:
    """Path of a C compiler; None where there is none."""
    return shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")


def _library(flags: Sequence[str]) -> ctypes.CDLL:
    """c_step.c compiled; raises RuntimeError without a compiler."""
    found = compiler()
    if found is None:
        raise RuntimeError("no C compiler (cc, gcc or clang) on the PATH; install one, for example gcc")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "c_step.so"
        source, made = Path(__file__).with_name("c_step.c"), path.with_suffix(".o")
        subprocess.run([found, *flags, "-fPIC", "-c", "-o", made, source], check=True)
        # linked without -ffast-math, with which loading it would have this process round small numbers to zero
        subprocess.run([found, "-shared", "-o", path, made, "-lm"], check=True)
        return ctypes.CDLL(str(path))


class CPlant:
    """The plant of a `PlainPlant` for the C step."""

    def __init__(self, plain: PlainPlant, *more: str) -> None:
        """Compile the step with `FLAGS` and `more`, and pack the plant's numbers in the order of the C struct."""
        self.library = _library((*FLAGS, *more))
        ratio, oil = plain.area_b / plain.area_a[: len(plain.h)], plain.oil
        mass = pin.crba(plain.model, plain.model.createData(), pin.neutral(plain.model))
        inertia = np.triu(mass) + np.triu(mass, 1).T
        weight = plain.weight - plain.model.gravity.linear[2] * plain.model.inertias[1].mass
        parts = (
            *(plain.rho, plain.base, plain.zero, plain.base_v, plain.zero_v, plain.plane, plain.strut.T),
            *(plain.area_a, plain.flow_curve, plain.leakage, plain.chamber_a, plain.seal_friction, plain.seal_yield),
            *(plain.seal_shape, plain.viscous, plain.k, np.concatenate([ratio**0.5, np.ones(len(plain.v))])),
            *(plain.area_b, plain.chamber_b, ratio, ratio**1.5, plain.pad.T),
            *(np.diag(inertia)[:3], weight, inertia[3:, 3:], np.linalg.inv(inertia[3:, 3:])),
            *(oil.supply_pressure, oil.return_pressure, oil.bulk_modulus),
        )
        self.numbers = np.concatenate([np.ravel(part) for part in parts]).astype(np.float64)
        if self.numbers.size != self.library.plant_numbers():
            raise ValueError("c_step.c is of four swivel actuators, six bearing actuators and three struts")

    def run(self, state: tuple[np.ndarray, ...], spool: np.ndarray, steps: int, dt: float) -> tuple[np.ndarray, ...]:
        """States of `PlainPlant.step` after rows (n, 10) of spools, each held for some steps of dt [s]."""
        q, v, pressure_a, pressure_b, seal, pad = state
        turn = pin.Quaternion(q[3:7]).toRotationMatrix()
        packed = np.concatenate([np.ravel(x) for x in (q[:3], turn, v, pressure_a, pressure_b, seal, pad)])
        rows = np.ascontiguousarray(spool, np.float64)
        pointers = [x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for x in (self.numbers, packed, rows)]
        self.library.run(*pointers, ctypes.c_long(len(rows)), ctypes.c_long(steps), ctypes.c_double(dt))
        sizes = np.cumsum([3, 9, 6, pressure_a.size, pressure_b.size, seal.size])
        r, turn, v, *oil, seal, pad = np.split(packed, sizes)
        quaternion = pin.Quaternion(turn.reshape(3, 3)).coeffs()
        return np.concatenate([r, quaternion]), v, *oil, seal, pad.reshape(-1, 2)
