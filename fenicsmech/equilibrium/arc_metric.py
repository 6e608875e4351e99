"""How far apart two states of a path are: motion and parameter, each in units of what is of interest."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fenicsmech.equilibrium.lead import Heading, Lead
from fenicsmech.equilibrium.solver import Iteration, NotConverged
from fenicsmech.equilibrium.state import State
from fenicsmech.equilibrium.system import EquilibriumSystem

_SMALL_MOTION = 0.01  # in lengths of the mechanism or rad: what is of interest if nothing else is said


@dataclass(frozen=True)
class ArcMetric:
    """⟨a, b⟩ of headings: mean squares of motion and parameter, each over its reference.

    Attributes:
        system: whose unknowns are compared.
        motion: reference of displacement over the mechanism's length, and of rotation.
        parameter: reference of the path's parameter.
        conjugate: reference of its conjugate; infinite where that does not change with the parameter.
    """

    system: EquilibriumSystem
    motion: float
    parameter: float
    conjugate: float

    def dot(self, a: Heading, b: Heading) -> float:
        """⟨a, b⟩ (collective)."""
        return mean_product(self.system, a, b) / self.motion**2 + a.parameter * b.parameter / self.parameter**2

    def norm(self, a: Heading) -> float:
        """√⟨a, a⟩ (collective)."""
        return math.sqrt(self.dot(a, a))

    def unit(self, a: Heading) -> Heading:
        """``a`` scaled to norm one (collective)."""
        return a.scaled(1.0 / self.norm(a))


def metric_at(
    newton: Iteration, lead: Lead, state: State, *, parameter: float | None, conjugate: float | None
) -> ArcMetric:
    """The metric in which a linear mechanism would go one unit until it is where the path shall lead (collective).

    Args:
        newton: the solver.
        lead: the path's parameter.
        state: the equilibrium the path starts from.
        parameter: change of the parameter that is of interest, or
        conjugate: change of its conjugate; of two, the one that is reached first.

    Raises:
        NotConverged: the parameter moves nothing.
    """
    system, control = newton.system, lead.holding(state)
    x = newton.linearise(state, control).rate()
    rate = lead.heading(system.unknowns.step(x), control)
    speed = abs(lead.conjugate_rate(system, state, control, x))
    motion = math.sqrt(mean_product(system, rate, rate))
    if not lead.moves(system, rate) or not (lead.displaces or parameter or speed > 0.0):
        raise NotConverged("it moves nothing", 0)
    reach = min(
        abs(parameter) if parameter else math.inf,
        abs(conjugate) / speed if conjugate and speed else math.inf,
    )
    if math.isinf(reach):
        reach = _SMALL_MOTION / motion
    return ArcMetric(system, reach * motion, reach, reach * speed or math.inf)


def mean_product(system: EquilibriumSystem, a: Heading, b: Heading) -> float:
    """Mean product of two motions of free nodes and bodies, displacements over the mechanism's length (collective)."""
    comm, joints = system.comm, system.joints
    free = system.numbering.free[system.blocks.nodes.local]
    own = np.array([float(a.step.u[free] @ b.step.u[free]) / joints.length**2, float(len(free))])
    nodes, count = comm.allreduce(own)
    bodies = float(np.sum(a.step.z * b.step.z / joints.pose_scale**2))
    return nodes / max(count, 1.0) + bodies / max(len(a.step.z), 1)
