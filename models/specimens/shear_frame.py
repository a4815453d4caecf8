"""Three-storey shear frame as an OpenSees model, linear or yielding: the frame of shear_frame.toml.

    lhpost6 run ridgecrest --specimen models/specimens/shear_frame.py:build
    lhpost6 run ridgecrest --specimen models/specimens/shear_frame.py:build_yielding

Base plate of 5 t, three floors of 20 t on storeys of 3 m; storeys of 25 MN/m that move along x, damped in proportion to
their stiffness, 2 % of critical in the first mode of 2.5 Hz (assumed; see shear_frame.toml). The yielding frame moves
along y as well; its storeys yield at 150, 120 and 75 kN and harden with 3 % of their stiffness (Giuffre-Menegotto-Pinto
with the constants of the OpenSees manual; assumed: a quarter of the floors' weight at the base).
"""

PLATE, FLOOR = 5_000.0, 20_000.0  # [kg]
HEIGHTS = (3.2, 6.2, 9.2)  # [m]
STIFFNESS = 25.0e6  # [N/m]
DAMPING = 63_550.0  # [N s/m]
YIELD = (150.0e3, 120.0e3, 75.0e3)  # [N]
HARDENING = 0.03


def _slab(mass, side, thickness):
    """Masses of a square slab's node: three translations, three rotations."""
    tilt = mass / 12.0 * (side**2 + thickness**2)
    return [mass, mass, mass, tilt, tilt, mass / 6.0 * side**2]


def _floors(ops, free):
    ops.node(10, 0.0, 0.0, 0.1)
    ops.mass(10, *_slab(PLATE, 5.0, 0.2))
    ops.fix(10, 1, 1, 1, 1, 1, 1)
    for k, height in enumerate(HEIGHTS, 11):
        ops.node(k, 0.0, 0.0, height)
        ops.mass(k, *_slab(FLOOR, 4.0, 0.4))
        ops.fix(k, *free)


def _storey(ops, k, *materials):
    """Springs and dampers between floor k and the one below, in the plane of the floors."""
    axes = ["-dir", *([2] if len(materials) == 1 else [2, 3]), "-orient", 0.0, 0.0, 1.0, 1.0, 0.0, 0.0]
    ops.element("twoNodeLink", k, 10 + k - 1, 10 + k, "-mat", *materials, *axes, "-doRayleigh")


def build(ops, base):
    """Linear frame that moves along x."""
    _floors(ops, (0, 1, 1, 1, 1, 1))
    ops.uniaxialMaterial("Elastic", 1, STIFFNESS)
    for k in (1, 2, 3):
        _storey(ops, k, 1)
    ops.rayleigh(0.0, 0.0, DAMPING / STIFFNESS, 0.0)


def build_yielding(ops, base):
    """Frame whose storeys yield along x and y."""
    _floors(ops, (0, 0, 1, 1, 1, 1))
    for k, strength in enumerate(YIELD, 1):
        ops.uniaxialMaterial("Steel02", k, strength, STIFFNESS, HARDENING, 18.0, 0.925, 0.15)
        _storey(ops, k, k, k)
    ops.rayleigh(0.0, 0.0, DAMPING / STIFFNESS, 0.0)
