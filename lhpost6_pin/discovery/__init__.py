"""Discovery: where a model and measured tests disagree, the name of what is missing, and the proof."""

from .discover import Discovery, discover
from .verdict import EffectFinding, Estimate, Verdict
from .verdict_file import save_verdict, verdict_entries

__all__ = ["Discovery", "Estimate", "EffectFinding", "Verdict", "discover", "save_verdict", "verdict_entries"]
