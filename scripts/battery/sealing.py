"""Sealed labels: salted hashes made public before the search runs, so that no label can change after it."""

import hashlib
import json
from pathlib import Path

import numpy as np

__all__ = ["seal", "unseal"]


def seal(labels: list[dict], folder: Path) -> None:
    """Write `sealed/labels.json` and `seals.txt`: one salted SHA-256 per case, to be published before any search."""
    (folder / "sealed").mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng()  # the salt must not follow from the seed
    salted = {label["id"]: {"salt": random.bytes(16).hex(), "label": label} for label in labels}
    (folder / "sealed" / "labels.json").write_text(json.dumps(salted, indent=1, sort_keys=True), encoding="utf-8")
    lines = [f"{name} {_digest(one)}\n" for name, one in sorted(salted.items())]
    (folder / "seals.txt").write_text("".join(lines), encoding="utf-8")


def unseal(folder: Path) -> dict[str, dict]:
    """Labels by case id, each checked against its seal; ValueError names a case whose label was touched."""
    salted = json.loads((folder / "sealed" / "labels.json").read_text(encoding="utf-8"))
    seals = dict(line.split() for line in (folder / "seals.txt").read_text(encoding="utf-8").splitlines())
    if broken := sorted(set(seals) ^ set(salted) | {n for n in salted if seals.get(n) != _digest(salted[n])}):
        raise ValueError(f"{folder}: the seal does not fit the label of {', '.join(broken)}")
    return {name: one["label"] for name, one in salted.items()}


def _digest(salted: dict) -> str:
    text = salted["salt"] + json.dumps(salted["label"], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()
