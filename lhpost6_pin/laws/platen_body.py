"""What differs in the rigid platen and in the direction of the bearings' thrust.

thrust_direction   the thrust of a bearing turns by a share from the machine's direction (Eq. 4-23) to the other
more_inertia       mass, first and second moments about B that add to the platen's
"""

from typing import Annotated, NamedTuple

from .contract import Law

__all__ = ["LAWS", "MoreInertia", "ThrustDirection"]


class ThrustDirection(NamedTuple):
    """Parameters of another direction of thrust."""

    share: Annotated[float, "1"]


class MoreInertia(NamedTuple):
    """Parameters of inertia that adds to the platen's, about B in platen axes."""

    mass: Annotated[float, "kg"]
    first_x: Annotated[float, "kg m"]
    first_y: Annotated[float, "kg m"]
    first_z: Annotated[float, "kg m"]
    second_xx: Annotated[float, "kg m2"]
    second_yy: Annotated[float, "kg m2"]
    second_zz: Annotated[float, "kg m2"]
    second_xy: Annotated[float, "kg m2"]
    second_xz: Annotated[float, "kg m2"]
    second_yz: Annotated[float, "kg m2"]


LAWS = {
    "thrust_direction": Law(ThrustDirection, modifies="leg"),
    "more_inertia": Law(MoreInertia, modifies="inertia"),
}
