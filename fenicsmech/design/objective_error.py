"""How wrong an objective is because elements are not infinitely fine.

With the errors d_k of the targets' displacements, of scale s_k, and with residuals r_k,

    O(u + d) − O(u) = Σ w_k (r_k d_k / s_k + ½ (d_k / s_k)²).

Far from the targets the first term counts, and the estimate is as good as those of displacements; where targets are
met the second one is left, whose factor is the square of theirs. R depends on the design alone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fenicsmech.design.objective import target_errors, target_scales
from fenicsmech.design.spline_design import Target


def objective_error(targets: Sequence[Target], reached: np.ndarray, errors: np.ndarray) -> float:
    """O(u + d) − O(u).

    Args:
        targets: what is wanted.
        reached: displacements u, (targets,).
        errors: d, what finer elements would add to them, (targets,).
    """
    weights = np.array([target.weight for target in targets])
    relative = errors / target_scales(targets)
    return float(weights @ (target_errors(targets, reached) * relative + 0.5 * relative**2))
