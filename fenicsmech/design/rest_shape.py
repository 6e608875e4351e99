"""The design of a simulation as a function of parameters p: the links' rest shapes, with optimal handles, and numbers.

    p = (p_shapes, q),     p → s → θ* → d(s, θ*) → X = X₀ + c + d

with the parameters s of the links' splines, the handle positions θ, the design field d and the bulge c of the drawn
edges. Splines follow joints that numbers q shift, s = s(p_shapes) + Σ ∂s/∂δ_j · δ_j(q), also those of links without
parameters of their own, which keep their drawn shape while their joints stay as drawn. Handle positions are best for
the straight cells of drawn depth between the vertices. Links drawn by an outline keep their drawn shape at the initial
design p₀: their handles are at θ₀ + θ*(p) − θ*(p₀), where those of strips are at θ*(p), since handles that move along a
link of varying thickness, or turn about an eye, change its outline. Edges of the outline follow the design between
vertices too, their middles without the part along the chord. A design whose curved cells are squeezed too much has no
rest shape.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from fenicsmech.compat import cell_dofs, original_cells, owned_values, vector_space
from fenicsmech.design.description import Bounds, SplineDesign, joint_shifts, shape_requests
from fenicsmech.design.numbers import TYPICAL, Number, ScaledNumbers
from fenicsmech.design.shape.edges import MidEdgeNodes
from fenicsmech.design.shape.handle_optimum import HandleOptimum, HandlePlacement, ShapeError
from fenicsmech.design.shape.handles import BETWEEN
from fenicsmech.design.shape.quality import Barrier, QualitySum
from fenicsmech.design.shape.shape_map import LinkImage, LinkParameters, LinkShape, ShapeMap, shape_links
from fenicsmech.design.shape.spline import LinkSpline, SplineSamples
from fenicsmech.meshing import edge_corners, least_stretches, node_ends
from fenicsmech.model import Design, MechanismModel
from fenicsmech.quantities import Gradient
from fenicsmech.simulation import Simulation


@dataclass(frozen=True, eq=False)
class DesignedLink:
    """A link that changes.

    Attributes:
        name: of the link.
        parameters: of its spline, as a function of p.
        spline: its centreline and thickness.
        samples: parameters at which they are bounded.
        thickness: in the plane, where δ = 1; at the samples where it is not the same everywhere.
        bounds: of fabrication.
        centreline: points that the drawn centreline runs through, (k, 2).
        follows: whether it has no parameters of its own.
        images: links that share the shape.
    """

    name: str
    parameters: LinkParameters
    spline: LinkSpline
    samples: SplineSamples
    thickness: float | np.ndarray
    bounds: Bounds
    centreline: np.ndarray
    images: tuple[LinkImage, ...] = ()
    follows: bool = False

    @property
    def entries(self) -> np.ndarray:
        """The entry of p that each component of its control points is, −1 where it is none, (points, 2, 3)."""
        found = np.full(self.spline.controls.shape, -1)
        if not self.follows:
            own = self.spline.entries[self.spline.of_shape]
            found.ravel()[own] = np.arange(self.parameters.place.start, self.parameters.place.stop)
        return found

    @property
    def is_thickness(self) -> np.ndarray:
        """Mask of the thickness parameters among its own entries of p."""
        return np.zeros(0, bool) if self.follows else self.spline.is_thickness[self.spline.of_shape]


_LEAST_STRETCH = 0.1  # least det ∂X/∂X₁ in a cell, X₁ the straight cell; of the drawn shape it is at least 0.3


class ParametricShape:
    """The design of one model.

    Args:
        model: whose links change.
        shapes: handles and weights of these links.
        designs: how they may change.
        numbers: that may change in addition to shapes.

    Attributes:
        links: the links whose shape changes.
        numbers: those that change.
        initial: p of the drawn design, (parameters,).
        lengths: typical change ℓ of each parameter, (parameters,): a link's median thickness; 1 for δ; 0.1 for q.
        of_numbers: the entries q of p.

    Raises:
        DescriptionError: the drawn thickness of a link, or a number, is not within its bounds.
    """

    def __init__(
        self,
        model: MechanismModel,
        shapes: Sequence[LinkShape],
        designs: Sequence[SplineDesign],
        numbers: Sequence[Number] = (),
    ) -> None:
        self._model, design = model, fem.Function(model.elastic.shape.function_space)
        self.numbers = ScaledNumbers(model, numbers)
        own = [s.handles.spline.initial[[] if s.follows else s.handles.spline.of_shape] for s in shapes]
        self.initial = np.concatenate([*own, self.numbers.initial])
        self.of_numbers = slice(len(self.initial) - len(numbers), len(self.initial))
        parameters = [self._parameters(shape, own[:k]) for k, shape in enumerate(shapes)]
        self._map = ShapeMap(model.mesh, design, shapes, parameters, self.initial)
        changed = {piece.link: len(shape.every) for shape in shapes for piece in shape.every}
        self._cells = np.flatnonzero(np.isin(model.mesh.link, list(changed)))
        # the vertices' part, which handles are placed for
        self._straight = fem.Function(vector_space(model.mesh.mesh, 1))
        self._vertex_map = ShapeMap(model.mesh, self._straight, shapes, parameters, self.initial)
        self._ratio = QualitySum(self._straight, comm=model.mesh.comm)
        self._deformable = _deformable(model, changed.keys())
        # a cell of each of the links that share a shape counts as one cell
        self._shares = 1.0 / np.array([changed.get(link, 1) for link in range(len(model.mechanism.flexible_links))])
        self._optimum = HandleOptimum(self._vertex_map, self._ratio)
        ends, dim = node_ends(design.function_space), model.mesh.vertices.shape[1]
        drawn = model.mesh.vertices[ends].mean(axis=1) + model.elastic.drawn_shape.reshape(-1, dim)
        self._middles = MidEdgeNodes(ends, drawn) if model.elastic.order > 1 else None
        self._penalties: dict[Barrier, QualitySum] = {}
        self.links = tuple(
            DesignedLink(
                name=wanted.link.name,
                parameters=own,
                spline=shape.handles.spline,
                samples=SplineSamples(shape.handles.spline),
                thickness=shape.thickness,
                bounds=wanted.bounds(shape.thickness),
                centreline=shape.centreline,
                images=shape.images,
                follows=shape.follows,
            )
            for shape, own, wanted in zip(shapes, parameters, designs, strict=True)
        )
        lengths = [np.where(s.is_thickness, 1.0, np.median(s.thickness)) for s in self.links]
        self.lengths = np.concatenate([*lengths, np.full(len(self.numbers.initial), TYPICAL)])

    def _parameters(self, shape: LinkShape, before: Sequence[np.ndarray]) -> LinkParameters:
        """Parameters of a link's spline, whose own ones follow those ``before``."""
        spline, linkage, first = shape.handles.spline, self._model.linkage, sum(map(len, before))
        matrix, fixed = np.zeros((spline.size, len(self.initial))), spline.initial.copy()
        chosen = np.zeros(0, int) if shape.follows else np.flatnonzero(spline.of_shape)
        matrix[chosen, np.arange(first, first + len(chosen))] = 1.0
        fixed[chosen] = 0.0
        link = self._model.mechanism.flexible_links[shape.own.link]
        sites = shape.handles.site[shape.handles.site != BETWEEN].tolist()  # in order along the spline
        for column, number in enumerate(self.numbers.numbers, start=self.of_numbers.start):
            shifts = joint_shifts(number, link, linkage)[sites]
            if np.any(shifts):
                width = self.numbers.width[column - self.of_numbers.start]
                matrix[:, column] = np.einsum("sja,ja->s", spline.following(), shifts) * width
                fixed -= matrix[:, column] * self.initial[column]
        return LinkParameters(slice(first, first + len(chosen)), fixed, matrix)

    @staticmethod
    def of(simulation: Simulation, designs: Sequence[SplineDesign], numbers: Sequence[Number] = ()) -> ParametricShape:
        """The design of a simulation, handles and weights of its links computed on its mesh."""
        shapes = shape_links(simulation.model.mesh, shape_requests(designs, simulation, numbers))
        return ParametricShape(simulation.model, shapes, designs, numbers)

    def placement_from(self, p: np.ndarray, theta: np.ndarray) -> HandlePlacement | None:
        """A placement to start from, for handle positions found before; None if their number has changed."""
        if theta.shape != self._map.initial_theta.shape:
            return None
        return HandlePlacement(p, theta)

    def handles(self, placement: HandlePlacement) -> list[np.ndarray]:
        """Positions of the handles of each link."""
        return self._map.positions(placement.theta)

    def place(self, p: np.ndarray, near: HandlePlacement | None) -> HandlePlacement:
        """Gives the model the design ``p`` with optimal handles.

        Args:
            p: the design, (parameters,).
            near: placement of a nearby design.

        Raises:
            ShapeError: cells stay inverted however the handles are placed, or curved ones are squeezed, or a number is
                out of its bounds.
        """
        lag = self._lag
        placement = self._optimum.solve(p, near or self._drawn)
        self._model.reshape(self._placed(placement, lag))
        return placement

    def design(self, p: np.ndarray, near: HandlePlacement | None) -> Design:
        """The design ``p``; the model keeps the one it has."""
        lag = self._lag
        return self._placed(self._optimum.solve(p, near or self._drawn), lag)

    @property
    def _drawn(self) -> HandlePlacement:
        return HandlePlacement(self.initial, self._map.initial_theta)

    @cached_property
    def _lag(self) -> np.ndarray:
        """θ*(p₀) − θ₀ of links drawn by an outline, or that follow joints alone, 0 of others, (handles,)."""
        drawn = self._map.initial_theta
        kept = [np.full(len(o.handles), o.follows or np.ndim(o.thickness) > 0) for o in self._map.shapes]
        outlined = np.concatenate([np.zeros(0, bool), *kept])
        if not np.any(outlined):
            return np.zeros_like(drawn)
        return np.where(outlined, self._optimum.solve(self.initial, self._drawn).theta - drawn, 0.0)

    def _placed(self, placement: HandlePlacement, lag: np.ndarray) -> Design:
        """The design of a placement."""
        q = placement.p[self.of_numbers]
        for own, scaled in zip(self.numbers.numbers, q, strict=True):
            if not 0.0 < scaled < 1.0:
                raise ShapeError(str(own), "it is out of its bounds", "Change it by less")
        theta, elastic, mesh = placement.theta - lag, self._model.elastic, self._model.mesh
        field = self._map.field(placement.p, theta)
        if np.any(lag):
            self._straight.x.array[:] = self._vertex_map.field(placement.p, theta).ravel()
            if self._ratio.value() == np.inf:
                raise ShapeError("rest shape", "it inverts cells", "Change it by less, or mesh it finer")
        if self._middles is not None:
            field = self._middles.placed(field)
            bent = field + elastic.drawn_shape.reshape(field.shape)
            corners, pairs = field.shape[1] + 1, edge_corners(field.shape[1] + 1)
            values = bent[cell_dofs(elastic.shape.function_space)[self._cells]]
            bulges = values[:, corners:] - values[:, pairs].mean(axis=2)
            squeezed = least_stretches(mesh.corners(self._cells) + values[:, :corners], bulges[:, ::-1])
            least = mesh.mesh.comm.allreduce(float(squeezed.min(initial=1.0)), op=MPI.MIN)
            if least < _LEAST_STRETCH:
                raise ShapeError("rest shape", "its curved edges squeeze cells", "Change it by less, or mesh it finer")
        return Design(field.ravel(), self.numbers.values(q))

    def widened(self, placement: HandlePlacement) -> HandlePlacement:
        """A placement of the same links with fewer numbers, with the others, and links that follow them, as drawn."""
        p, theta, drawn = placement.p, placement.theta, self._map.initial_theta
        if len(theta) < len(drawn):
            drawn = drawn + self._lag
        return HandlePlacement(np.append(p, self.initial[len(p) :]), np.append(theta, drawn[len(theta) :]))

    def control_rates(self) -> tuple[np.ndarray, ...]:
        """Derivatives of each link's control points by all numbers that change, (points, 2, 3, numbers)."""
        found = []
        for link in self.links:
            spline, rates = link.spline, np.zeros((link.spline.controls.size, len(self.numbers.numbers)))
            rates[spline.entries] = link.parameters.matrix[:, self.of_numbers] / self.numbers.width
            found.append(rates.reshape(*spline.controls.shape, -1))
        return tuple(found)

    def slopes(self, placement: HandlePlacement, gradients: Sequence[Gradient]) -> np.ndarray:
        """dQ/dp of some components at the design placed as in ``placement``, (components, parameters)."""
        fields = np.array([own.design for own in gradients])
        total = self.gradient(placement, fields)
        total[:, self.of_numbers] += self.numbers.slopes(gradients)
        return total

    def gradient(self, placement: HandlePlacement, nodal: np.ndarray) -> np.ndarray:
        """dO/dp of shapes (…, parameters) from ∂O/∂d (…, owned values) of the design placed as in ``placement``."""
        fields = nodal.reshape(*nodal.shape[:-1], self._map.owned, -1)
        theta = placement.theta - self._lag
        if self._middles is not None:
            fields = self._middles.apply_transpose(self._map.field(placement.p, theta), fields)
        by_p, by_theta = self._map.apply_transpose(placement.p, theta, fields)
        return self._optimum.total_gradient(placement, by_p, by_theta)

    def worst_ratio(self) -> float:
        """Largest ρ among the cells of the present rest shape that can deform."""
        self._straight.interpolate(self._model.elastic.shape)
        worst = float(self._ratio.cell_values()[self._deformable].max(initial=0.0))
        return self._model.mesh.mesh.comm.allreduce(worst, op=MPI.MAX)

    def quality_penalty(self, barrier: Barrier, placement: HandlePlacement) -> tuple[float, np.ndarray]:
        """Σ_e β(ρ_e) over the cells of the present rest shape that can deform, and its derivative ∂/∂p."""
        if barrier not in self._penalties:
            counts = self._deformable * self._shares[self._model.mesh.link]
            self._penalties[barrier] = QualitySum(self._straight, barrier.symbolic, counts=counts)
        total = self._penalties[barrier]
        self._straight.interpolate(self._model.elastic.shape)
        value, slope = total.value(), total.gradient()
        by_p, by_theta = self._vertex_map.apply_transpose(placement.p, placement.theta - self._lag, slope)
        by_q = self._model.mesh.comm.allreduce(self._vertex_rates @ slope.ravel(), op=MPI.SUM) * self.numbers.width
        gradient = self._optimum.total_gradient(placement, by_p, by_theta)
        gradient[self.of_numbers] += by_q
        return value, gradient

    @cached_property
    def _vertex_rates(self) -> np.ndarray:
        """∂d/∂v of each number's value v at this rank's owned vertices, flat, (numbers, owned values)."""
        field, vertices = (fem.Function(own.function_space) for own in (self._model.elastic.shape, self._straight))
        rates = np.zeros((len(self.numbers.on_model), len(owned_values(vertices))))
        for row, own in zip(rates, self.numbers.on_model, strict=True):
            field.x.array[:] = own.rate
            vertices.interpolate(field)
            row[:] = owned_values(vertices)
        return rates


def _deformable(model: MechanismModel, links: Set[int]) -> np.ndarray:
    """Mask of the local cells of ``links`` that a design can deform, ghosts last, (cells,).

    Cells with all corners on one interface move as a rigid body, whether it holds them or they lie between cells that
    it holds.
    """
    mesh = model.mesh
    own = original_cells(mesh.mesh)
    corners, held = mesh.cells[own], mesh.interface >= 0
    holder = np.full(len(mesh.vertices), -1)
    # interfaces have no vertex in common; those held by a cell of another process count too
    for cells, numbers in mesh.comm.allgather((corners[held], mesh.interface[held])):
        holder[cells] = numbers[:, None]
    there = holder[corners]
    rigid = (there[:, 0] >= 0) & np.all(there == there[:, :1], axis=1)
    return np.isin(mesh.link, list(links)) & ~rigid
