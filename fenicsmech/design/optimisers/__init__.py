"""Optimisers of a regularised least-squares objective O(p) = ½ |r(p)|² + R(p).

- ``problem``: what is minimised, and the history of a minimisation
- ``resolution``: the end of it where finite elements cannot tell any more
- ``levenberg_marquardt``: uses the structure; the default
- ``bfgs``: quasi-Newton with backtracking, as in the paper this package follows
"""

from fenicsmech.design.optimisers.bfgs import BFGS
from fenicsmech.design.optimisers.levenberg_marquardt import LevenbergMarquardt
from fenicsmech.design.optimisers.problem import (
    Evaluation,
    Infeasible,
    Iterate,
    LeastSquaresProblem,
    Optimiser,
    Quadratic,
    Reason,
    Start,
    TooHigh,
)

__all__ = [
    "BFGS",
    "Evaluation",
    "Infeasible",
    "Iterate",
    "LeastSquaresProblem",
    "LevenbergMarquardt",
    "Optimiser",
    "Quadratic",
    "Reason",
    "Start",
    "TooHigh",
]
