"""Animation of a record, or of a running plant, in a browser.

The URDF gives bodies and joints (`urdf`), `bodies` their poses in every frame, meshcat draws. `frames` samples a
record, `scene` and `arrows` draw the machine, `animation` moves it: meshcat commands, sent to a window (`window`), that
is a file that plays off line (`viewer_page`) or a page on loopback. `overlay` compares records shown together. `live`
moves the machine while a simulation runs.
"""

from .frames import Frames, Look, make_frames, record_frames
from .live import LiveScene, LiveView, view_apart
from .overlay import Overlay, compare_overlaid
from .show import live_animation, show_record
from .viewer_page import Picture
from .window import LoopbackWindow, Recorder, SharedWindow

__all__ = [
    "Frames",
    "LiveScene",
    "LiveView",
    "Look",
    "LoopbackWindow",
    "Overlay",
    "Picture",
    "Recorder",
    "SharedWindow",
    "compare_overlaid",
    "live_animation",
    "make_frames",
    "record_frames",
    "show_record",
    "view_apart",
]
