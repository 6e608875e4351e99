"""Pressure on the boundary of a flexible link: it stays normal to the boundary and grows with its area.

    V = (p / dim) ∫ (x − x₀) · n da,     δV = p ∫ δx · n da + a term at the rim,

p times the volume that the boundary encloses with a point x₀. Closed boundaries have no rim, and x₀ plays no part. The
term at the rim of an open one vanishes

- where the rim is held,
- in the plane, where its ends move along lines through x₀, as on an axis of symmetry,
- in space, where it moves within planes through x₀ that it lies in, as on a plane of symmetry.

The sides of extruded links, as the bore of a hole, end at rims that move along z. Their x₀ is an axis along z, and

    V = (p / 2) ∫∫ ((x − x₀) × ∂x/∂s) · e_z ds dZ,     δV = p ∫∫ (δx × ∂x/∂s) · e_z ds dZ + the term of the plane,

p times the areas that the sections enclose, over the depth Z at rest: pressure acts within the plane, on no face across
z. What it leaves out, p times the strain along z and the slope of sides that tilt, is of second order in the load.

With other rims the load has no potential: its work depends on the path.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem

from fenicsmech.effects.link_fields import Faces
from fenicsmech.errors import DescriptionError, expect, finite, point, set_fields
from fenicsmech.mechanism import Effect, FlexibleLink, in_dimension


@dataclass(frozen=True)
class Pressure(Effect):
    """A fluid that presses on a flexible link.

    Attributes:
        link: the link.
        pressure: into the link; negative for suction.
        where: predicate of points on the drawn boundary, (n, dim) → (n,) bool; a facet belongs to the part if it holds
            at all its corners. None: the whole boundary.
        about: x₀; required for an open part, whose rim must be held or move as above. In space two coordinates are an
            axis along z, for holes through extruded links, and their sides.

    Raises:
        DescriptionError: a number is invalid, or the link is not flexible. Later, when it is meshed: the part is
            open without a point to go ``about``, or empty, or aslant to the axis.
    """

    link: FlexibleLink
    pressure: float
    where: Callable[[np.ndarray], np.ndarray] | None = None
    about: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        expect("pressure", self.link, FlexibleLink, "a flexible link", "Give a flexible link of the mechanism")
        set_fields(self, pressure=finite(f"pressure on {self.link.name!r}", self.pressure))
        if self.about is not None:
            set_fields(self, about=point(f"centre of the pressure on {self.link.name!r}", self.about))

    def explain(self):
        part = "the whole boundary" if self.where is None else "part of the boundary"
        return f"pressure of {self.pressure:g} on {part} of {self.link.name}"

    @property
    def faces(self):
        return (Faces(self.link, self.where),)

    @property
    def pressure_across_depth(self):
        return {self.link: self.pressure} if self.where is None else {}

    def turns_with(self, link):
        return link is not self.link or self.about is None  # the volume within a closed part

    def link_energy(self, fields):
        (faces,) = self.faces
        if self.about is None and not fields.boundaries[faces].is_closed(fields.mesh.comm):
            raise DescriptionError(
                f"pressure on {self.link.name!r}",
                "the part it acts on is open: its load has an energy only if the rim is held",
                "Hold the rim and give about=…, or press on a closed part",
            )
        if fields.body.model.half and self.about is not None and in_dimension(self.about, 3)[2] != 0.0:
            raise DescriptionError(
                f"pressure on {self.link.name!r}",
                f"the point {self.about} of its potential is not on the mid-plane",
                "Give about=… with two coordinates or z = 0, or use space='3d'",
            )
        dim, order = fields.dim, fields.order
        centre = (0.0,) * dim if self.about is None else self.about[:dim]
        along = len(centre)
        if along < dim and not fields.boundaries[faces].is_extruded(fields.mesh.comm):
            raise DescriptionError(
                f"pressure on {self.link.name!r}",
                f"about={centre} is an axis along z, and some of the facets it acts on are aslant to it",
                "Give about=… with three coordinates, or a predicate of the sides alone",
            )
        pressure = fem.Constant(fields.mesh, self.pressure / along)
        start = fem.Constant(fields.mesh, np.array(centre))
        arm = [fields.position[k] - start[k] for k in range(along)] + [0.0] * (dim - along)
        # x has the degree of u, n da its (dim − 1)th power one degree lower
        degree = order + (dim - 1) * (order - 1)
        return fields.flux(pressure * ufl.as_vector(arm), faces, degree=degree, within_plane=along < dim)
