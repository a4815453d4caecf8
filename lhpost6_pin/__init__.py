"""First-principles model of the UC San Diego LHPOST6 six-degree-of-freedom shake table on Pinocchio.

All quantities are SI: m, rad, s, kg, N, Pa, m³/s. Twists and wrenches are in Pinocchio's order, linear
first, unless a name says otherwise.
"""

__version__ = "0.1.0"
