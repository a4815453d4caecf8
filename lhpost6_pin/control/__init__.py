"""Controllers at the 469D's rate: settings from TOML, pure init and step functions, compiled."""

from .settings import Controller, LoopSettings, load_controller, make_controller

__all__ = ["Controller", "LoopSettings", "load_controller", "make_controller"]
