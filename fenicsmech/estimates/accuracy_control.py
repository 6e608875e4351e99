"""Accuracy control: the cheapest fidelity whose estimated error is below the required one.

Fidelity levels are climbed from a coarse pilot. Errors of elements and of plane stress are estimated after each
(``element_error``, ``plane_stress_error``), and the next level is the first whose expected error suffices, by the
gains of the levels of a model over each other. Gains and work of levels were measured on claw, truss and Klann leg;
they only guide the choice: the estimate on the level itself decides.

Estimates are signed, and so they are added to the results (``Curve.corrected``). The error required to be small
is the one they may leave,

    |error| ≤ l |elements| + l_s |plane stress|,

with l by level (``FidelityLevel.left``) and l_s = ``AccuracyOptions.plane_stress_left``: measured on cantilever, arch,
truss, claw and Klann leg, where what space adds is 0.7 to 1.6 times its estimate, and what finer elements add 0.5 to
1.5 times, but on the coarsest level up to 2.7 times. Source for corrections by adjoints: Pierce & Giles
(doi:10.1137/S0036144598349423).
"""

from __future__ import annotations

import sys
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
from fenicsmech.log import logger
from fenicsmech.mechanism import FlexibleLink, MeshPart, Scene, StepPart
from fenicsmech.meshing import typical_thickness
from fenicsmech.model import Fidelity, check_scene, fits

_log = logger(__name__)


@dataclass(frozen=True)
class AccuracyOptions:
    """Measured constants of error estimates and fidelity levels.

    Attributes:
        plane_stress_left: error left of the plane-stress estimate once it is added, over the estimate.
        left_in_space: of the plane-stress error, what the coarsest level in space leaves.
        caution: factor on the expected error of a level.
        first_order: largest valid estimate over the largest displacement: larger ones, as near limit points, are
            meaningless.
        space_work: time of the coarsest level in space over that in plane stress.
    """

    plane_stress_left: float = 0.6
    left_in_space: float = 0.55
    caution: float = 1.3
    first_order: float = 0.1
    space_work: float = 5.0

    def corrections(self, errors: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Corrections of the values of a curve, from the estimates of their errors, (frames,) each."""
        return np.where(np.abs(errors) > self.first_order * np.abs(values).max(), 0.0, errors)


@dataclass(frozen=True)
class FidelityLevel:
    """One of the fidelities that accuracy control chooses from.

    Attributes:
        model: plane stress, 3D or half of it.
        order: degree of the displacement field.
        size: element size over the thickness of the links.
        layers: through half the depth, in space.
        segments: around pins.
        left: error of the elements that may be left once its estimate is added, over the estimate.
        gain: error of the elements over that of the model's coarsest level.
        work: time over that of the model's coarsest level.
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
        """The level as text."""
        where = self.model.name.replace("-", " ").replace("3d", "3D")
        layers = "1 layer" if self.layers == 1 else f"{self.layers} layers"
        through = "" if self.model is PLANE_STRESS else f", {layers} through half the depth"
        return f"{where} P{self.order}, elements of {self.size:g} thicknesses, {self.segments} around pins{through}"


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


def fidelity_levels(model: ElasticModel) -> list[FidelityLevel]:
    """The levels of a model, from coarse to fine."""
    return [FidelityLevel(model, *rest) for rest in (_PLANAR if model is PLANE_STRESS else _SPATIAL)]


@dataclass(frozen=True)
class LevelErrors:
    """The largest displacement or force of a curve on one level, and the estimates of its errors in the same unit.

    Attributes:
        value: the displacement or force.
        elements: estimated discretisation error.
        plane_stress: estimated error of plane stress; 0 in space.
        unknowns: of the level.
    """

    value: float
    elements: float
    plane_stress: float
    unknowns: int


@dataclass(frozen=True)
class Trial:
    """A level that was tried.

    Attributes:
        level: the fidelity.
        elements: estimated discretisation error over the displacement.
        plane_stress: estimated error of plane stress over the displacement; 0 in space.
        unknowns: of the level.
        seconds: for mesh, curve and estimates.
        options: of the control.
    """

    level: FidelityLevel
    elements: float
    plane_stress: float
    unknowns: int
    seconds: float
    options: AccuracyOptions = AccuracyOptions()

    @property
    def error(self) -> float:
        """Error that may be left once both estimates are added."""
        return self.level.left * abs(self.elements) + self.options.plane_stress_left * abs(self.plane_stress)

    def expected(self, level: FidelityLevel) -> float:
        """The error to be expected of another level."""
        if level.model is self.level.model:
            gain = level.gain / self.level.gain
            return level.left * abs(self.elements) * gain + self.options.plane_stress_left * abs(self.plane_stress)
        in_space = self.options.left_in_space * abs(self.plane_stress) + abs(self.elements) / self.level.gain
        return level.left * in_space * level.gain

    def __str__(self) -> str:
        blocked = f" + {abs(self.plane_stress):.2%} for contraction that pins block"
        return (
            f"{self.level.name} ({self.unknowns} unknowns, {self.seconds:.2g} s): "
            f"error of about {abs(self.elements):.2%} for the elements"
            f"{blocked if self.level.model is PLANE_STRESS else ''}; at most {self.error:.2%} once corrected"
        )


@dataclass(frozen=True)
class Choice:
    """The level that was chosen; prints as plain text.

    Attributes:
        accuracy: required, relative to the largest displacement of the curve.
        trials: levels that were tried, the one chosen last.
        reached: whether the error that may be left is below the accuracy.
        finer: level and time for a tenth of the error, as text.
    """

    accuracy: float
    trials: tuple[Trial, ...]
    reached: bool
    finer: str

    @property
    def chosen(self) -> Trial:
        """The level that the results are of."""
        return self.trials[-1]

    def __str__(self) -> str:
        lines = [f"{self.accuracy:.2g} of the largest displacement asked for"]
        lines += [f"  not enough: {trial}" for trial in self.trials[:-1]]
        lines += [f"  {'chosen' if self.reached else 'the finest there is'}: {self.chosen}"]
        return "\n".join([*lines, f"  ten times the accuracy: {self.finer}"])


class AccuracyControl:
    """The levels of a scene, and the one that was chosen last.

    Args:
        scene: to be simulated.
        accuracy: required relative error.
        thickness: of the links, all or each; None where their shapes have one.
        formulation: which links have the pressure as an unknown.
        options: measured constants.

    Attributes:
        level: the one chosen last; at first the coarsest.

    Raises:
        DescriptionError: the scene cannot be simulated, or the thickness of a link is not known.
    """

    def __init__(
        self,
        scene: Scene,
        accuracy: float,
        thickness: float | Mapping[FlexibleLink, float] | None,
        formulation: Formulation,
        options: AccuracyOptions | None = None,
    ) -> None:
        self._accuracy, self._formulation = positive("accuracy", accuracy), formulation
        self.options = options or AccuracyOptions()
        links = scene.mechanism.flexible_links
        given = thickness if isinstance(thickness, Mapping) else dict.fromkeys(links, thickness)
        self._thickness = {
            link: typical_thickness(link.shape, f"link {link.name!r}")
            if given.get(link) is None
            else positive(f"thickness of {link.name!r}", given[link])
            for link in links
        }
        self._planar = fidelity_levels(PLANE_STRESS) if _fits(scene, PLANE_STRESS) else []
        self._spatial = fidelity_levels(MID_PLANE_SYMMETRIC if _fits(scene, MID_PLANE_SYMMETRIC) else SPATIAL)
        check_scene(scene, self._spatial[0].model)
        self.level = (self._planar or self._spatial)[0]

    def fidelity(self, level: FidelityLevel) -> Fidelity:
        """The fidelity that a level stands for."""
        sizes = {link: level.size * thickness for link, thickness in self._thickness.items()}
        layers = {PLANE_STRESS: None, MID_PLANE_SYMMETRIC: level.layers, SPATIAL: 2 * level.layers}[level.model]
        rule = Quadrature.for_order(level.order, level.model.dim)
        return Fidelity(level.model, level.order, sizes, rule, self._formulation, layers, level.segments)

    def choose(self, run: Callable[[FidelityLevel], LevelErrors]) -> Choice:
        """Tries levels, from the last one on, until one suffices; ``run`` simulates a level."""
        trials: list[Trial] = []
        following: FidelityLevel | None = self.level
        while following is not None:
            self.level, start = following, perf_counter()
            found = run(self.level)
            scale = max(abs(found.value), sys.float_info.min)
            elements, plane_stress = found.elements / scale, found.plane_stress / scale
            spent = perf_counter() - start
            trials.append(Trial(self.level, elements, plane_stress, found.unknowns, spent, self.options))
            _log.info("%s", trials[-1])
            following = self._next(trials[-1])
        reached = trials[-1].error <= self._accuracy
        if not reached:
            _log.warning("accuracy %g: the error of the finest level is about %.2g", self._accuracy, trials[-1].error)
        return Choice(self._accuracy, tuple(trials), reached, self._tenfold(trials[-1]))

    def _next(self, trial: Trial) -> FidelityLevel | None:
        """The first finer level expected to suffice, else the finest; None if no other is needed, or left."""
        finer = [] if trial.error <= self._accuracy else self._finer(trial.level)
        return next((level for level in finer if self._should_do(trial.expected(level))), finer[-1] if finer else None)

    def _tenfold(self, trial: Trial) -> str:
        """Level and time for a tenth of the error, as text."""
        for level in self._finer(trial.level):
            if self._should_do(10.0 * trial.expected(level)):
                leap = self.options.space_work if level.model is not trial.level.model else 1.0
                return f"{level.name}, about {leap * level.work / trial.level.work * trial.seconds:.2g} s"
        return "beyond the finest level; give size=… and order=3, and extrapolate"

    def _should_do(self, error: float) -> bool:
        return self.options.caution * error <= self._accuracy

    def _finer(self, level: FidelityLevel) -> list[FidelityLevel]:
        """Levels above, cheap ones first."""
        if level.model is not PLANE_STRESS:
            return [other for other in self._spatial if other.gain < level.gain]
        return [*(other for other in self._planar if other.gain < level.gain), *self._spatial]


def _fits(scene: Scene, model: ElasticModel) -> bool:
    """Whether the scene can be simulated in ``model``, and its links be meshed for it."""
    if model.half and any(isinstance(link.shape, StepPart | MeshPart) for link in scene.mechanism.flexible_links):
        return False
    return fits(scene, model)
