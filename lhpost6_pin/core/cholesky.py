"""Solution of small positive definite systems in compiled code."""

import numpy as np

from .compiled import compiled

__all__ = ["solve_positive"]


@compiled
def solve_positive(matrix, right):
    """Solve a small positive definite system by Cholesky in place; not finite where it is singular.

    Reads the lower triangle of the leading rows, as many as `right` (n,) has; right becomes the solution, the triangle
    the factor.
    """
    n = right.size
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(total) if i == j else total / matrix[j, j]
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]
