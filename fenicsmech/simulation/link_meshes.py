"""The meshes of a mechanism's flexible links at a fidelity."""

from __future__ import annotations

from mpi4py import MPI

from fenicsmech.collective import on_one
from fenicsmech.mechanism import FlexibleLink, Mechanism
from fenicsmech.meshing import InterfaceSite, LinkMesh, MechanismMesh, check_link, distribute, mesh_link
from fenicsmech.multibody import Linkage
from fenicsmech.simulation.fidelity import Fidelity


def check_links(mechanism: Mechanism, linkage: Linkage, fidelity: Fidelity) -> None:
    """Refuses links, joints and points that cannot be right, before anything is meshed."""
    for link in mechanism.flexible_links:
        points = {part.name: part.at for part in (*mechanism.forces, *mechanism.outputs) if part.on == link}
        sites = interface_sites(linkage, link)
        asked = _asked(link, fidelity)
        check_link(link.name, link.shape, sites, points, **asked)


def mesh_links(mechanism: Mechanism, linkage: Linkage, fidelity: Fidelity) -> list[LinkMesh]:
    """The mesh of every flexible link, on the calling rank."""
    return [
        mesh_link(link.name, link.shape, interface_sites(linkage, link), **_asked(link, fidelity))
        for link in mechanism.flexible_links
    ]


def _asked(link: FlexibleLink, fidelity: Fidelity) -> dict:
    """What is asked of the mesh of ``link``."""
    return {
        "dim": fidelity.model.dim,
        "size": fidelity.sizes[link],
        "layers": fidelity.layers,
        "segments": fidelity.segments,
        "half": fidelity.model.symmetric,
    }


def interface_sites(linkage: Linkage, link: FlexibleLink) -> list[InterfaceSite]:
    """Where joints hold ``link``."""
    sites = []
    for body in (linkage.bodies[i] for i in linkage.interfaces[link]):
        # a pin along z holds its link at whatever height the link is
        at = body.centre[:2] if body.axis[2] == 1.0 else body.centre
        sites.append(InterfaceSite(at, body.region, body.axis, body.name))
    return sites


def mesh_mechanism(comm: MPI.Comm, mechanism: Mechanism, linkage: Linkage, fidelity: Fidelity) -> MechanismMesh:
    """Meshes on rank 0 and distributes; an error there is raised on all ranks (collective)."""
    return distribute(comm, on_one(comm, lambda: mesh_links(mechanism, linkage, fidelity)))
