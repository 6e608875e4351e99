"""The mid-plane z = 0 of links of which the half above it is meshed."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

_FLAT = 1e-9  # of the mesh's height


def on_mid_plane(points: np.ndarray, comm: MPI.Comm) -> np.ndarray:
    """Which of this rank's ``points`` (n, 3) of half links lie on their mid-plane, (n,) (collective)."""
    height = comm.allreduce(float(points[:, 2].max(initial=0.0)), op=MPI.MAX)
    return points[:, 2] <= _FLAT * height
