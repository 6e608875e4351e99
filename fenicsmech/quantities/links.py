"""Quantities of links: strain energy, and at rest mass, volume and length.

    E = ∫ W dV,     V = ∫ det(∇X) b dX₀,     m = ρ V,     L = L₀ + Σ (|ΔX| − |ΔX₀|)

The sums run over chords between points of the drawn centreline, which the design carries along. The centreline of a
link that is known by its outline is the line that halves its chords.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import ufl
from dolfinx import fem

from fenicsmech.collective import from_one
from fenicsmech.errors import DescriptionError, expect, points, positive, set_fields
from fenicsmech.mechanism import Centreline, FlexibleLink, Strip
from fenicsmech.meshing import LinkOutline, find_centreline, link_outline
from fenicsmech.model import MechanismModel, plan_sites
from fenicsmech.quantities.quantity import FormValue, Observable, Partial, Quantity, RestObservable

_CHORDS = 48  # of a centreline: their length is in error by 1e-4 at most, and its change with the design by less


@dataclass(frozen=True)
class OfLinks(Quantity):
    """A number of flexible links together; of all of them by default."""

    links: FlexibleLink | Sequence[FlexibleLink] | None = None
    what: ClassVar[str]

    def __post_init__(self) -> None:
        if self.links is None:
            return
        chosen = (self.links,) if isinstance(self.links, FlexibleLink) else self.links
        if not isinstance(chosen, Sequence) or not chosen or not all(isinstance(c, FlexibleLink) for c in chosen):
            raise DescriptionError(self.what, f"{self.links!r} are not flexible links", "Give flexible links, or none")
        set_fields(self, links=tuple(chosen))

    @property
    def name(self):
        return f"{self.what} of {'all links' if self.links is None else ', '.join(repr(o.name) for o in self.links)}"

    def weights(self, model: MechanismModel) -> np.ndarray:
        """One for the links that count, else zero, (links,)."""
        everyone = model.mechanism.flexible_links
        return np.array([float(link in self.chosen(everyone)) for link in everyone])

    def chosen(self, everyone: Sequence[FlexibleLink]) -> Sequence[FlexibleLink]:
        """Those of ``everyone`` that count."""
        return everyone if self.links is None else self.links  # type: ignore[return-value]  # a tuple by now


@dataclass(frozen=True)
class StrainEnergy(OfLinks):
    """The elastic energy of flexible links.

    Attributes:
        links: a flexible link or several; all of them by default.

    Raises:
        DescriptionError: they are not flexible links.
    """

    what = "strain energy"

    def unit(self, units):
        return f"{units.force} {units.length}"

    def on(self, model):
        elastic = model.elastic
        share = elastic.cellwise(self.weights(model))
        terms = [share * density * dx for density, dx in elastic.densities(elastic.gradient(elastic.u))]
        return _Form(model, sum(terms[1:], start=terms[0]), elastic.fields)


@dataclass(frozen=True)
class LinkVolume(OfLinks):
    """The volume of flexible links at rest.

    Attributes:
        links: a flexible link or several; all of them by default.

    Raises:
        DescriptionError: they are not flexible links.
    """

    what = "volume"
    of_state = False

    def unit(self, units):
        return f"{units.length}³"

    def on(self, model):
        fields = model.fields
        return _RestForm(model, fields.integral(fields.cellwise(self.weights(model)), degree=0))


@dataclass(frozen=True)
class LinkMass(LinkVolume):
    """The mass of flexible links.

    Attributes:
        links: a flexible link or several; all of them by default.
        density: mass per volume; by default that of each link's material.

    Raises:
        DescriptionError: they are not flexible links, or the density is not positive.
    """

    density: float | None = None
    what = "mass"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.density is not None:
            set_fields(self, density=positive(f"density of the {self.name}", self.density))

    def unit(self, units):
        return f"{units.force} s²/{units.length}"

    def check_materials(self, materials):
        for link in self.chosen(list(materials)):
            if self.density is None and materials[link].density is None:
                raise DescriptionError(
                    self.name,
                    f"the density of {materials[link].name!r} is not known",
                    "Give the material its density=…, or density=… here",
                )

    def weights(self, model):
        return super().weights(model) * [self.density or material.density or 0.0 for material in model.materials]


class _Form(Observable):
    """A form in the shape, numbers and some ``states`` of the links."""

    def __init__(self, model: MechanismModel, form: ufl.Form, states: Sequence[fem.Function] = ()) -> None:
        self._numbers, self._states = dict(model.elastic.numbers), {f"state {k}": own for k, own in enumerate(states)}
        self._form = FormValue(model, form, {"design": model.elastic.shape, **self._states, **self._numbers})

    def value(self) -> float:
        return self._form.value()

    def slope(self) -> Partial:
        links = [self._form.slope(name) for name in self._states]
        return Partial(
            links=np.concatenate(links) if links else 0.0,
            design=self._form.slope("design"),
            per_link={name: self._form.per_link(name) for name in self._numbers},
        )

    def values(self, state):
        return np.array([self.value()])

    def partials(self, system, state):
        return [self.slope()]


class _RestForm(_Form, RestObservable):
    """The same of links at rest."""


@dataclass(frozen=True)
class CentrelineLength(Quantity):
    """The length of a flexible link along its centreline, at rest.

    Attributes:
        link: the link.
        centreline: drawn points it runs through; by default that of a strip, and of other links the line that halves
            the chords of their outline, from joint to joint, or on to free ends.

    Raises:
        DescriptionError: this is not a flexible link; later: no line halves the chords of its outline.
    """

    link: FlexibleLink
    centreline: Sequence[Sequence[float]] | None = None
    of_state = False

    def of_part(self, links):
        return self.centreline is None or self.link not in links  # a given one is that of the drawn link

    def __post_init__(self) -> None:
        expect("length of a link", self.link, FlexibleLink, "a flexible link", "Give a flexible link of the mechanism")
        given = self.centreline
        if given is None and isinstance(self.link.shape, Strip):
            given = self.link.shape.centreline
        if given is not None:
            set_fields(self, centreline=points(self.name, given, least=2, dimensions=(2,)))

    @property
    def name(self):
        return f"length of {self.link.name!r}"

    def unit(self, units):
        return units.length

    def on(self, model):
        return _Chords(model, self)


def _found(model: MechanismModel, link: FlexibleLink, part: str) -> np.ndarray:
    """Points of the line that halves the chords of a link's outline, (n, 2)."""
    shape, dim = model.shapes[model.mechanism.flexible_links.index(link)], model.linkage.dim

    def search() -> np.ndarray:
        sites = plan_sites(model.linkage, link)
        outline = LinkOutline(link_outline(link.name, shape, dim=dim), sites)
        return find_centreline(outline, [site.reach for site in sites], part=part)

    return from_one(model.mesh.comm, search)


class _Chords(RestObservable):
    """The length of a chain of points that the design carries along."""

    def __init__(self, model: MechanismModel, length: CentrelineLength) -> None:
        through = length.centreline
        curve = Centreline(_found(model, length.link, length.name) if through is None else through, part=length.name)
        drawn = curve.evaluate(np.linspace(0.0, curve.end, _CHORDS + 1))
        if through is None:
            # it may end on the outline, beyond the chords of the mesh, and runs through holes for pins in interfaces
            drawn = curve.evaluate(np.linspace(1e-3 * curve.end, 0.999 * curve.end, _CHORDS + 1))
            for site in plan_sites(model.linkage, length.link):
                drawn = drawn[np.linalg.norm(drawn - site.centre[:2], axis=1) > site.reach]
        self._model, self._drawn = model, drawn
        self._weights = model.design_weights(length.name, length.link, drawn)  # (points, owned nodes)
        self._rest = curve.length - float(np.linalg.norm(np.diff(drawn, axis=0), axis=1).sum())

    def value(self):
        return self._rest + float(np.linalg.norm(self._chords(), axis=1).sum())

    def slope(self):
        chords, own = self._chords(), self._weights
        along = chords / np.linalg.norm(chords, axis=1, keepdims=True)
        ends = np.zeros_like(self._drawn)
        ends[1:] += along
        ends[:-1] -= along
        nodal = np.zeros((own.shape[1], self._model.elastic.model.dim))
        nodal[:, :2] = own.T @ ends
        return Partial(design=nodal.ravel())

    def _chords(self) -> np.ndarray:
        """ΔX, (chords, 2)."""
        elastic, own = self._model.elastic, self._weights
        design = elastic.design.reshape(-1, elastic.model.dim)[: own.shape[1], :2]
        moved = self._model.mesh.comm.allreduce(own @ design)
        return np.diff(self._drawn + moved, axis=0)
