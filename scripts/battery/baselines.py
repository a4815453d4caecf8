"""What simpler methods say on the same cases: correlation with the raw residual, and a bagged sparse regression."""

from typing import Any

import numpy as np

from lhpost6_pin.discovery.candidate_columns import columns_of
from lhpost6_pin.discovery.candidates import list_candidates
from lhpost6_pin.identification.calibration import calibration_numbers
from lhpost6_pin.identification.calibration.bin_rows import row_by_column
from lhpost6_pin.identification.calibration.operating_point import OperatingPoint
from lhpost6_pin.identification.calibration.prepare import prepare_problem

__all__ = ["baselines"]

KEPT = 8000  # rows of a regression, drawn at random from the real and imaginary parts of all bins


def baselines(machine: Any, records: Any, sensors: Any, seed: int) -> dict[str, list[str]]:
    """Families that each method names, first the strongest; nothing is refitted.

    `correlation` takes the candidate most like the raw residual, and always has one. `e_sindy` bags sequentially
    thresholded least squares of pysindy over the best candidate of each family; families in at least half the bags.
    """
    problem = prepare_problem(machine, records, sensors, calibration_numbers(), seed=seed, jobs=1)
    base = OperatingPoint(problem, np.zeros(len(problem.prior)))
    rest = np.concatenate([row_by_column(r, np.ones(r.shape)).ravel() for r in problem.residual(base)])
    best: dict[str, tuple[float, np.ndarray]] = {}
    for group in list_candidates(base.plant.machine):
        columns, parts = columns_of(problem, base, group)
        for part in parts:
            for one in part.T:
                column = np.concatenate([rows.times(one).ravel() for rows in columns])
                size = np.linalg.norm(column)
                like = abs(column @ rest) / size if size > 0.0 else 0.0
                if like > best.get(group[0].family.name, (0.0, column))[0]:
                    best[group[0].family.name] = (float(like), column / size)
    order = sorted(best, key=lambda name: -best[name][0])
    return {"correlation": order[:1], "e_sindy": _e_sindy(order, [best[n][1] for n in order], rest, seed)}


def _e_sindy(names: list[str], columns: list[np.ndarray], rest: np.ndarray, seed: int) -> list[str]:
    from pysindy.optimizers import STLSQ, EnsembleOptimizer

    random = np.random.default_rng(seed)
    rows = random.choice(len(rest), min(KEPT, len(rest)), replace=False)
    x, y = np.stack(columns, axis=1)[rows], -rest[rows]
    scale = np.linalg.norm(x, axis=0)
    scale[scale == 0.0] = 1.0
    np.random.seed(seed)  # noqa: NPY002  # pysindy draws its bags from the global generator
    bags = EnsembleOptimizer(STLSQ(threshold=0.1 * np.linalg.norm(y), alpha=1e-3), bagging=True, n_models=20)
    bags.fit(x / scale, y[:, None])
    inside = np.mean([np.abs(c.ravel()) > 0.0 for c in bags.coef_list], axis=0)
    size = np.mean([np.abs(c.ravel()) for c in bags.coef_list], axis=0)
    return [names[i] for i in np.argsort(-size) if inside[i] >= 0.5]
