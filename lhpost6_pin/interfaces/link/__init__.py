"""The link: the plant as a UDP server, and a client that commands it."""

from .client import LinkClient, Reading
from .protocol import Datagram, Kind, LinkMode, PlantState, decode, encode, find_mode
from .remote import LinkRun, record_of_link_run, run_over_link
from .served import ServedPlant
from .server import HOST, PORT, Timing, open_socket, serve

__all__ = ["HOST", "PORT", "Datagram", "Kind", "LinkClient", "LinkMode", "LinkRun", "PlantState", "Reading"]
__all__ += ["ServedPlant", "Timing", "decode", "encode", "find_mode", "open_socket", "record_of_link_run"]
__all__ += ["run_over_link", "serve"]
