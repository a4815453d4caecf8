"""The same plant without compiled code: NumPy over components, Pinocchio for the rigid body, forward Euler.

A yardstick for `bench.py`, and a readable account of one step. It shares no code with the package's stages.
"""

import numpy as np
import pinocchio as pin

from lhpost6_pin.machine.machine import Machine
from lhpost6_pin.mechanics.plant import State
from lhpost6_pin.mechanics.rigid_body import make_model


class PlainPlant:
    """Open-loop LHPOST6-like machine: 4-way swivel actuators, 3-way bearing actuators, struts; report thrust."""

    def __init__(self, machine: Machine) -> None:
        """Gather the machine's numbers into arrays."""
        self.model = make_model(machine)
        self.data = self.model.createData()
        self.centre = np.array(machine.platen.centre_of_gravity)
        self.plane = machine.platen.bearing_plane[2] - self.centre[2]
        self.extra = np.array(machine.platen.mass) - min(machine.platen.mass)
        self.weight = self.extra[2] * machine.platen.gravity
        oil, acts = machine.hydraulics, machine.actuators
        self.oil = oil
        self.h = [a for a in acts if a.mount == "swivel"]
        self.v = [a for a in acts if a.mount == "bearing"]
        swivels = [*self.h, *machine.struts]
        self.rho = np.array([c.platen_point for c in swivels]) - self.centre
        self.base = np.array([c.base_point for c in swivels])
        self.zero = np.linalg.norm(self.rho + self.centre - self.base, axis=1)
        self.base_v = np.array([a.base_point for a in self.v])
        self.zero_v = np.array([a.platen_point[2] - a.base_point[2] for a in self.v])
        self.strut = np.array([(s.pressure, s.area, s.gas_length, s.polytropic_index) for s in machine.struts]).T
        for name in ("area_a", "flow_curve", "leakage", "chamber_a", "seal_friction", "seal_yield", "seal_shape"):
            setattr(self, name, np.array([getattr(a, name) for a in acts]))
        self.viscous = np.array([a.viscous for a in acts])
        self.area_b = np.array([a.area_b for a in self.h])
        self.chamber_b = np.array([a.chamber_b for a in self.h])
        self.k = np.array([a.flow * a.valves for a in acts]) / np.sqrt(oil.rated_pressure)
        self.pad = np.array([(a.pad_friction, a.pad_yield, a.pad_shape) for a in self.v]).T

    @staticmethod
    def at_rest(state: State) -> tuple[np.ndarray, ...]:
        """State of `step` at rest: pose and pressures of the package's, whose chambers A and B of H1.. are in turn."""
        z = state.z
        pressures = np.r_[z[0:8:2], z[8:14]], z[1:8:2].copy()
        return state.q.copy(), np.zeros(6), *pressures, np.zeros(10), np.zeros((6, 2))

    def step(self, q, v, pa, pb, seal, pad, spool, dt):  # type: ignore[no-untyped-def]
        """One forward-Euler step; returns the state at its end."""
        n_h, oil = len(self.h), self.oil
        R = pin.Quaternion(q[3:7]).toRotationMatrix()
        r, n = q[:3], R[:, 2]
        # swivel legs and struts
        d = r + self.rho @ R.T - self.base
        length = np.linalg.norm(d, axis=1)
        u = (d / length[:, None]) @ R
        rate = u @ v[:3] + np.cross(self.rho, u) @ v[3:]
        # bearing legs
        e = r - self.base_v
        rise = (e @ n + self.plane) / n[2]
        contact = np.column_stack([-e[:, :2], rise - e[:, 2]]) @ R
        moment = np.cross(contact, [0.0, 0.0, 1.0])
        rate_v = (v[2] + moment @ v[3:]) / n[2]
        s = np.concatenate([length[:n_h] - self.zero[:n_h], rise - self.zero_v])
        sd = np.concatenate([rate[:n_h], rate_v])
        # hydraulics
        g = self.k * (1.0 - np.exp(-self.flow_curve * np.abs(spool)))
        ratio = self.area_b / self.area_a[:n_h]
        w_in = np.concatenate([ratio**0.5, np.ones(len(self.v))])
        drop = np.where(spool >= 0, oil.supply_pressure - pa, pa - oil.return_pressure)
        qa = np.where(spool >= 0, w_in, -1.0) * g * np.sign(drop) * np.sqrt(np.abs(drop))
        back = np.concatenate([pb, np.zeros(len(self.v))])
        leak = self.leakage * (pa - back)
        opened = spool[:n_h] >= 0
        drop_b = np.where(opened, pb - oil.return_pressure, oil.supply_pressure - pb)
        qb = np.where(opened, -(ratio**1.5), ratio) * g[:n_h] * np.sign(drop_b) * np.sqrt(np.abs(drop_b))
        dpa = oil.bulk_modulus / (self.chamber_a + s) * ((qa - leak) / self.area_a - sd)
        dpb = oil.bulk_modulus / (self.chamber_b - s[:n_h]) * ((qb + leak[:n_h]) / self.area_b + sd[:n_h])
        # friction
        p = sd * seal
        dseal = (sd - seal * (self.seal_shape * p + (1 - self.seal_shape) * np.abs(p))) / self.seal_yield
        cos_a = np.sqrt(1.0 - n[1] ** 2)
        x_n = np.array([n[2] / cos_a, 0.0, -n[0] / cos_a])
        y_n = np.cross(n, x_n)
        at_p = v[:3] + np.cross(v[3:], contact)
        slip = np.column_stack([at_p @ (R.T @ x_n) - rate_v * x_n[2], at_p @ (R.T @ y_n) - rate_v * y_n[2]])
        q2 = slip * pad
        h = self.pad[2] * q2.sum(1) + (1 - self.pad[2]) * np.abs(q2).sum(1)
        dpad = (slip - h[:, None] * pad) / self.pad[1][:, None]
        # forces
        f = pa * self.area_a - self.seal_friction * seal - self.viscous * sd
        f[:n_h] -= pb * self.area_b
        pull = -self.strut[0] * (1 + (length[n_h:] - self.zero[n_h:]) / self.strut[2]) ** -self.strut[3] * self.strut[1]
        along = np.concatenate([f[:n_h], pull])
        force = along @ u
        torque = along @ np.cross(self.rho, u)
        push = f[n_h:, None] * R[2] - self.pad[0][:, None] * (pad @ np.array([R.T @ x_n, R.T @ y_n]))
        force = force + push.sum(0) - self.weight * R[2] - self.extra * np.cross(v[3:], v[:3])
        torque = torque + np.cross(contact, push).sum(0)
        a = pin.aba(self.model, self.data, q, v, np.concatenate([force, torque]))
        return (
            pin.integrate(self.model, q, dt * v),
            v + dt * a,
            pa + dt * dpa,
            pb + dt * dpb,
            seal + dt * dseal,
            pad + dt * dpad,
        )
