"""The discretised mechanism: mesh, elastic links, bodies and constraints of one scene."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import numpy as np
import ufl
from mpi4py import MPI

from fenicsmech.clock import Clock
from fenicsmech.collective import on_one
from fenicsmech.compat import cell_dofs, cell_nodes, original_nodes
from fenicsmech.effects import LinkFields, find_boundaries
from fenicsmech.elasticity import ElasticBody, ElasticModel, Stretch
from fenicsmech.equilibrium import EquilibriumSystem, PointLoad, State, load_fields
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Effect, FlexibleLink, Force, Material, Mechanism, Output, in_dimension
from fenicsmech.meshing import (
    InterfaceSite,
    LinkMesh,
    MechanismMesh,
    bulge_field,
    check_link,
    distribute,
    mesh_link,
)
from fenicsmech.model.fidelity import Fidelity
from fenicsmech.multibody import BodyPoint, DesignAtNodes, InterfaceMap, Linkage, LinkPoint, body_point, link_point


class MechanismModel:
    """A mechanism at one fidelity, ready for equilibria.

    Attributes:
        mechanism, linkage: the mechanism and its bodies.
        materials: of the flexible links.
        mesh: the reference mesh of all flexible links.
        elastic: their elastic energy.
        interfaces: interface nodes as functions of body poses.
        design_nodes: the design field at the nodes of the displacement.
        node_link: index of the flexible link of every local node.
        clock: of the phases.
        mixed: whether each flexible link is in the u–p formulation.
        effects: of the scene.
        potentials: potentials of body poses.
        spring_potentials: those of springs, which act from the start.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        linkage: Linkage,
        mesh: MechanismMesh,
        fidelity: Fidelity,
        clock: Clock,
        effects: Sequence[Effect] = (),
        materials: Sequence[Material] | None = None,
    ) -> None:
        self.mechanism, self.linkage, self.mesh, self.clock = mechanism, linkage, mesh, clock
        self.effects = tuple(effects)
        links = mechanism.flexible_links
        self.materials = tuple(link.material for link in links) if materials is None else tuple(materials)
        self.mixed = fidelity.formulation.mixed(list(self.materials), fidelity.model, fidelity.order)
        faces = [part for effect in effects for part in effect.faces]
        self._boundaries = find_boundaries(mesh.mesh, links, mesh.link, faces, half=fidelity.model.half)
        self.elastic = ElasticBody(
            mesh.mesh,
            link=mesh.link,
            free=mesh.interface < 0,
            materials=list(self.materials),
            depths=[link.shape.depth for link in links],
            model=fidelity.model,
            order=fidelity.order,
            quadrature=fidelity.quadrature,
            effects=[partial(self._link_energy, effect) for effect in effects],
            stretches=_stretches(links, fidelity.model, effects),
            # only fields of the bulge's degree can move curved cells rigidly
            bulge=bulge_field(mesh) if fidelity.order > 1 else None,
            mixed=self.mixed,
        )
        self.potentials = [potential for effect in effects for potential in effect.pose_potentials(linkage)]
        self.spring_potentials = tuple(potential for potential in self.potentials if potential.holds)
        self._compliances: dict[int, float] = {}
        for effect in effects:
            for row, compliance in effect.soften(linkage).items():
                self._compliances[row] = self._compliances.get(row, 0.0) + compliance
        first = len(mechanism.rigid_links)
        cell_body = np.where(mesh.interface >= 0, mesh.interface + first, -1)
        centres = np.array([body.centre for body in linkage.bodies])
        self.interfaces = InterfaceMap(
            self.elastic.u, self.elastic.drawn_nodes, cell_body, centres, linkage.joints.space
        )
        self.design_nodes = DesignAtNodes(self.elastic.d, self.elastic.u)
        self.node_link = self._link_of_nodes()
        self._point_loads: dict[Force | Output, PointLoad] = {}

    @property
    def flexible_dofs(self) -> int:
        """Displacements of the flexible links that are unknown, interfaces and mid-planes excluded."""
        return self.mesh.mesh.comm.allreduce(int(np.sum(self.interfaces.unknown)))

    @property
    def pressure_dofs(self) -> int:
        """Pressures that are unknown."""
        return 0 if self.elastic.pressure is None else self.elastic.pressure.count

    @property
    def rigid_dofs(self) -> int:
        """Coordinates of all rigid and interface bodies, fixed ones included."""
        return len(self.linkage.bodies) * self.linkage.joints.space.pose_size

    def reshape(self, design: np.ndarray) -> None:
        """Gives the links the rest shape X₀ + d, d this rank's P1 values with ghosts, flat."""
        self.elastic.d.x.array[:] = design
        self.interfaces.reshape(self.design_nodes.values())

    def set_parameter(self, links: np.ndarray, name: str, value: float) -> None:
        """Gives the links in a mask (links,) another value of a parameter of their law, as "E". Local."""
        self.elastic.parameters[name].x.array[np.flatnonzero(links[self.mesh.link])] = value

    @contextmanager
    def shaped(self, design: np.ndarray) -> Iterator[None]:
        """A context in which the links have another rest shape."""
        before = self.elastic.d.x.array.copy()
        self.reshape(design)
        try:
            yield
        finally:
            self.reshape(before)

    def carry(self, state: State, design: np.ndarray) -> State:
        """Reshapes the links and guesses the equilibrium there from the one at the present shape."""
        self.load(state)
        carried = self.elastic.carried(design - self.elastic.d.x.array)
        self.reshape(design)
        displacements, *pressures = self.elastic.split(state.u)
        return replace(state, u=np.concatenate([carried[: len(displacements)], *pressures]))

    def load(self, state: State) -> None:
        """Makes the finite-element fields hold ``state``."""
        load_fields(self.elastic, self.interfaces, state)

    def point(self, part: Force | Output) -> BodyPoint | LinkPoint:
        """The material point of a force or output."""
        if not isinstance(part.on, FlexibleLink):
            at = np.array(in_dimension(part.at, self.linkage.dim))
            body = self.linkage.body_of(part.on)
            return body_point(at, body, np.array(self.linkage.bodies[body].centre), self.linkage.joints.space)
        topology = self.mesh.mesh.topology
        owned = topology.index_map(topology.dim).size_local
        index = self.mechanism.flexible_links.index(part.on)
        cells = np.flatnonzero(self.mesh.link[:owned] == index)
        corners = self.mesh.corners(cells)
        # in a model in the plane, a point at any height is on the mid-plane
        at = np.array(in_dimension(in_dimension(part.at, self.linkage.dim), self.elastic.model.dim))
        return link_point(f"{part.name!r}", at, self.elastic.u, cells, corners, self._bulges(cells))

    def point_load(self, force: Force | Output) -> PointLoad:
        """The point load of a force, or of a unit force along an output."""
        if force not in self._point_loads:
            dim = self.elastic.model.dim if isinstance(force.on, FlexibleLink) else self.linkage.dim
            direction = np.array(in_dimension(force.direction, dim))
            self._point_loads[force] = PointLoad(force.name, self.point(force), direction)
        return self._point_loads[force]

    def travel(self, part: Force | Output, state: State) -> float:
        """Travel of the point of a force or output in the loaded ``state``."""
        load = self.point_load(part)
        return float(load.direction @ load.point.displacement(self.elastic.u, state.poses))

    def system(self, controlled: PointLoad, loads: tuple[tuple[PointLoad, float], ...]) -> EquilibriumSystem:
        """The equilibrium equations with one controlled and several fixed loads."""
        return EquilibriumSystem(
            self.elastic,
            self.interfaces,
            self.linkage.joints,
            controlled=controlled,
            loads=loads,
            potentials=self.potentials,
            compliances=self._compliances,
            clock=self.clock,
            comm=self.mesh.comm,
        )

    def assembled_state(self, poses: np.ndarray, motors: np.ndarray) -> State:
        """The state of a rigid assembly: every flexible link carried along by its first interface."""
        dim, owned = self.linkage.dim, self.interfaces.owned
        positions = self.elastic.drawn_nodes[:owned, :dim] + self.design_nodes.values()[:owned, :dim]
        u = np.zeros((owned, self.interfaces.block))
        for index, link in enumerate(self.mechanism.flexible_links):
            body = self.linkage.interfaces[link][0]
            nodes = np.flatnonzero(self.node_link[:owned] == index)
            offsets = positions[nodes] - np.array(self.linkage.bodies[body].centre)
            u[nodes, :dim] = self.linkage.joints.space.displace(poses[body], offsets)
        unpressed = np.zeros(0 if self.elastic.pressure is None else len(self.elastic.pressure.unknown))
        return State(np.concatenate([u.ravel(), unpressed]), poses, np.zeros(self.linkage.joints.rows), 0.0, motors)

    @property
    def fields(self) -> LinkFields:
        """The fields that link energies are written in."""
        return self._fields(self.elastic)

    def _fields(self, body: ElasticBody) -> LinkFields:
        return LinkFields(tuple(self.mechanism.flexible_links), body, self._boundaries)

    def _link_energy(self, effect: Effect, body: ElasticBody) -> ufl.Form | None:
        """The energy of an effect in the fields of ``body``."""
        return effect.link_energy(self._fields(body))

    def _bulges(self, cells: np.ndarray) -> np.ndarray:
        """Bulges of the edges of local ``cells``, in the displacement field, (cells, pairs, dim)."""
        mesh = self.mesh.mesh
        bulges = self.mesh.curved.of_cells(original_nodes(mesh)[cell_nodes(mesh)[cells]])
        return bulges if self.elastic.bulge is not None else np.zeros_like(bulges)

    def _link_of_nodes(self) -> np.ndarray:
        """Index of the flexible link of every local node."""
        owner = np.full(len(self.interfaces.body), -1)
        owner[cell_dofs(self.elastic.u.function_space)] = self.mesh.link[:, None]
        return owner


def _stretches(links: Sequence[FlexibleLink], model: ElasticModel, effects: Sequence[Effect]) -> list[Stretch | None]:
    """The stretch of the strain-free state of each link.

    Raises:
        DescriptionError: a link has two.
    """
    found: dict[FlexibleLink, Stretch] = {}
    for effect in effects:
        for link, stretch in effect.growth(model).items():
            if link in found:
                raise DescriptionError(f"link {link.name!r}", "it is prestrained twice", "Leave one out")
            found[link] = stretch
    return [found.get(link) for link in links]


def check_links(mechanism: Mechanism, linkage: Linkage, fidelity: Fidelity) -> None:
    """Checks links, joints and points before anything is meshed."""
    for link in mechanism.flexible_links:
        points = {part.name: part.at for part in (*mechanism.forces, *mechanism.outputs) if part.on == link}
        sites, options = _mesh_request(link, linkage, fidelity)
        check_link(link.name, link.shape, sites, points, **options)


def mesh_links(mechanism: Mechanism, linkage: Linkage, fidelity: Fidelity) -> list[LinkMesh]:
    """The mesh of every flexible link. Local."""
    meshes = []
    for link in mechanism.flexible_links:
        sites, options = _mesh_request(link, linkage, fidelity)
        meshes.append(mesh_link(link.name, link.shape, sites, **options))
    return meshes


def mesh_mechanism(comm: MPI.Comm, mechanism: Mechanism, linkage: Linkage, fidelity: Fidelity) -> MechanismMesh:
    """Meshes on rank 0 and distributes; an error there is raised on all ranks."""
    return distribute(comm, on_one(comm, lambda: mesh_links(mechanism, linkage, fidelity)))


def _mesh_request(link: FlexibleLink, linkage: Linkage, fidelity: Fidelity) -> tuple[list[InterfaceSite], dict]:
    """Interface sites and element sizes of ``link``."""
    bodies = [linkage.bodies[index] for index in linkage.interfaces[link]]
    # a pin along z holds its link at whatever height the link is
    ats = [body.centre[:2] if body.axis[2] == 1.0 else body.centre for body in bodies]
    sites = [
        InterfaceSite(at, body.region, body.axis, body.name)
        for at, body in zip(ats, bodies, strict=True)
        if body.region is not None  # interfaces have regions, rigid links none
    ]
    size, half = fidelity.sizes[link], fidelity.model.half
    options = {"layers": fidelity.layers, "segments": fidelity.segments}
    return sites, {"dim": fidelity.model.dim, "size": size, "half": half, **options}
