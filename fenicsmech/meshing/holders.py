"""Which site holds a cell: at most one may."""

from __future__ import annotations

from collections.abc import Sequence

from fenicsmech.errors import MeshingError
from fenicsmech.meshing.link_mesh import FREE
from fenicsmech.meshing.mesh_request import MeshRequest


def sole_holder(request: MeshRequest, holders: Sequence[int]) -> int:
    """The one site among ``holders``, or FREE.

    Raises:
        MeshingError: there are two.
    """
    if len(holders) > 1:
        raise overlap(request, *holders[:2])
    return holders[0] if len(holders) else FREE


def overlap(request: MeshRequest, first: int, second: int) -> MeshingError:
    """The error that says that the sites ``first`` and ``second`` of the request touch or overlap."""
    one, other = (request.sites[k] for k in (first, second))
    return MeshingError(
        request.part,
        f"the interface regions of joints {one.name!r} at {_shown(one.at)} and {other.name!r} at {_shown(other.at)} "
        "touch or overlap",
        "Make the regions smaller or move the joints apart",
    )


def _shown(at: tuple[float, ...]) -> str:
    return f"({', '.join(f'{c:g}' for c in at)})"
