"""A work–precision study: every level of a list, compared with the limit of the finest in space.

With v the value of the level, v* that of the same level with Newton's tolerance at its tightest, f₀ the limit of its
model as meshes are refined, and r the reference, the limit in space:

    v − r  =  (f₀ − r)  +  (v* − f₀)  +  (v − v*)
              modelling    discretisation  algebraic
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from mpi4py import MPI

from fenicsmech.elasticity import SPATIAL, ElasticModel
from fenicsmech.errors import DescriptionError
from fenicsmech.log import Progress
from fenicsmech.mechanism import FlexibleLink, Scene

from .extrapolation import Limit, extrapolate
from .levels import FidelityLevel
from .measurement import Measurement, Quantity, measure

_LONGEST = 60.0  # s
_COST_ORDER = 1.5  # of a direct solver in the number of unknowns of slender links


@dataclass(frozen=True)
class ErrorSplit:
    """Parts of v − r, in the unit of the quantity and with their signs.

    Attributes:
        modelling: of the assumption on the third dimension, or that links are rigid.
        discretisation: of mesh, order and quadrature.
        algebraic: of Newton's tolerance.
    """

    modelling: float
    discretisation: float
    algebraic: float

    @property
    def total(self) -> float:
        """v − r."""
        return self.modelling + self.discretisation + self.algebraic

    @property
    def magnitude(self) -> float:
        """The parts added by magnitude: the error if none of them happens to cancel another."""
        return abs(self.modelling) + abs(self.discretisation) + abs(self.algebraic)


def split_error(
    measurement: Measurement, measurements: Sequence[Measurement], *, own: Limit, reference: Limit
) -> ErrorSplit:
    """The parts of a level's error.

    Args:
        measurement: the level, with a value.
        measurements: the levels, among which the same level with a tighter tolerance is sought.
        own: limit of the level's model.
        reference: limit in space.
    """
    converged = _tightest(measurement, measurements)
    return ErrorSplit(
        modelling=own.value - reference.value,
        discretisation=converged - own.value,
        algebraic=measurement.value - converged,
    )


def _tightest(measurement: Measurement, measurements: Sequence[Measurement]) -> float:
    """The value of the same level at the tightest tolerance of the study."""
    level = measurement.level
    same = [m for m in measurements if m.value is not None and replace(m.level, tolerance=level.tolerance) == level]
    return min([measurement, *same], key=lambda m: m.level.tolerance).value


@dataclass(frozen=True)
class Study:
    """A set of fidelity levels, measured.

    Attributes:
        scene: the mechanism and its effects.
        quantity: of which the values were measured.
        measurements: one per level, in the order of the study.
        limits: of each elastic model as meshes are refined; models with less than two meshes are missing.
        ranks: processes that shared the work.
    """

    scene: Scene
    quantity: Quantity
    measurements: tuple[Measurement, ...]
    limits: Mapping[ElasticModel, Limit]
    ranks: int

    @property
    def reference(self) -> Limit | None:
        """The limit in space; None if there were no two meshes."""
        return self.limits.get(SPATIAL)

    @property
    def uncertainty(self) -> float | None:
        """Of the reference, relative to it."""
        return None if self.reference is None else self.relative(self.reference.uncertainty)

    def relative(self, error: float | None) -> float | None:
        """An error over the reference; None if either is not known."""
        return None if error is None or self.reference is None else error / abs(self.reference.value)

    def split(self, measurement: Measurement) -> ErrorSplit | None:
        """The parts of a level's error; None if it failed, or a limit is missing.

        The limit of half the depth is that of all of it, so that symmetry counts as no modelling error.
        """
        model = measurement.level.model
        if model is None:
            own = Limit(0.0, 0.0, None, 0)
        else:
            own = self.reference if model.half else self.limits.get(model)
        if measurement.value is None or own is None or self.reference is None:
            return None
        return split_error(measurement, self.measurements, own=own, reference=self.reference)


def run_study(
    scene: Scene,
    quantity: Quantity,
    levels: Sequence[FidelityLevel],
    *,
    size: float | Mapping[FlexibleLink, float],
    repeats: int = 3,
    longest: float = _LONGEST,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Study:
    """Runs every level of ``levels`` and finds the limits of the models.

    A level that fails is recorded with the reason, as is one whose curve would take longer than ``longest`` by the
    next coarser mesh of its sequence. A model's limit is that of its best known sequence of one order; the reference is
    the limit in space.

    Args:
        scene: the mechanism and its effects.
        quantity: of which the values are measured.
        levels: the levels, sequences from coarse to fine.
        size: element size at factor 1, or one per flexible link. Where depths are even multiples of it, layers
            through the depth double as it halves, and sequences are even.
        repeats: maximum number of curves to time per level; the median counts.
        longest: seconds that a curve may be expected to take.
        comm: processes that share the work.

    Raises:
        DescriptionError: ``repeats`` is not positive, or there are no levels.
    """
    if repeats < 1 or not levels:
        raise DescriptionError(
            "work–precision study", f"{repeats} repeats of {len(levels)} levels", "Give at least one of each"
        )
    done: list[Measurement] = []
    label = f"levels of {scene.mechanism.name}"
    with Progress(len(levels), label, shown=comm.rank == 0) as progress:
        for level in levels:
            expected = _expected_seconds(level, done)
            if expected is not None and expected > longest:
                done.append(Measurement(level, failure=f"left out: about {expected:.0f} s expected for a curve"))
            else:
                done.append(measure(scene, quantity, level, size=size, repeats=repeats, comm=comm))
            progress.update(len(done), level.name)
    return Study(scene, quantity, tuple(done), model_limits(done), comm.size)


def model_limits(measurements: Sequence[Measurement]) -> dict[ElasticModel, Limit]:
    """The limit of each elastic model: that of the order whose sequence of meshes is the most certain."""
    sequences: dict[tuple[ElasticModel, int], list[Measurement]] = {}
    for m in _default_meshes(measurements):
        sequences.setdefault((m.level.model, m.level.order), []).append(m)
    limits: dict[ElasticModel, Limit] = {}
    for (model, _), sequence in sequences.items():
        limit = extrapolate([m.spacing for m in sequence], [m.value for m in sequence])
        if limit is not None and (model not in limits or limit.uncertainty < limits[model].uncertainty):
            limits[model] = limit
    return limits


def _default_meshes(measurements: Iterable[Measurement]) -> list[Measurement]:
    """Elastic levels with a value that differ in mesh, model and order only."""
    return [m for m in measurements if m.value is not None and m.level.model is not None and not m.level.is_variant]


def _expected_seconds(level: FidelityLevel, done: Sequence[Measurement]) -> float | None:
    """Seconds of a level's curve, from the finest coarser mesh of its sequence; None without one."""
    sequence = [
        m
        for m in _default_meshes(done)
        if m.level.model is level.model and m.level.order == level.order and m.level.factor > level.factor
    ]
    if not sequence:
        return None
    nearest = min(sequence, key=lambda m: m.level.factor)
    return nearest.curve_seconds * (nearest.level.factor / level.factor) ** (_COST_ORDER * level.model.dim)
