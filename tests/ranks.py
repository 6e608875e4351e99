"""Communicators of tests whose results must not depend on them."""

import pytest
from mpi4py import MPI

EACH_COMM = [
    pytest.param(MPI.COMM_SELF, id="alone"),
    pytest.param(MPI.COMM_WORLD, id="together", marks=pytest.mark.parallel),
]
