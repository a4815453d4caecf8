"""The link: the plant as a UDP server, a client that commands it, and a specimen served to it."""

from .client import LinkClient, Reading
from .faults import make_faults
from .protocol import Datagram, Kind, LinkMode, PlantState, decode, encode, find_mode
from .remote import LinkRun, record_of_link_run, run_over_link
from .served import ServedPlant
from .server import HOST, PORT, Timing, open_socket, serve
from .specimen_server import ServedSpecimen, serve_specimen

__all__ = ["HOST", "PORT", "Datagram", "Kind", "LinkClient", "LinkMode", "LinkRun", "PlantState", "Reading"]
__all__ += ["ServedPlant", "Timing", "decode", "encode", "find_mode", "make_faults", "open_socket"]
__all__ += ["ServedSpecimen", "record_of_link_run", "run_over_link", "serve", "serve_specimen"]
