"""A record to look at: the machine's bodies follow it in a browser.

The URDF gives bodies and joints (`urdf`), `bodies` where they are in every frame, meshcat draws. `frames` samples a
record, `scene` and `arrows` draw the machine, `animation` moves them; all of it are meshcat commands, sent to a window
(`window`): a file that plays off line (`page`), or a page on loopback. `live` moves them while a simulation runs.
"""

from .apart import view_apart
from .frames import Frames, Look, make_frames, record_frames
from .live import LiveView
from .show import live_animation, show_record
from .viewer_page import Picture
from .window import LoopbackWindow, Recorder

__all__ = [
    "Frames",
    "LiveView",
    "Look",
    "LoopbackWindow",
    "Picture",
    "Recorder",
    "live_animation",
    "make_frames",
    "record_frames",
    "show_record",
    "view_apart",
]
