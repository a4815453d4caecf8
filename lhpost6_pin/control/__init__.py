"""The virtual 469D: settings from TOML, pure init and step functions at the controller's rate, compiled."""

from .controller import Controller, controlled, make_controller
from .settings import ControllerSettings, Notch, load_controller, save_controller

__all__ = ["Controller", "ControllerSettings", "Notch", "controlled", "load_controller", "make_controller"]
__all__ += ["save_controller"]
