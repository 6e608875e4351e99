"""The dial: the cheapest fidelity whose estimated error is below what is asked for.

Rungs are climbed from a coarse pilot. Errors of elements and of plane stress are estimated after each (``goal_error``,
``depth_error``), and the next rung is the first that these let expect to do, by the gains that rungs of a family have
over each other. Gains and work of rungs were measured on claw, truss and Klann leg; they only tell where to look: what
counts is the estimate on the rung itself.

Estimates are signed, and so they are added to the results (``Curve.corrections``). What is asked to be small is what
they may leave,

    |error| ≤ l |elements| + 0.6 |depth|,

with l by rung (``Rung.left``): measured on cantilever, arch, truss, claw and Klann leg, where what space adds is 0.7 to
1.6 times its estimate, and what finer elements add 0.5 to 1.5 times, but on the coarsest rung up to 2.7 times. Source
for corrections by adjoints: Pierce & Giles (doi:10.1137/S0036144598349423).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from fenicsmech.checks import positive
from fenicsmech.elasticity import (
    MID_PLANE_SYMMETRIC,
    PLANE_STRESS,
    SPATIAL,
    ElasticModel,
    Formulation,
    Quadrature,
)
from fenicsmech.errors import DescriptionError
from fenicsmech.log import logger
from fenicsmech.mechanism import FlexibleLink, MeshPart, Scene, StepPart
from fenicsmech.meshing import typical_thickness
from fenicsmech.simulation.fidelity import Fidelity, check_scene, fits

_log = logger(__name__)
_LEFT_OF_DEPTH = 0.6  # of what space is estimated to add, once it is added
_CAUTION = 1.3  # on what a rung is expected to do
_FIRST_ORDER = 0.1  # of the largest displacement: larger estimates, as near limit points, mean nothing
_LEFT_IN_SPACE = 0.55  # of the plane-stress error: what the coarsest rung in space leaves of it


def refuse_beside_accuracy(**given: object) -> None:
    """Refuses what says how finely to compute, by name, beside an accuracy that is to decide that.

    Raises:
        DescriptionError: one of ``given`` is not None.
    """
    for name, value in given.items():
        if value is not None:
            raise DescriptionError(
                f"accuracy and {name}",
                f"both are given, and {name}={value!r} would decide what accuracy is to choose",
                f"Leave out {name}, or give {name} and size=… instead of an accuracy",
            )


@dataclass(frozen=True)
class Rung:
    """A fidelity on the dial.

    Attributes:
        model: plane stress, 3D or half of it.
        order: degree of the displacement field.
        size: element size over the thickness of the links.
        layers: through half the depth, in space.
        segments: around pins.
        left: what may be left of the error of the elements once its estimate is added, over the estimate.
        gain: error of the elements over that of the family's coarsest rung.
        work: time over that of the family's coarsest rung.
    """

    model: ElasticModel
    order: int
    size: float
    layers: int
    segments: int
    left: float
    gain: float
    work: float

    @property
    def name(self) -> str:
        """In words."""
        where = self.model.name.replace("-", " ").replace("3d", "3D")
        layers = "1 layer" if self.layers == 1 else f"{self.layers} layers"
        through = "" if self.model is PLANE_STRESS else f", {layers} through half the depth"
        return f"{where} P{self.order}, elements of {self.size:g} thicknesses, {self.segments} around pins{through}"


_SPACE_WORK = 5.0  # time of the coarsest rung in space over that in plane stress
_PLANAR = (
    (2, 2.5, 1, 8, 1.7, 1.0, 1.0),
    (2, 1.3, 1, 8, 0.6, 0.55, 1.2),
    (3, 2.5, 1, 8, 0.6, 0.15, 2.0),
    (3, 0.8, 1, 16, 0.6, 0.03, 5.0),
)
_SPATIAL = (
    (2, 2.5, 1, 8, 0.6, 1.0, 1.0),
    (3, 2.5, 1, 8, 0.6, 0.11, 5.0),
    (3, 2.5, 1, 16, 0.6, 0.055, 9.0),
    (3, 2.5, 2, 16, 0.6, 0.03, 20.0),
    (3, 1.2, 2, 24, 0.6, 0.02, 45.0),
)


def family(model: ElasticModel) -> list[Rung]:
    """The rungs of a model, from coarse to fine."""
    return [Rung(model, *rest) for rest in (_PLANAR if model is PLANE_STRESS else _SPATIAL)]


@dataclass(frozen=True)
class Trial:
    """A rung that was tried.

    Attributes:
        rung: the fidelity.
        elements: estimate of what finer elements would add, over the displacement.
        depth: estimate of what space would add to plane stress, over the displacement; 0 in space.
        unknowns: of the rung.
        seconds: for mesh, curve and estimates.
    """

    rung: Rung
    elements: float
    depth: float
    unknowns: int
    seconds: float

    @property
    def error(self) -> float:
        """What may be left once both estimates are added."""
        return _left(self.rung, self.elements, self.depth)

    def __str__(self) -> str:
        depth = f" + {abs(self.depth):.2%} for contraction that pins block" if self.rung.model is PLANE_STRESS else ""
        return (
            f"{self.rung.name} ({self.unknowns} unknowns, {self.seconds:.2g} s): "
            f"error of about {abs(self.elements):.2%} for the elements{depth}; at most {self.error:.2%} once corrected"
        )


@dataclass(frozen=True)
class Choice:
    """What the dial chose; prints as plain text.

    Attributes:
        accuracy: asked for, relative to the largest displacement of the curve.
        trials: rungs that were tried, the one chosen last.
        reached: whether what may be left of its error is below the accuracy.
        finer: what ten times the accuracy would take, in words.
    """

    accuracy: float
    trials: tuple[Trial, ...]
    reached: bool
    finer: str

    @property
    def chosen(self) -> Trial:
        """The rung that the results are of."""
        return self.trials[-1]

    def __str__(self) -> str:
        lines = [f"{self.accuracy:.2g} of the largest displacement asked for"]
        lines += [f"  not enough: {trial}" for trial in self.trials[:-1]]
        lines += [f"  {'chosen' if self.reached else 'the finest there is'}: {self.chosen}"]
        return "\n".join([*lines, f"  ten times the accuracy: {self.finer}"])


@dataclass(frozen=True)
class Outcome:
    """What a rung gives: a displacement or force, and the estimates of its errors in the same unit."""

    value: float
    elements: float
    depth: float
    unknowns: int


class Dial:
    """The rungs of a scene, and the one that was chosen last.

    Args:
        scene: what is simulated.
        accuracy: relative error that is asked for.
        thickness: of the links, all or each; None where their shapes tell.
        formulation: which links are in the u–p (mixed) formulation.

    Raises:
        DescriptionError: the scene cannot be simulated, or the thickness of a link is not known.
    """

    def __init__(
        self,
        scene: Scene,
        accuracy: float,
        thickness: float | Mapping[FlexibleLink, float] | None,
        formulation: Formulation,
    ) -> None:
        self._accuracy, self._formulation = accuracy, formulation
        links = scene.mechanism.flexible_links
        given = thickness if isinstance(thickness, Mapping) else dict.fromkeys(links, thickness)
        self._thickness = {
            link: typical_thickness(link.shape, f"link {link.name!r}")
            if given.get(link) is None
            else positive(f"thickness of {link.name!r}", given[link])
            for link in links
        }
        self._planar = family(PLANE_STRESS) if _fits(scene, PLANE_STRESS) else []
        self._spatial = family(MID_PLANE_SYMMETRIC if _fits(scene, MID_PLANE_SYMMETRIC) else SPATIAL)
        check_scene(scene, self._spatial[0].model)
        self.rung = (self._planar or self._spatial)[0]

    def fidelity(self, rung: Rung) -> Fidelity:
        """The fidelity that a rung stands for."""
        sizes = {link: rung.size * thickness for link, thickness in self._thickness.items()}
        layers = {PLANE_STRESS: None, MID_PLANE_SYMMETRIC: rung.layers, SPATIAL: 2 * rung.layers}[rung.model]
        rule = Quadrature.for_order(rung.order, rung.model.dim)
        return Fidelity(rung.model, rung.order, sizes, rule, self._formulation, layers, rung.segments)

    def settle(self, run: Callable[[Rung], Outcome]) -> Choice:
        """Tries rungs, from the last one on, until one will do; ``run`` simulates a rung (collective)."""
        trials: list[Trial] = []
        following: Rung | None = self.rung
        while following is not None:
            self.rung, start = following, perf_counter()
            outcome = run(self.rung)
            scale = max(abs(outcome.value), np.finfo(float).tiny)
            elements, depth = outcome.elements / scale, outcome.depth / scale
            trials.append(Trial(self.rung, elements, depth, outcome.unknowns, perf_counter() - start))
            _log.info("%s", trials[-1])
            following = self._next(trials[-1])
        reached = self._does(trials[-1].error)
        if not reached:
            _log.warning("accuracy %g: the error of the finest rung is about %.2g", self._accuracy, trials[-1].error)
        return Choice(self._accuracy, tuple(trials), reached, self._tenfold(trials[-1]))

    def _does(self, error: float) -> bool:
        return error <= self._accuracy

    def _should_do(self, error: float) -> bool:
        return _CAUTION * error <= self._accuracy

    def _next(self, trial: Trial) -> Rung | None:
        """The first finer rung that should do, the finest if none should; None if no other is needed, or left."""
        finer = [] if self._does(trial.error) else self._finer(trial.rung)
        return next((rung for rung in finer if self._should_do(expected(trial, rung))), finer[-1] if finer else None)

    def _tenfold(self, trial: Trial) -> str:
        """What a tenth of the error would take."""
        for rung in self._finer(trial.rung):
            if self._should_do(10.0 * expected(trial, rung)):
                leap = _SPACE_WORK if rung.model is not trial.rung.model else 1.0
                return f"{rung.name}, about {leap * rung.work / trial.rung.work * trial.seconds:.2g} s"
        return "beyond the finest rung; give size=… and order=3, and extrapolate"

    def _finer(self, rung: Rung) -> list[Rung]:
        """Rungs above, cheap ones first."""
        if rung.model is not PLANE_STRESS:
            return [other for other in self._spatial if other.gain < rung.gain]
        return [*(other for other in self._planar if other.gain < rung.gain), *self._spatial]


def expected(trial: Trial, rung: Rung) -> float:
    """The error to be expected of ``rung``, from that of another."""
    if rung.model is trial.rung.model:
        return _left(rung, trial.elements * rung.gain / trial.rung.gain, trial.depth)
    return _left(rung, (_LEFT_IN_SPACE * abs(trial.depth) + abs(trial.elements) / trial.rung.gain) * rung.gain, 0.0)


def corrections(errors: np.ndarray, values: np.ndarray) -> tuple[float, ...]:
    """What to add to the values of a curve, from the estimates of their errors, (frames,) each."""
    return tuple(np.where(np.abs(errors) > _FIRST_ORDER * np.abs(values).max(), 0.0, errors).tolist())


def _left(rung: Rung, elements: float, depth: float) -> float:
    """What estimates on a rung may leave of its error once they are added."""
    return rung.left * abs(elements) + _LEFT_OF_DEPTH * abs(depth)


def _fits(scene: Scene, model: ElasticModel) -> bool:
    """Whether the scene can be simulated in ``model``, and its links be meshed for it."""
    if model.symmetric and any(isinstance(link.shape, StepPart | MeshPart) for link in scene.mechanism.flexible_links):
        return False
    return fits(scene, model)
