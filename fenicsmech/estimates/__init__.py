"""How far results are from those of infinitely fine elements, or of a model in space.

- ``goal_error``: of elements, by ``recovery`` and ``pressure_error``
- ``depth_error``: of plane stress
"""

from fenicsmech.estimates.depth_error import DepthError
from fenicsmech.estimates.goal_error import GoalError
from fenicsmech.estimates.pressure_error import PressureError
from fenicsmech.estimates.recovery import Recovery

__all__ = ["DepthError", "GoalError", "PressureError", "Recovery"]
