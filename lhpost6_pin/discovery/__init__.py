"""Discovery: identification of effects that a model lacks, validated on held-out tests."""

from .discover import Discovery, discover
from .estimates import Estimate
from .finding import EffectFinding
from .verdict import Verdict
from .verdict_file import save_verdict, verdict_entries

__all__ = ["Discovery", "Estimate", "EffectFinding", "Verdict", "discover", "save_verdict", "verdict_entries"]
