"""A stocky rubber diagonal in a rigid parallelogram: large strains and rotations, few unknowns."""

from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.mechanism import Force

from ..mechanism.truss_finger import truss_finger

RUBBER = fm.Material("rubber", 2.0, 0.45)


def finger(space: str, *, size: float = 4.0, comm: MPI.Comm = MPI.COMM_SELF, **options) -> tuple[fm.Simulation, Force]:
    """The simulation and the force on the tip; positive forces stretch the diagonal."""
    shape = fm.strip([(0, 0), (14, 36), (40, 60)], thickness=12.0, depth=20.0)
    made = truss_finger(shape, RUBBER, radius=6.0)
    push = made.push()
    return fm.Simulation(fm.Scene(made.mechanism), space=space, size=size, comm=comm, **options), push
