"""What is asked of the mesh of one link, and the functions that each kind of shape implements."""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch

from fenicsmech.meshing.interface_site import InterfaceSite
from fenicsmech.meshing.link_mesh import LinkMesh
from fenicsmech.meshing.sizing import LEAST_SEGMENTS


@dataclass(frozen=True)
class MeshRequest:
    """What the mesh of one link shall be.

    Attributes:
        link: the link's name, for messages.
        sites: where joints hold the link; the mesh conforms to their regions.
        dim: 2 or 3.
        size: target edge length in the plane of the link (everywhere, for a solid).
        layers: number of layers through the depth of an extruded link; None: chosen from depth and size.
        segments: of which the circle around a pin has at least so many.
        half: in space, mesh the half above the mid-plane z = 0 only; ``layers`` are those of the half.
    """

    link: str
    sites: tuple[InterfaceSite, ...]
    dim: int
    size: float
    layers: int | None = None
    segments: int = LEAST_SEGMENTS
    half: bool = False

    @property
    def part(self) -> str:
        """The link as messages name it."""
        return f"link {self.link!r}"

    def part_at(self, site: InterfaceSite) -> str:
        """The joint and the link as messages name them."""
        return f"joint {site.name!r} on link {self.link!r}"


@singledispatch
def mesh_shape(shape: object, request: MeshRequest) -> LinkMesh:
    """The mesh of ``shape`` that ``request`` asks for; each kind of shape registers its own way."""
    raise TypeError(f"{type(shape).__name__} is not a shape that can be meshed")


@singledispatch
def check_shape(shape: object, request: MeshRequest) -> None:
    """Refuse what can be seen to be wrong with ``shape`` and its joints before anything is meshed.

    Raises:
        MeshingError: the shape is no proper outline, its file cannot be read, or a joint is not on it.
    """
    raise TypeError(f"{type(shape).__name__} is not a shape that can be meshed")


@singledispatch
def holds(shape: object, request: MeshRequest, at: tuple[float, ...]) -> bool:
    """Whether the point ``at`` lies on ``shape``, as far as can be said without a mesh: True if in doubt."""
    return True
