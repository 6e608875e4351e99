"""Targets spread over groups of processes: each group has its own communicator and finds its targets' equilibria."""

from __future__ import annotations

from dataclasses import dataclass

from mpi4py import MPI

_PARTS = MPI.Comm.Create_keyval()  # of a communicator: its parts by their number, made once
_SHARED = 0.5  # speed-up of one equilibrium on n processes ≈ n^0.5; measured 1.4 on two


@dataclass(frozen=True)
class Group:
    """This process's group.

    Attributes:
        everyone: the communicator of all groups.
        comm: the communicator of this one.
        mine: indices of the targets of this group.
    """

    everyone: MPI.Comm
    comm: MPI.Comm
    mine: tuple[int, ...]

    @property
    def leads(self) -> bool:
        """Whether this process speaks for its group."""
        return self.comm.rank == 0


def group_count(processes: int, targets: int) -> int:
    """The number of groups that promises the shortest time.

    A group of n processes works off ⌈targets / groups⌉ equilibria, each in a time of 1 / √n.
    """
    choices = range(1, min(processes, targets) + 1)
    return min(choices, key=lambda groups: -(-targets // groups) / (processes // groups) ** _SHARED)


def split(comm: MPI.Comm, targets: int) -> Group:
    """Groups of neighbouring processes of ``comm``; target k goes to group k modulo their number (collective)."""
    count = group_count(comm.size, targets)
    if count == 1:
        return Group(comm, comm, tuple(range(targets)))
    mine = comm.rank * count // comm.size
    parts: dict[int, MPI.Comm] | None = comm.Get_attr(_PARTS)
    if parts is None:
        parts = {}
        comm.Set_attr(_PARTS, parts)
    if count not in parts:
        parts[count] = comm.Split(color=mine, key=comm.rank)
    return Group(comm, parts[count], tuple(range(mine, targets, count)))
