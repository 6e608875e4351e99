"""The discretised scene: its fidelity, and the mechanism with mesh, elastic links, bodies, constraints and loads."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol, runtime_checkable

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from scipy.sparse import csr_matrix

from fenicsmech.collective import on_one
from fenicsmech.compat import cell_dofs, cell_nodes, original_nodes
from fenicsmech.effects import LinkFields, find_boundaries, region_average
from fenicsmech.elasticity import (
    MID_PLANE_SYMMETRIC,
    PLANE_STRAIN,
    PLANE_STRESS,
    SPATIAL,
    ElasticBody,
    ElasticModel,
    Formulation,
    Quadrature,
    Stretch,
)
from fenicsmech.equilibrium import EquilibriumSystem, PointLoad, State, TurningLink, load_fields
from fenicsmech.errors import DescriptionError, expect, positive, set_fields, whole
from fenicsmech.log import Clock
from fenicsmech.mechanism import (
    Effect,
    FlexibleLink,
    Force,
    Material,
    MaterialPoint,
    Mechanism,
    MeshPart,
    Output,
    Scene,
    Shape,
    StepPart,
    in_dimension,
    validate,
)
from fenicsmech.meshing import (
    LEAST_SEGMENTS,
    Figure,
    InterfaceSite,
    LinkMesh,
    MechanismMesh,
    bulge_field,
    check_link,
    distribute,
    has_plain_outline,
    image_of,
    mesh_link,
    same_mesh,
)
from fenicsmech.multibody import (
    BodyPoint,
    DesignAtNodes,
    InterfaceMap,
    Linkage,
    LinkPoint,
    PlacedPoint,
    Spin,
    link_point,
    spins,
)

SPACES = {model.name: model for model in (SPATIAL, MID_PLANE_SYMMETRIC, PLANE_STRESS, PLANE_STRAIN)}
"""Names of the elastic models, as users type them."""


@dataclass(frozen=True)
class Fidelity:
    """Elastic model, elements and formulation of a simulation.

    Attributes:
        model: 3D, whole or half, plane strain or plane stress.
        order: degree of the displacement field.
        sizes: element size per flexible link.
        quadrature: quadrature degree.
        formulation: the criterion for links in the u–p (mixed) formulation.
        layers: through the depth, or through half of it where half is meshed; None: chosen from depth and size.
        segments: around a pin, at least.
    """

    model: ElasticModel
    order: int
    sizes: Mapping[FlexibleLink, float]
    quadrature: Quadrature
    formulation: Formulation
    layers: int | None = None
    segments: int = LEAST_SEGMENTS

    @property
    def size_text(self) -> str:
        """The element sizes as text: ``1.5``, ``1.5 to 3``."""
        least, most = min(self.sizes.values()), max(self.sizes.values())
        return f"{least:.3g}" if least == most else f"{least:.3g} to {most:.3g}"


def read_fidelity(
    scene: Scene,
    *,
    space: str | None,
    order: int | None,
    size: float | Mapping[FlexibleLink, float] | None,
    quadrature: Quadrature | None,
    formulation: Formulation,
    layers: int | None,
    segments: int | None,
) -> Fidelity:
    """The fidelity, if ``scene`` can be simulated at it; arguments as those of ``Simulation``.

    Raises:
        DescriptionError: it cannot.
    """
    space, order = "3d" if space is None else space, 2 if order is None else order
    if space not in SPACES:
        raise DescriptionError("space", f"{space!r} is not known", f"Choose one of {', '.join(SPACES)}")
    if whole("order", order, least=1) > 3:
        raise DescriptionError("order", f"{order!r} is not 1, 2 or 3", "Choose 1 for speed, 2 for accuracy")
    if size is None:
        raise DescriptionError("size", "it is missing", "Give an element size, or accuracy=… to have one chosen")
    model, shapes = SPACES[space], [link.shape for link in scene.mechanism.flexible_links]
    sizes = {
        link: positive(f"element size of {link.name!r}", own) for link, own in per_link(scene.mechanism, size).items()
    }
    rule = quadrature or Quadrature.for_order(order, model.dim)
    check_scene(scene, model)
    layered = model.dim == 3 and any(map(has_plain_outline, shapes))
    meshed = not all(isinstance(shape, MeshPart) for shape in shapes)
    for name, value, counts, reason in (
        ("layers", layers, layered, "only strips and outlines in space have layers"),
        ("segments", segments, meshed, "links from mesh files have the elements of the file"),
    ):
        if value is not None and not counts:
            raise DescriptionError(name, f"{name}={value!r} would change nothing: {reason}", f"Leave out {name}")
    return Fidelity(model, order, sizes, rule, formulation, layers, LEAST_SEGMENTS if segments is None else segments)


def per_link(
    mechanism: Mechanism, given: float | Mapping[FlexibleLink, float] | None
) -> dict[FlexibleLink, float | None]:
    """A number of each flexible link, from one of all or some of each; None where there is none.

    Raises:
        DescriptionError: it names something else than flexible links of ``mechanism``.
    """
    links = mechanism.flexible_links
    if not isinstance(given, Mapping):
        return dict.fromkeys(links, given)
    for link in given:
        if link not in links:
            problem = f"{link!r} is not a flexible link of {mechanism.name!r}"
            raise DescriptionError("size", problem, "Give {link: size, …} of its flexible links")
    return {link: given.get(link) for link in links}


def check_scene(scene: Scene, model: ElasticModel) -> None:
    """Raises a DescriptionError if a scene cannot be simulated in ``model``."""
    mechanism = scene.mechanism
    validate(mechanism, model.mechanism_dim)
    if not mechanism.flexible_links:
        raise DescriptionError(
            f"mechanism {mechanism.name!r}", "no link is flexible: nothing would bend", "Add one with flexible()"
        )
    for effect in scene.effects:
        effect.check(mechanism, model.mechanism_dim)


def fits(scene: Scene, model: ElasticModel) -> bool:
    """Whether a scene can be simulated in ``model``."""
    try:
        check_scene(scene, model)
    except DescriptionError:
        return False
    return True


def spatial_model(scene: Scene, shapes: Sequence[Shape]) -> ElasticModel:
    """The model of a scene in space: of half the depth where that is symmetric, and no file holds whole links."""
    half = fits(scene, MID_PLANE_SYMMETRIC) and not any(isinstance(shape, StepPart | MeshPart) for shape in shapes)
    return MID_PLANE_SYMMETRIC if half else SPATIAL


def check_links(
    mechanism: Mechanism,
    shapes: Sequence[Shape],
    linkage: Linkage,
    fidelity: Fidelity,
    placed: Collection[MaterialPoint] = (),
) -> None:
    """Checks links of some shapes, joints, and points that are not ``placed`` elsewhere, before anything is meshed."""
    parts = [part for part in (*mechanism.forces, *mechanism.outputs) if part.material not in placed]
    for link, shape in zip(mechanism.flexible_links, shapes, strict=True):
        points = {part.name: part.at for part in parts if part.on == link}
        check_link(link.name, shape, points=points, **_mesh_options(link, linkage, fidelity))


def mesh_links(mechanism: Mechanism, shapes: Sequence[Shape], linkage: Linkage, fidelity: Fidelity) -> list[LinkMesh]:
    """The mesh of every flexible link, of which each has one of ``shapes``; images of one another have one. Local."""
    meshes: dict[FlexibleLink, LinkMesh] = {}
    drawn: list[tuple[FlexibleLink, Figure, tuple]] = []
    pairs = zip(mechanism.flexible_links, shapes, strict=True)
    for link, shape in sorted(pairs, key=lambda pair: pair[0].name):  # independent of the order of description
        options = _mesh_options(link, linkage, fidelity)
        if has_plain_outline(shape):
            figure = Figure.of(link.name, shape, options["sites"], dim=fidelity.model.dim)
            same = shape.depth, type(shape), fidelity.sizes[link]
            for other, known, there in drawn:
                if there == same and (match := same_mesh(known, figure)) is not None:
                    meshes[link] = image_of(meshes[other], match.isometry, match.sites)
                    break
            drawn.append((link, figure, same))
        if link not in meshes:
            meshes[link] = mesh_link(link.name, shape, **options)
    return [meshes[link] for link in mechanism.flexible_links]


def mesh_mechanism(
    comm: MPI.Comm, mechanism: Mechanism, shapes: Sequence[Shape], linkage: Linkage, fidelity: Fidelity
) -> MechanismMesh:
    """Meshes on rank 0 and distributes; an error there is raised on all ranks."""
    return distribute(comm, on_one(comm, lambda: mesh_links(mechanism, shapes, linkage, fidelity)))


def plan_sites(linkage: Linkage, link: FlexibleLink) -> list[InterfaceSite]:
    """The interfaces of a link in the plane, in the order of its mesh."""
    bodies = (linkage.bodies[index] for index in linkage.interfaces[link])
    return [InterfaceSite(body.centre[:2], body.region, name=body.name) for body in bodies if body.region is not None]


def _mesh_options(link: FlexibleLink, linkage: Linkage, fidelity: Fidelity) -> dict[str, Any]:
    """Arguments of ``mesh_link`` and ``check_link`` for ``link``."""
    bodies = [linkage.bodies[index] for index in linkage.interfaces[link]]
    sites = [
        # a pin along z holds its link at whatever height the link is
        InterfaceSite(body.centre[:2] if abs(body.axis[2]) == 1.0 else body.centre, body.region, body.axis, body.name)
        for body in bodies
        if body.region is not None  # interfaces have regions, rigid links none
    ]
    model, size, layers = fidelity.model, fidelity.sizes[link], fidelity.layers
    return dict(sites=sites, dim=model.dim, size=size, half=model.half, layers=layers, segments=fidelity.segments)


@dataclass(frozen=True, eq=False)
class Design:
    """What designs change in a model.

    Numbers that shift joints do not reshape flexible links: ``field`` has to take these along, like that of
    ``DesignProblem.rest_shape`` and of results does. Numbers of depth stretch links in addition to ``field``.

    Attributes:
        field: the design field of the links' shapes, this rank's values with ghosts, flat; read-only, since all
            frames of one design share it.
        numbers: values of design numbers by their kind (``NumberKind``), in its unit; others are as drawn.

    Raises:
        DescriptionError: it has something other than kinds of numbers, a value is invalid, or two numbers change the
            same thing.
    """

    field: np.ndarray
    numbers: Mapping[Any, float] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        check_numbers([(kind, (value,)) for kind, value in self.numbers.items()])
        if self.field.flags.writeable or not self.field.flags.owndata:
            field = np.array(self.field)
            field.setflags(write=False)
            set_fields(self, field=field)

    def halfway(self, other: Design) -> Design:
        """The mean of both."""
        numbers = {kind: 0.5 * (value + other.numbers[kind]) for kind, value in self.numbers.items()}
        return Design(0.5 * (self.field + other.field), numbers)


class MechanismModel:
    """A mechanism at one fidelity, ready for equilibria.

    Attributes:
        materials: of the flexible links.
        shapes: of the flexible links, as drawn.
        depths: of the flexible links.
        mesh: the reference mesh of all flexible links.
        elastic: their elastic energy.
        fields: the fields of effects' energies.
        interfaces: interface nodes as functions of body poses.
        design_nodes: the design field at the nodes of the displacement.
        node_link: index of the flexible link of every local node.
        clock: of the phases.
        mixed: whether each flexible link is in the u–p formulation.
        effects: of the scene.
        placed: points of links that are elsewhere than drawn.
        stress_options: of the recovery of stresses of the simulation, ``StressOptions``; None: its defaults.
        effect_potentials: potentials of body poses of each effect.
        potentials: all of these.
        spring_potentials: those of springs, which act from the start.
        compliances: of joints that give way, by row of the joints' constraints.
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
        shapes: Sequence[Shape] | None = None,
        placed: Mapping[MaterialPoint, PlacedPoint] | None = None,
        stress: Any = None,
    ) -> None:
        self.placed, self.stress_options = dict(placed or {}), stress
        self.mechanism, self.linkage, self.mesh, self.clock = mechanism, linkage, mesh, clock
        self.effects, links = tuple(effects), mechanism.flexible_links
        self.materials = tuple(link.material for link in links) if materials is None else tuple(materials)
        self.shapes = tuple(shapes or [link.shape for link in links])
        self.depths = tuple(shape.depth for shape in self.shapes)
        fidelity.model.check(list(self.materials))
        self.mixed = fidelity.formulation.mixed(list(self.materials), fidelity.model, fidelity.order)
        faces = [part for effect in effects for part in effect.faces]
        boundaries = find_boundaries(mesh.mesh, links, mesh.link, faces, half=fidelity.model.half)

        self._effect_fields: list[tuple[Effect, LinkFields]] = []
        self._on_links: list[Effect] = []  # effects with an energy of links

        def energy(effect: Effect, body: ElasticBody) -> ufl.Form | None:
            fields = LinkFields(tuple(links), body, boundaries)
            self._effect_fields.append((effect, fields))
            if (term := effect.link_energy(fields)) is not None:
                self._on_links.append(effect)
            return term

        self.elastic = ElasticBody(
            mesh.mesh,
            link=mesh.link,
            free=mesh.interface < 0,
            materials=self.materials,
            depths=self.depths,
            model=fidelity.model,
            order=fidelity.order,
            quadrature=fidelity.quadrature,
            effects=[partial(energy, effect) for effect in effects],
            stretches=_stretches(links, fidelity.model, effects),
            # only fields of the bulge's degree can move curved cells rigidly
            bulge=bulge_field(mesh) if fidelity.order > 1 else None,
            mixed=self.mixed,
        )
        self.fields = LinkFields(tuple(links), self.elastic, boundaries)
        self.effect_potentials = [(effect, tuple(effect.pose_potentials(linkage))) for effect in effects]
        self.potentials = [potential for _, found in self.effect_potentials for potential in found]
        self.spring_potentials = tuple(potential for potential in self.potentials if potential.holds)
        self.compliances: dict[int, float] = {}
        for effect in effects:
            for row, compliance in effect.soften(linkage).items():
                self.compliances[row] = self.compliances.get(row, 0.0) + compliance
        cell_body = np.where(mesh.interface >= 0, mesh.interface + len(mechanism.rigid_links), -1)
        centres = np.array([body.centre for body in linkage.bodies])
        self.interfaces = InterfaceMap(
            self.elastic.u, self.elastic.drawn_nodes, cell_body, centres, linkage.joints.space
        )
        self.design_nodes = DesignAtNodes(self.elastic.shape.function_space, self.elastic.u.function_space)
        self.node_link = np.full(len(self.interfaces.body), -1)
        self.node_link[cell_dofs(self.elastic.u.function_space)] = mesh.link[:, None]
        self._point_loads: dict[Force | Output, PointLoad] = {}
        self._numbers: dict[Hashable, Any] = {}
        self._given_last: tuple[Hashable, ...] = ()
        self._shape = Design(self.elastic.design).field

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

    @property
    def effect_fields(self) -> list[tuple[Effect, LinkFields]]:
        """The fields of each effect, with the numbers of its energy."""
        _ = self.elastic.effects_ufl  # names the numbers
        return self._effect_fields

    # -- shape, material and other numbers -----------------------------------------------------------------------

    @property
    def design(self) -> Design:
        """The present design, with all numbers requested so far, except those that contradict the ones given last."""
        held: list[Any] = []
        for kind in (*self._given_last, *self._numbers):
            if kind not in held and _contradicted(kind, held) is None:
                held.append(kind)
        return Design(self._shape, {kind: self._numbers[kind].value for kind in held})

    def number(self, kind):
        """The ``ModelNumber`` of a ``NumberKind`` on this model; designs of the model hold it from now on."""
        if kind not in self._numbers:
            with self.shaped(Design(self._shape)):  # the drawn value is read off the parts
                self._numbers[kind] = kind.on(self)
        return self._numbers[kind]

    def reshape(self, design: Design | np.ndarray) -> None:
        """Gives the links the rest shape X₀ + c + d, and other parts their numbers.

        Args:
            design: or a design field alone, this rank's values with ghosts, flat; numbers stay as they are.
        """
        given = self._given(design)
        for kind in given.numbers:
            self.number(kind)
        # drawn ones first: they may change the same parts as those given
        for kind in sorted(self._numbers, key=lambda kind: kind in given.numbers):
            own = self._numbers[kind]
            own.set(given.numbers.get(kind, own.drawn))
        self._given_last, self._shape = tuple(given.numbers), given.field
        design = self._field(given)
        self.elastic.reshape(design)
        self.interfaces.reshape(self.design_nodes.values(design))

    @contextmanager
    def shaped(self, design: Design | np.ndarray) -> Iterator[None]:
        """A context in which the model has another design."""
        before = self.design
        self.reshape(design)
        try:
            yield
        finally:
            self.reshape(before)

    def set_parameter(self, links: np.ndarray, name: str, value: float) -> None:
        """Gives the links in a mask (links,) another value of a parameter of their law, as "E". Local."""
        self.elastic.parameters[name].x.array[np.flatnonzero(links[self.mesh.link])] = value
        self.materials = tuple(
            replace(material, law=material.law.with_parameters({**material.law.parameters, name: value}))
            if chosen
            else material
            for material, chosen in zip(self.materials, links, strict=True)
        )

    def set_depth(self, links: np.ndarray, value: float) -> None:
        """Gives the links in a mask (links,) another depth, which counts in planar models. Local."""
        self.elastic.depth.x.array[np.flatnonzero(links[self.mesh.link])] = value
        self.depths = tuple(value if own else depth for depth, own in zip(self.depths, links, strict=True))

    def _given(self, design: Design | np.ndarray) -> Design:
        return Design(design, self.design.numbers) if isinstance(design, np.ndarray) else design

    def _field(self, design: Design) -> np.ndarray:
        """d of a design, the shares of numbers included."""
        every = self._numbers.items()
        shares = ((design.numbers.get(kind, own.drawn) - own.drawn) * own.rate for kind, own in every)
        return sum(shares, start=design.field)

    # -- states -------------------------------------------------------------------------------------------------

    def load(self, state: State) -> None:
        """Makes the finite-element fields hold ``state``."""
        load_fields(self.elastic, self.interfaces, state)

    def carry(self, state: State, design: Design | np.ndarray) -> State:
        """Changes the design and guesses the equilibrium there from the one at the present design."""
        self.load(state)
        given = self._given(design)
        carried = self.elastic.carried(self._field(given) - self.elastic.design)
        self.reshape(given)
        displacements, *pressures = self.elastic.split(state.u)
        return replace(state, u=np.concatenate([carried[: len(displacements)], *pressures]))

    def assembled_state(self, poses: np.ndarray, motors: np.ndarray) -> State:
        """The state of a rigid assembly: every flexible link carried along by its first interface."""
        dim, owned = self.linkage.dim, self.interfaces.owned
        positions = self.elastic.drawn_nodes[:owned, :dim] + self.design_nodes.values(self.elastic.design)[:owned, :dim]
        u = np.zeros((owned, self.interfaces.block))
        for index, (body, *_) in enumerate(self.linkage.interfaces.values()):
            nodes = np.flatnonzero(self.node_link[:owned] == index)
            offsets = positions[nodes] - np.array(self.linkage.bodies[body].centre)
            u[nodes, :dim] = self.linkage.joints.space.displace(poses[body], offsets)
        pressures = np.zeros(0 if self.elastic.pressure is None else len(self.elastic.pressure.unknown))
        return State(np.concatenate([u.ravel(), pressures]), poses, np.zeros(self.linkage.joints.rows), 0.0, motors)

    # -- points and loads ---------------------------------------------------------------------------------------

    def point(self, part: Force | Output) -> BodyPoint | LinkPoint:
        """The material point, or region, of a force or output."""
        if not isinstance(part.on, FlexibleLink):
            return self.linkage.point(part.on, part.at)
        if (placed := self.placed.get(part.material)) is not None:
            found = self._link_points(f"{part.name!r}", part.on, placed.positions, self.elastic.u, placed=True)
            weights = [own * point.weights for own, point in zip(placed.weights, found, strict=True)]
            nodes, node = np.unique(np.concatenate([point.global_nodes for point in found]), return_inverse=True)
            return LinkPoint(nodes, np.bincount(node, np.concatenate(weights)))
        if part.region is not None:
            links = self.mechanism.flexible_links
            return region_average(part, self._drawn(part.at), self.mesh, self.elastic, links)
        (point,) = self._link_points(f"{part.name!r}", part.on, [part.at], self.elastic.u)
        return point

    def rest_position(self, part: Force | Output) -> np.ndarray:
        """Position of the point of a force or output at the present rest shape, (dim,); its mean over a region."""
        if (placed := self.placed.get(part.material)) is not None:
            drawn = (placed.weights @ placed.positions)[: self.linkage.dim]
        else:
            drawn = np.array(in_dimension(part.at, self.linkage.dim))
        if not isinstance(part.on, FlexibleLink):
            return drawn
        design = fem.Function(self.elastic.u.function_space)
        design.x.array[:] = self.design_nodes.values(self.elastic.design).ravel()
        return drawn + self.point(part).displacement(design, self.linkage.joints.drawn)[: self.linkage.dim]

    def placed_point(self, material: MaterialPoint) -> PlacedPoint:
        """A point of a flexible link, or the nodes in a region of it with their weights, at the present rest shape."""
        link, at, region = material
        point = self.point(Output(link, at, (), f"point of {link.name}", region))
        assert isinstance(point, LinkPoint)
        nodes = self.elastic.drawn_nodes + self.design_nodes.values(self.elastic.design)
        first, last = self.elastic.u.function_space.dofmap.index_map.local_range
        mine = (first <= point.global_nodes) & (point.global_nodes < last)
        positions = np.zeros((len(mine), nodes.shape[1]))
        positions[mine] = nodes[point.global_nodes[mine] - first]
        positions = self.mesh.comm.allreduce(positions)
        if region is None:
            return PlacedPoint((point.weights @ positions)[None], np.ones(1))
        return PlacedPoint(positions, point.weights)

    def position(self, part: Force | Output, state: State) -> np.ndarray:
        """Position of the point of a force or output in the loaded ``state``, (dim,)."""
        moved = self.point(part).displacement(self.elastic.u, state.poses)
        return self.rest_position(part) + moved[: self.linkage.dim]

    def design_weights(self, part: str, link: FlexibleLink, positions: np.ndarray) -> csr_matrix:
        """Weights of this rank's owned nodes of the design field in it at drawn points of a link, (points, nodes)."""
        shape = self.elastic.shape
        index = shape.function_space.dofmap.index_map
        weights = np.zeros((len(positions), index.size_local))
        for row, point in zip(weights, self._link_points(part, link, positions, shape), strict=True):
            own = point.global_nodes - index.local_range[0]
            mine = (own >= 0) & (own < index.size_local)
            np.add.at(row, own[mine], point.weights[mine])
        return csr_matrix(weights)

    def _link_points(
        self,
        part: str,
        link: FlexibleLink,
        positions: Iterable[Sequence[float]],
        field: fem.Function,
        *,
        placed: bool = False,
    ) -> list[LinkPoint]:
        """The points drawn, or ``placed``, at ``positions`` on a link, with the weights of a field there."""
        mesh, elastic = self.mesh.mesh, self.elastic
        owned = mesh.topology.index_map(mesh.topology.dim).size_local
        cells = np.flatnonzero(self.mesh.link[:owned] == self.mechanism.flexible_links.index(link))
        bulges = self.mesh.curved.of_cells(original_nodes(mesh)[cell_nodes(mesh)[cells]])
        if elastic.bulge is None:
            bulges = np.zeros_like(bulges)
        corners = self.mesh.corners(cells)
        if placed:  # those of whole links stand for both halves
            points = np.array(positions)
            points[:, 2:] = np.abs(points[:, 2:]) if elastic.model.half else points[:, 2:]
        else:
            points = np.array([self._drawn(at) for at in positions])
        return [link_point(part, at, field, cells, corners, bulges, placed=placed) for at in points]

    def _drawn(self, at: Sequence[float]) -> np.ndarray:
        """A drawn point on the mesh; where the mechanism moves in the plane, at any height it is on the mid-plane."""
        return np.array(in_dimension(in_dimension(at, self.linkage.dim), self.elastic.model.dim))

    def point_load(self, force: Force | Output) -> PointLoad:
        """The point load of a force, or of a unit force along an output."""
        if force not in self._point_loads:
            dim = self.elastic.model.dim if isinstance(force.on, FlexibleLink) else self.linkage.dim
            direction = np.array(in_dimension(force.direction, dim))
            spread = np.full(self.linkage.dim, np.inf)  # over a region: acts at no single place
            at = self.rest_position(force)[: self.linkage.dim] if force.region is None else spread
            self._point_loads[force] = PointLoad(force.name, ((self.point(force), direction),), ((force.on, at),))
        return self._point_loads[force]

    @property
    def effects_on_rigid_links(self) -> tuple[bool, ...]:
        """Of the effects with an energy of links, whether links that move as rigid bodies change it."""
        links = self.mechanism.flexible_links
        return tuple(
            bool(effect.one_sided(self.fields)) or not all(map(effect.turns_with, links)) for effect in self._on_links
        )

    def _spins(self, loads: Sequence[PointLoad], touching: Collection[FlexibleLink]) -> tuple[list[Spin], list[Spin]]:
        """The spins that neither loads nor potentials nor effects resist, obstacles may; and those that loads or
        obstacles may resist."""
        _ = self.elastic.effects_ufl  # names the effects on links
        links = self.mechanism.flexible_links
        bodies = {body for potential in self.potentials for body in potential.bodies}
        bodies |= {self.linkage.body_of(link) for own in self._on_links for link in links if not own.turns_with(link)}
        forces = [(self.linkage.body_of(link), at) for load in loads for link, at in load.places]
        found = spins(self.linkage)
        idle = [spin for spin in found if spin.is_idle(bodies, forces)]
        return idle, [spin for spin in found if spin not in idle or not spin.links.isdisjoint(touching)]

    def _nodes(self, spin: Spin) -> np.ndarray:
        """Owned nodes of the flexible links of a spin."""
        links = [index for index, link in enumerate(self.linkage.interfaces) if link in spin.links]
        return np.flatnonzero(np.isin(self.node_link[: self.interfaces.owned], links))

    def _turning(self) -> list[TurningLink]:
        """Bodies and owned nodes of each flexible link."""
        link = self.node_link[: self.interfaces.owned]
        own = enumerate(self.linkage.interfaces.values())
        return [TurningLink(bodies, np.flatnonzero(link == k)) for k, bodies in own]

    def travel(self, part: Force | Output, state: State) -> float:
        """Travel of the point of a force or output in the loaded ``state``."""
        return self.point_load(part).travel(self.elastic.u, state.poses)

    def system(self, controlled: PointLoad, loads: Sequence[PointLoad]) -> EquilibriumSystem:
        """The equilibrium equations with one controlled load and some constant ones."""
        one_sided = [constraint for effect in self.effects for constraint in effect.one_sided(self.fields)]
        idle, resisted = self._spins([controlled, *loads], {surface.link for surface in one_sided})
        return EquilibriumSystem(
            self.elastic,
            self.interfaces,
            self.linkage.joints,
            self._turning(),
            controlled=controlled,
            loads=loads,
            potentials=self.potentials,
            compliances=self.compliances,
            one_sided=one_sided,
            idle=idle,
            resisted=[(spin, self._nodes(spin)) for spin in resisted],
            clock=self.clock,
            comm=self.mesh.comm,
        )


@runtime_checkable
class _Kind(Protocol):
    """What a model needs of a kind of number (``fenicsmech.quantities.NumberKind``)."""

    @property
    def slots(self) -> Sequence[Hashable]: ...

    def check_value(self, value: float) -> None: ...

    def on(self, model: MechanismModel) -> Any: ...


def check_numbers(numbers: Sequence[tuple[Any, Sequence[float]]]) -> None:
    """Checks kinds of numbers that are given together, each with some values.

    Raises:
        DescriptionError: something other than a kind is given, a value is invalid, or two kinds change the same thing.
    """
    for k, (kind, values) in enumerate(numbers):
        expect("number", kind, _Kind, "a kind of number", "Give one, such as Depth(link)")
        for value in values:
            kind.check_value(value)
        if (other := _contradicted(kind, [own for own, _ in numbers[:k]])) is not None:
            twice = "it is given twice" if other == kind else f"{other} is given too, and both change the same thing"
            raise DescriptionError(str(kind), twice, "Give each number of a part once")


def _contradicted(kind: Any, others: Sequence[Any]) -> Any | None:
    """The first of some kinds of numbers that changes the same thing as ``kind``."""
    return next((other for other in others if not set(other.slots).isdisjoint(kind.slots)), None)


def _stretches(
    links: Sequence[FlexibleLink], model: ElasticModel, effects: Sequence[Effect]
) -> dict[str, list[Stretch | None]]:
    """The stretches of the strain-free state of each link by kind of effect; each link has at most one of a kind."""
    found: dict[str, dict[FlexibleLink, Stretch]] = {}
    directed: set[FlexibleLink] = set()
    for effect in effects:
        for link, stretch in effect.growth(model, links).items():
            kind = type(effect).__name__
            own = found.setdefault(kind, {})
            if link in own:
                raise DescriptionError(f"link {link.name!r}", f"its {kind} is given twice", "Leave one out")
            if stretch.along is not None and link in directed:
                problem = f"its {kind} is the second effect that stretches it along a direction"
                raise DescriptionError(f"link {link.name!r}", problem, "Leave one out: their order would count")
            if stretch.along is not None:
                directed.add(link)
            own[link] = stretch
    return {kind: [own.get(link) for link in links] for kind, own in found.items()}
