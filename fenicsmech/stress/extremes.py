"""Extremes of stress, strain, safety and life as quantities of designs.

A measure v ≥ 0 (``measures``) is taken of the recovered stress at the points of the surface, singular places left out
as in ``frame.peaks``. Its largest value has kinks where its place jumps, and recovery at the links at rest changes its
matrices with the design. Optimisers see

    ‖v̂‖_p = (Σ v̂^p)^(1/p),     max v̂ ≤ ‖v̂‖_p ≤ n^(1/p) max v̂,

v̂ from the recovery in the coordinates of the drawn links (``drawn``). What is missing is among the corrections that are
added before values are compared with targets, so that these hold for max v of the links at rest. Limits are to hold for
smaller elements too: to max v its estimated error (``surface``) is added m times, on the safe side.

Derivatives: with the weights w = ∂Q/∂τ of the samples τ = (σ, F̂, F_e), from the transpose of the recovery,

    ∂Q/∂y = ∂/∂y ∫ w · τ(u, s) dX₀

over the quadrature whose points the samples are, a form. The life of cycles between two equilibria has one by each,
the other held. Source of the norm: P. Duysinx, M. P. Bendsøe, Topology optimization of continuum structures with local
stress constraints (doi:10.1002/(SICI)1097-0207(19981230)43:8<1453::AID-NME480>3.0.CO;2-2).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial, reduce
from typing import TypeVar

import numpy as np
import ufl
from dolfinx import fem

from fenicsmech.collective import from_one, on_one
from fenicsmech.compat import cell_dofs, cell_nodes, compile_expression, evaluate_expression, quadrature_space
from fenicsmech.equilibrium import State
from fenicsmech.errors import DescriptionError, expect, finite, positive, set_fields
from fenicsmech.mechanism import Allowable, FlexibleLink, Material
from fenicsmech.model import MechanismModel
from fenicsmech.quantities import FormValue, Observable, OfLinks, Partial, Sample
from fenicsmech.stress.drawn import FittedStress, SurfaceFit
from fenicsmech.stress.measures import Fatigue, Measure, Strain, Stress, Utilisation
from fenicsmech.stress.peak import StressRecovery
from fenicsmech.stress.recovered import Recovered
from fenicsmech.stress.surface import StressOptions

T = TypeVar("T")

SHARPNESS = 100.0
"""Default p: values within 1 % of the largest one count. With 50 the claw's design takes 40 % more evaluations."""

MARGIN = 2.0
"""Default m: true errors of peaks are below twice the estimated ones (``benchmarks.stress``)."""

_LEAST_SHARE = 1e-12  # of the derivative at the largest value; smaller ones are left out


# -- on a model -----------------------------------------------------------------------------------------------------


class _Samples:
    """τ = (σ, F̂ and, if ``strained``, the elastic part of F) at the samples, and derivatives of ∫ w · τ dX₀.

    Args:
        model: whose links these are.
        strained: whether the elastic part of F counts.
    """

    def __init__(self, model: MechanismModel, strained: bool) -> None:
        self._elastic, self._mesh = model.elastic, model.mesh.mesh
        elastic, dim = model.elastic, model.elastic.model.dim
        whole = elastic.rest_gradient + ufl.grad(elastic.u)
        parts = [ufl.dot(whole, ufl.inv(elastic.drawn_gradient))] + [elastic.elastic_ufl] * strained
        others = [own[i, j] for own in parts for i in range(dim) for j in range(dim)]
        stresses = [[own[i, j] for i in range(3) for j in range(3)] for own in elastic.stresses_ufl]
        self._vectors = [ufl.as_vector([*own, *others]) for own in stresses]
        self._size = 9 + len(others)
        self._weights = fem.Function(quadrature_space(self._mesh, elastic.sample_degree, self._size))
        measure = {"quadrature_degree": elastic.sample_degree}
        terms = [
            ufl.inner(self._weights, own) * term.dx(metadata=measure)
            for own, term in zip(self._vectors, elastic.terms, strict=True)
        ]
        self.states = {f"state {k}": own for k, own in enumerate(elastic.fields)}
        fields = {"design": elastic.shape, **self.states, **elastic.numbers}
        self.form = FormValue(model, sum(terms[1:], start=terms[0]), fields)

    def values(self) -> np.ndarray:
        """τ in this rank's cells, (cells, q, size); zero in those that cannot deform."""
        found = np.zeros((len(cell_nodes(self._mesh)), len(self._elastic.sample_points), self._size))
        for expression, term in zip(self._compiled, self._elastic.terms, strict=True):
            values = evaluate_expression(expression, self._mesh, term.cells)
            found[term.cells] = values.reshape(len(term.cells), *found.shape[1:])
        return found

    def weigh(self, weights: np.ndarray) -> None:
        """Takes the derivatives by τ in this rank's own cells, (own cells, q, size)."""
        # ∫ over a cell is Σ over its points, each times its weight and |det J|
        x, dim = self._mesh.geometry.x[cell_nodes(self._mesh)], self._elastic.model.dim
        determinants = np.abs(np.linalg.det((x[:, 1:] - x[:, :1])[..., :dim]))[: len(weights)]
        shares = weights / (determinants[:, None] * self._elastic.sample_rule[1])[..., None]
        nodal = self._weights.x.array.reshape(-1, self._size)
        nodal[:] = 0.0
        nodal[cell_dofs(self._weights.function_space)[: len(weights)]] = shares

    @cached_property
    def _compiled(self) -> list[fem.Expression]:
        points, comm = self._elastic.sample_points, self._mesh.comm
        return [compile_expression(own, points, comm) for own in self._vectors]


@dataclass(frozen=True, eq=False)
class _Smooth:
    """The quantity of the smooth maximum ‖v‖ of a measure, on one process.

    Attributes:
        value: the quantity.
        fields, links, measure: of which v is made.
        by_values: its derivatives by all v, (facets, p).
    """

    value: float
    fields: FittedStress
    links: np.ndarray
    measure: Measure
    by_values: np.ndarray

    @classmethod
    def of(
        cls, fields: FittedStress, links: np.ndarray, kept: np.ndarray, measure: Measure, sharpness: float
    ) -> _Smooth:
        """That of the points in a mask ``kept`` (facets, p)."""
        v = np.where(kept, np.maximum(measure.values(fields, links), 0.0), 0.0)
        largest = float(v.max())
        if largest > 0.0:
            norm = largest * float(((v / largest) ** sharpness).sum()) ** (1.0 / sharpness)
            # ∂‖v‖/∂v = (v / ‖v‖)^(p − 1)
            shares = (v / norm) ** (sharpness - 1.0)
            shares[shares < _LEAST_SHARE * shares.max()] = 0.0
        else:
            norm, shares = 0.0, np.zeros_like(v)  # all strains are compressive: v has no slope at its end
        value, slope = measure.total(norm)
        return cls(value, fields, links, measure, slope * shares)

    def by_samples(self) -> np.ndarray:
        """Its derivatives by the samples of all cells."""
        return self.fields.transposed(*self.measure.slopes(self.fields, self.links, self.by_values))


class _Extreme(Observable):
    """The quantity of the largest value of a measure on some links of one model, at a state or in a cycle to another.

    Args:
        model: with the links.
        recovery: of its stresses.
        chosen: mask of flexible links, (links,).
        measure: the measure.
        sharpness: p.
        margin: m.
    """

    def __init__(
        self,
        model: MechanismModel,
        recovery: StressRecovery,
        chosen: np.ndarray,
        measure: Measure,
        sharpness: float,
        margin: float,
    ) -> None:
        self._model, self._chosen, self._measure = model, chosen, measure
        self._sharpness, self._margin = sharpness, margin
        self._comm, self._recovery = model.mesh.comm, recovery
        self._samples = _Samples(model, measure.strained)

    def holding(self, other):
        return _Held(self, other)

    def values(self, state, *others):
        found = self._smooth(state, *others)
        return np.array([self._comm.bcast(None if found is None else found.value, root=0)])

    def partials(self, system, state, *others):
        found = self._smooth(state, *others)
        weights = on_one(self._comm, lambda: None if found is None else found.by_samples())
        self._samples.weigh(self._recovery.scattered(weights))
        form = self._samples.form
        return [
            Partial(
                links=np.concatenate([form.slope(name) for name in self._samples.states]),
                design=form.slope("design"),
                per_link={name: form.per_link(name) for name in self._model.elastic.numbers},
            )
        ]

    def smoothing_errors(self, state, *others):
        return np.array([self._true(state, *others)]) - self.values(state, *others)

    def _smooth(self, *states: State) -> _Smooth | None:
        """At a state, or in the cycle from it to another one, on the first process; None elsewhere."""
        fit, surface = self._fit, self._recovery.surface
        with self._model.clock.phase("stress"):
            samples = self._at(states, lambda: self._recovery.gathered(self._samples.values()))

            def find() -> _Smooth:
                assert fit is not None and surface is not None  # on the first process
                links, kept = surface.links[fit.facets], surface.kept[fit.facets]
                own, *others = (fit.of(found) for found in samples if found is not None)
                return _Smooth.of(own, links, kept, self._between(others), self._sharpness)

            return on_one(self._comm, find)

    def _true(self, *states: State) -> float:
        """The quantity of the largest value recovered at the links at rest, on the safe side; arguments as there."""
        surface = self._recovery.surface
        with self._model.clock.phase("stress"):
            fields = self._at(states, lambda: self._recovery.present(strains=self._measure.strained))

            def measured(links: np.ndarray, own: Recovered, *others: Recovered) -> np.ndarray:
                return self._between(others).values(own, links)

            def find() -> float:
                assert surface is not None  # on the first process
                present = [own for own in fields if own is not None]
                counts = surface.kept & self._chosen[surface.links][:, None]
                found = measured(surface.links, *(surface.recovered(own) for own in present))
                values = np.where(counts, np.maximum(found, 0.0), -np.inf)
                facet, point = (int(k) for k in np.unravel_index(np.argmax(values), values.shape))
                error = surface.error(present, facet, point, partial(measured, surface.links[[facet]]))
                return self._measure.total(float(values[facet, point]) + self._margin * error)[0]

            return from_one(self._comm, find)

    def _at(self, states: Sequence[State], find: Callable[[], T]) -> list[T]:
        """What is found at each of some states; the model holds the first of them afterwards."""
        found = []
        for state in states[::-1]:
            self._model.load(state)
            found.append(find())
        return found[::-1]

    def _between(self, others: Sequence[Recovered | FittedStress]) -> Measure:
        """The measure of a cycle to another state, from its fields; the measure itself where there is none."""
        return reduce(lambda measure, other: measure.between(other), others, self._measure)

    @cached_property
    def _fit(self) -> SurfaceFit | None:
        """On the first process; None elsewhere."""
        return self._recovery.drawn_fit(self._chosen)


class _Held(Observable):
    """The extreme of a cycle as a quantity of one of its states, the other held."""

    def __init__(self, cycle: _Extreme, other: State) -> None:
        self._cycle, self._other = cycle, other

    def values(self, state):
        return self._cycle.values(state, self._other)

    def partials(self, system, state):
        return self._cycle.partials(system, state, self._other)

    def smoothing_errors(self, state):
        return self._cycle.smoothing_errors(state, self._other)


# -- quantities -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _ExtremeOfLinks(OfLinks):
    """An extreme at the surface of flexible links; singular places are left out as in ``frame.peaks``.

    Attributes:
        links: a flexible link or several; all of them by default.
        sharpness: p of the smooth maximum that optimisers see (``fenicsmech.stress.extremes``).
        margin: times that the estimated error of recovery counts, on the safe side; 0 for the recovered value itself.
        options: of the recovery; None: those of the simulation.
    """

    sharpness: float = SHARPNESS
    margin: float = MARGIN
    options: StressOptions | None = None
    smoothed = True
    resolution = 1.5e-3  # peaks are known to 1 to 3 %

    def __post_init__(self) -> None:
        super().__post_init__()
        expect(
            f"options of the {self.name}", self.options, StressOptions | None, "StressOptions", "Give StressOptions(…)"
        )
        margin = finite(f"margin of the {self.name}", self.margin)
        if margin < 0.0:
            raise DescriptionError(f"margin of the {self.name}", f"it is {margin:g}", "Give 0 or more")
        set_fields(self, sharpness=positive(f"sharpness of the {self.name}", self.sharpness), margin=margin)

    def on(self, model):
        recovery, chosen = StressRecovery(model, self.options), self.weights(model) > 0.0
        return _Extreme(model, recovery, chosen, self._measure(model.materials), self.sharpness, self.margin)

    @abstractmethod
    def _measure(self, materials: Sequence[Material]) -> Measure:
        """With the materials of all flexible links."""


@dataclass(frozen=True)
class LargestStress(_ExtremeOfLinks):
    """The largest von Mises stress at the surface of flexible links: ``Target(LargestStress(), grasp, at_most=30.0)``.

    It is the largest value of ``frame.peaks``, which leave singular places out, with a margin for its estimated error.

    Attributes:
        links: a flexible link or several; all of them by default.
        sharpness: p of the smooth maximum that optimisers see (``fenicsmech.stress.extremes``).
        margin: times that the estimated error is added, on the safe side; 0 for the recovered value itself.
        options: of the recovery; None: those of the simulation.

    Raises:
        DescriptionError: they are not flexible links, the sharpness is not positive, or the margin is negative.
    """

    what = "largest stress"

    def unit(self, units):
        return units.stress

    def _measure(self, materials):
        return Stress()


@dataclass(frozen=True)
class LargestStrain(_ExtremeOfLinks):
    """The largest principal nominal strain λ₁ − 1 of the elastic deformation at the surface of flexible links.

    It is 0 where every strain is compressive, as in a pressed strip whose Poisson's ratio is negative.

    Attributes:
        links, sharpness, margin, options: as those of ``LargestStress``.

    Raises:
        DescriptionError: as there.
    """

    what = "largest strain"

    def unit(self, units):
        return ""

    def _measure(self, materials):
        return Strain()


@dataclass(frozen=True)
class LeastSafety(_ExtremeOfLinks):
    """The least factor of safety of flexible links: ``Target(LeastSafety(), grasp, at_least=1.5)``.

    That of ``frame.safety``: the allowable stress or strain of a link's material over the largest one at its surface.

    Attributes:
        links: a flexible link or several; by default all whose materials have an allowable.
        sharpness, margin, options: as those of ``LargestStress``.

    Raises:
        DescriptionError: as there; later: a link's material has no allowable stress or strain, or no link is stressed.
    """

    what = "least factor of safety"

    def unit(self, units):
        return ""

    def check_materials(self, materials):
        remedy = "Give Material(…, strength=Strength(yield_stress=…)), or use fm.material(…) of a card that has one"
        _check_known(self, materials, _allowable, "allowable stress or strain", remedy)

    def weights(self, model):
        return super().weights(model) * [_allowable(material) is not None for material in model.materials]

    def _measure(self, materials):
        known = [_allowable(material) for material in materials]
        stresses, strains = (
            np.array([0.0 if own is None or own.is_strain is not kind else 1.0 / own.value for own in known])
            for kind in (False, True)
        )
        return Utilisation(stresses, strains)


@dataclass(frozen=True)
class LeastLife(_ExtremeOfLinks):
    """The decimal logarithm of the fewest cycles to failure between no stress and the sample, by Basquin and Goodman.

        Target(LeastLife(), grasp, at_least=6.0)  # 10⁶ cycles
        Target(LeastLife(since=released), grasp, at_least=6.0)

    With ``since`` cycles are those between two samples, as of ``frame.life(other)``: two loads, or two configurations.
    Compressive mean stress counts as zero, an endurance limit not at all: the line of Basquin goes on. Goodman's line
    goes on along its tangent where the mean stress is within a tenth of the ultimate stress, or above it.

    Attributes:
        links: a flexible link or several; by default all whose materials have an ultimate stress and a line of Basquin.
        sharpness, margin, options: as those of ``LargestStress``.
        since: the other sample of the cycle, its force or configuration another one; by default no stress.

    Raises:
        DescriptionError: as there, or ``since`` is not a sample; later: a link's material lacks one of these, or no
            link is stressed.
    """

    since: Sample | None = None
    what = "least life"

    def __post_init__(self) -> None:
        super().__post_init__()
        expect(self.what, self.since, Sample | None, "a sample", "Give since=Sample(…)")

    @property
    def name(self):
        return super().name if self.since is None else f"{super().name} in cycles from {self.since}"

    def unit(self, units):
        return "decades"

    def check_materials(self, materials):
        _check_known(
            self,
            materials,
            _fatigue,
            "ultimate stress and line of Basquin",
            "Give Material(…, strength=Strength(ultimate_stress=…, fatigue=Basquin(σ_f′, b)))",
        )

    def weights(self, model):
        return super().weights(model) * [_fatigue(material) is not None for material in model.materials]

    def _measure(self, materials):
        known = [_fatigue(material) or (np.nan,) * 3 for material in materials]
        return Fatigue(*np.array(known).T)


def _allowable(material: Material) -> Allowable | None:
    return None if material.strength is None else material.strength.allowable


def _fatigue(material: Material) -> tuple[float, float, float] | None:
    """σ_f′, b and σ_u, if they are known."""
    strength = material.strength
    if strength is None or strength.fatigue is None or strength.ultimate_stress is None:
        return None
    return strength.fatigue.coefficient, strength.fatigue.exponent, strength.ultimate_stress


def _check_known(
    quantity: OfLinks,
    materials: Mapping[FlexibleLink, Material],
    known: Callable[[Material], object],
    missing: str,
    remedy: str,
) -> None:
    """Raises a DescriptionError if materials of links that were named, or of all links, are not ``known``."""
    lacking = [link for link in quantity.chosen(list(materials)) if known(materials[link]) is None]
    if lacking and (quantity.links is not None or len(lacking) == len(materials)):
        names = " and ".join(dict.fromkeys(repr(materials[link].name) for link in lacking))
        raise DescriptionError(quantity.name, f"material {names} has no {missing}", remedy)
