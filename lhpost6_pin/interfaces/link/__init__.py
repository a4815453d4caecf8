"""The link: the plant as a UDP server, and a client for whoever commands it."""

from .client import LinkClient, Reading
from .protocol import Frame, Kind, Mode, PlantState, decode, encode, find_mode
from .remote import LinkRun, record_of_link_run, run_over_link
from .served import ServedPlant
from .server import HOST, PORT, Timing, open_socket, serve

__all__ = ["HOST", "PORT", "Frame", "Kind", "LinkClient", "LinkRun", "Mode", "PlantState", "Reading", "ServedPlant"]
__all__ += ["Timing", "decode", "encode", "find_mode", "open_socket", "record_of_link_run", "run_over_link", "serve"]
