"""Barrels and rods of the legs as slender bodies; their lump in the zero-position is the machine's masses.

A leg on swivels or pins has a rod, uniform from the platen point back, and a barrel, uniform from the base point; they
turn about the base point together and the rod slides. With L the distance of the two points, the platen point feels the
rod's mass along the leg and J(L)/L^2 across it, J the moment of inertia of both about the base point:

    m_along = m_r,    m_across = J(L_0) / L_0^2,    J(L) = J_b + m_r l_r^2/12 + m_r (L - l_r/2)^2,    J_b = m_b l_b^2/3

The two masses of Table 4.1 give m_r and m_b, once lengths l_r and l_b are known. The rod of a bearing actuator moves
upright with the leg's length; its barrel stands still.
"""

import math
from typing import NamedTuple

from ..core.errors import ParameterError
from ..machine.components import Actuator, Strut
from ..machine.machine import Machine

__all__ = ["LegBody", "leg_bodies"]


class LegBody(NamedTuple):
    """Moving bodies of one leg; zero where it has none."""

    rod_mass: float  # [kg]
    rod_length: float  # [m]
    barrel_mass: float  # [kg]
    barrel_length: float  # [m]

    @property
    def rod_centre(self) -> float:
        """Distance of the rod's centre behind the platen point [m]."""
        return 0.5 * self.rod_length

    @property
    def turning(self) -> float:
        """Barrel's moment of inertia about the base point, and the rod's about its own centre [kg m2]."""
        return self.barrel_mass * self.barrel_length**2 / 3.0 + self.rod_mass * self.rod_length**2 / 12.0

    @property
    def first_moment(self) -> float:
        """First moment of the barrel about the base point [kg m]."""
        return 0.5 * self.barrel_mass * self.barrel_length


def leg_bodies(machine: Machine) -> tuple[LegBody, ...]:
    """Bodies of all legs in the order of components; raises ParameterError for what cannot be split."""
    return tuple(_body(component, machine.parameters.origin) for component in machine.components)


def _body(component: Actuator | Strut, origin: str) -> LegBody:
    along, across = component.mass_along, component.mass_across
    if getattr(component, "mount", "none") == "bearing":
        if across > 0.0:
            raise ParameterError(
                f"{origin}: {component.name}.mass_across = {across:g} kg; the rod of a bearing actuator moves upright "
                "only: bodies of legs need 0 kg there"
            )
        return LegBody(along, 0.0, 0.0, 0.0)
    if along == across == 0.0:
        return LegBody(0.0, 0.0, 0.0, 0.0)
    rod, barrel = component.rod_length, component.barrel_length
    if rod is None or barrel is None:
        raise ParameterError(
            f"{origin}: {component.kind}.rod_length and {component.kind}.barrel_length are missing; legs as bodies "
            "(machine.bodies = full) need them"
        )
    length = math.dist(component.platen_point, component.base_point)
    rest = across * length**2 - along * ((length - 0.5 * rod) ** 2 + rod**2 / 12.0)
    if rest < 0.0:
        raise ParameterError(
            f"{origin}: {component.name}: mass_across = {across:g} kg is less than its rod alone has across, "
            f"{across - rest / length**2:.5g} kg with rod_length = {rod:g} m; state a longer rod"
        )
    return LegBody(along, rod, 3.0 * rest / barrel**2, barrel)
