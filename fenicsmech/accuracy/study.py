"""A work–precision study: every rung of a ladder, beside the limit of the finest in space."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from mpi4py import MPI

from fenicsmech.accuracy.error_split import ErrorSplit, split_error
from fenicsmech.accuracy.extrapolation import Limit, extrapolate
from fenicsmech.accuracy.measurement import Measurement, measure
from fenicsmech.accuracy.quantity import Quantity
from fenicsmech.accuracy.rung import Rung
from fenicsmech.elasticity import SPATIAL, ElasticModel
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import FlexibleLink, Scene
from fenicsmech.report import Progress, Silent

_LONGEST = 60.0  # s
_COST_ORDER = 1.5  # of a direct solver in the number of unknowns of slender links


@dataclass(frozen=True)
class Study:
    """A ladder of fidelities, measured.

    Attributes:
        scene: what was computed.
        quantity: what was read.
        measurements: one per rung, in the order of the ladder.
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
        """The parts of a rung's error; None if it failed, or a limit is missing.

        The limit of half the depth is that of all of it, so that symmetry counts as no modelling error.
        """
        model = measurement.rung.model
        if model is None:
            own = Limit(self.quantity.rigid_value, 0.0, None, 0)
        else:
            own = self.reference if model.symmetric else self.limits.get(model)
        if measurement.value is None or own is None or self.reference is None:
            return None
        return split_error(measurement, self.measurements, own=own, reference=self.reference)


def run_study(
    scene: Scene,
    quantity: Quantity,
    ladder: Sequence[Rung],
    *,
    size: float | Mapping[FlexibleLink, float],
    repeats: int = 3,
    longest: float = _LONGEST,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> Study:
    """Runs every rung of ``ladder`` and finds the limits of the models (collective).

    A rung that fails is recorded with the reason, as is one whose curve would take longer than ``longest`` by the
    next coarser mesh of its family. A model's limit is that of its best known family of one order; the reference is
    the limit in space.

    Args:
        scene: what is computed.
        quantity: what is read.
        ladder: the rungs, families from coarse to fine.
        size: element size at factor 1, or one per flexible link. Where depths are even multiples of it, layers
            through the depth double as it halves, and sequences are even.
        repeats: most curves to time per rung; the median counts.
        longest: seconds that a curve may be expected to take.
        comm: processes that share the work.

    Raises:
        DescriptionError: ``repeats`` is not positive, or the ladder is empty.
    """
    if repeats < 1 or not ladder:
        raise DescriptionError(
            "work–precision study", f"{repeats} repeats of {len(ladder)} rungs", "Give at least one of each"
        )
    done: list[Measurement] = []
    label = f"rungs of {scene.mechanism.name}"
    with Progress(len(ladder), label) if comm.rank == 0 else Silent() as progress:
        for rung in ladder:
            expected = _expected_seconds(rung, done)
            if expected is not None and expected > longest:
                done.append(Measurement(rung, failure=f"left out: about {expected:.0f} s expected for a curve"))
            else:
                done.append(measure(scene, quantity, rung, size=size, repeats=repeats, comm=comm))
            progress.update(len(done), rung.name)
    return Study(scene, quantity, tuple(done), model_limits(done), comm.size)


def model_limits(measurements: Sequence[Measurement]) -> dict[ElasticModel, Limit]:
    """The limit of each elastic model: that of the order whose sequence of meshes is the most certain."""
    families: dict[tuple[ElasticModel, int], list[Measurement]] = {}
    for m in _default_meshes(measurements):
        families.setdefault((m.rung.model, m.rung.order), []).append(m)
    limits: dict[ElasticModel, Limit] = {}
    for (model, _), family in families.items():
        limit = extrapolate([m.spacing for m in family], [m.value for m in family])
        if limit is not None and (model not in limits or limit.uncertainty < limits[model].uncertainty):
            limits[model] = limit
    return limits


def _default_meshes(measurements: Iterable[Measurement]) -> list[Measurement]:
    """Elastic rungs with a value that differ in mesh, model and order only."""
    return [m for m in measurements if m.value is not None and m.rung.model is not None and not m.rung.is_variant]


def _expected_seconds(rung: Rung, done: Sequence[Measurement]) -> float | None:
    """Seconds of a rung's curve, from the finest coarser mesh of its family; None without one."""
    family = [
        m
        for m in _default_meshes(done)
        if m.rung.model is rung.model and m.rung.order == rung.order and m.rung.factor > rung.factor
    ]
    if not family:
        return None
    nearest = min(family, key=lambda m: m.rung.factor)
    return nearest.curve_seconds * (nearest.rung.factor / rung.factor) ** (_COST_ORDER * rung.model.dim)
