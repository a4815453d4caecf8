"""Discovery: where a model and measured tests disagree, the name of what is missing, and the proof."""

from .discover import Discovery, discover
from .save import save_verdict, verdict_entries
from .verdict import Estimate, Finding, Verdict

__all__ = ["Discovery", "Estimate", "Finding", "Verdict", "discover", "save_verdict", "verdict_entries"]
