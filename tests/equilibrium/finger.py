"""A stocky rubber diagonal in a rigid parallelogram: large strains and rotations, few unknowns."""

from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force

RUBBER = fm.Material("rubber", 2.0, 0.45)


def finger(space: str, *, size: float = 4.0, comm: MPI.Comm = MPI.COMM_SELF, **options) -> tuple[fm.Simulation, Force]:
    """The simulation and the force on the tip; positive forces stretch the diagonal."""
    mechanism = fm.Mechanism("finger")
    base = mechanism.rigid("base", fixed=True)
    left, right, tip = (mechanism.rigid(name) for name in ("left", "right", "tip"))
    shape = fm.strip([(0, 0), (14, 36), (40, 60)], thickness=12.0, depth=20.0)
    diagonal = mechanism.flexible("diagonal", shape, RUBBER)
    mechanism.revolute(base, left, at=(0, 0))
    mechanism.revolute(base, right, at=(40, 0))
    mechanism.revolute(left, tip, at=(0, 60))
    mechanism.revolute(right, tip, at=(40, 60))
    mechanism.revolute(base, diagonal, at=(0, 0), radius=6.0)
    mechanism.revolute(diagonal, tip, at=(40, 60), radius=6.0)
    push = mechanism.force(on=tip, at=(20, 70), direction=(1, 0), name="push")
    return fm.Simulation(fm.Scene(mechanism), space=space, size=size, comm=comm, **options), push
