"""Accuracy control: the cheapest fidelity whose estimated error is below the required one.

Fidelity levels are tried upwards from a coarse pilot. Errors of elements and of plane stress are estimated after each
(``estimates``), and the next level is the first whose error, expected from the measured gains of levels over each
other, is small enough. Gains and work of levels were measured on claw, truss and Klann leg; they only guide the search:
the estimate on the level itself decides.

Estimates are signed, and so they are added to the results (``Curve.corrected``). The error required to be small
is the one they may leave,

    |error| ≤ r |elements| + r_s |plane stress|,

with r by level (``FidelityLevel.remainder``) and r_s = ``AccuracyOptions.plane_stress_remainder``: measured on
cantilever, arch, truss, claw and Klann leg, by finer elements and in 3D. Source for corrections by adjoints: Pierce
& Giles (doi:10.1137/S0036144598349423).
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from time import perf_counter

import numpy as np
from mpi4py import MPI

from fenicsmech.collective import from_one
from fenicsmech.elasticity import MID_PLANE_SYMMETRIC, PLANE_STRESS, SPATIAL, ElasticModel, Formulation, Quadrature
from fenicsmech.errors import counted, positive, set_options
from fenicsmech.log import logger
from fenicsmech.mechanism import FlexibleLink, Scene
from fenicsmech.meshing import link_thickness
from fenicsmech.model import Fidelity, check_scene, fits, per_link, spatial_model

_log = logger(__name__)


@dataclass(frozen=True)
class AccuracyOptions:
    """Measured constants of error estimates and fidelity levels.

    Attributes:
        plane_stress_remainder: error that remains once the plane-stress estimate is added, over the estimate.
        remainder_in_space: the part of the plane-stress error that the coarsest level in space leaves.
        safety: factor on the expected error of a level.
        first_order: largest valid estimate over the largest displacement: larger ones, as near limit points, are
            meaningless.
        space_work: time of the coarsest level in space over that in plane stress.

    Raises:
        DescriptionError: a number is not positive.
    """

    plane_stress_remainder: float = 0.6
    remainder_in_space: float = 0.55
    safety: float = 1.3
    first_order: float = 0.1
    space_work: float = 5.0

    def __post_init__(self) -> None:
        set_options(self, "accuracy control")

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
        remainder: error of the elements that may remain once its estimate is added, over the estimate.
        gain: error of the elements over that of the model's coarsest level.
        work: time over that of the model's coarsest level.
    """

    model: ElasticModel
    order: int
    size: float
    layers: int
    segments: int
    remainder: float
    gain: float
    work: float

    @property
    def name(self) -> str:
        """The level as text."""
        where = self.model.name.replace("-", " ").replace("3d", "3D")
        through = "" if self.model is PLANE_STRESS else f", {counted(self.layers, 'layer')} through half the depth"
        return f"{where} P{self.order}, elements of {self.size:g} thicknesses, {self.segments} around pins{through}"


def fidelity_levels(model: ElasticModel) -> list[FidelityLevel]:
    """The levels of a model, from coarse to fine."""
    planar = (
        (2, 2.5, 1, 8, 1.7, 1.0, 1.0),
        (2, 1.3, 1, 8, 0.6, 0.55, 1.2),
        (3, 2.5, 1, 8, 0.6, 0.15, 2.0),
        (3, 0.8, 1, 16, 0.6, 0.03, 5.0),
    )
    spatial = (
        (2, 2.5, 1, 8, 0.6, 1.0, 1.0),
        (3, 2.5, 1, 8, 0.6, 0.11, 5.0),
        (3, 2.5, 1, 16, 0.6, 0.055, 9.0),
        (3, 2.5, 2, 16, 0.6, 0.03, 20.0),
        (3, 1.2, 2, 24, 0.6, 0.02, 45.0),
    )
    return [FidelityLevel(model, *rest) for rest in (planar if model is PLANE_STRESS else spatial)]


@dataclass(frozen=True)
class LevelErrors:
    """The largest displacement or force of a curve on one level, and the estimates of its errors in the same unit.

    Attributes:
        value: the displacement or force.
        elements: estimated discretisation error.
        plane_stress: estimated error of plane stress; 0 in space.
        unknowns: of the level.
        growth: of the value with each halving of the elements, without limit, under forces at points of flexible links.
    """

    value: float
    elements: float
    plane_stress: float
    unknowns: int
    growth: float = 0.0


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
        """Error that may remain once both estimates are added."""
        return self.expected(self.level)

    def expected(self, level: FidelityLevel) -> float:
        """The error to be expected of another level."""
        elements, plane_stress = abs(self.elements), abs(self.plane_stress)
        if level.model is self.level.model:
            elements *= level.gain / self.level.gain
            return level.remainder * elements + self.options.plane_stress_remainder * plane_stress
        in_space = self.options.remainder_in_space * plane_stress + elements / self.level.gain
        return level.remainder * in_space * level.gain

    def __str__(self) -> str:
        left_out = f" + {abs(self.plane_stress):.2%} for plane stress"
        return (
            f"{self.level.name} ({self.unknowns} unknowns, {self.seconds:.2g} s): "
            f"error of about {abs(self.elements):.2%} for the elements"
            f"{left_out if self.level.model is PLANE_STRESS else ''}; at most {self.error:.2%} once corrected"
        )


@dataclass(frozen=True)
class Choice:
    """The level that was chosen; prints as plain text.

    Attributes:
        accuracy: required, relative to the largest displacement of the curve.
        trials: levels that were tried, the one chosen last.
        reached: whether the error that may remain is below the accuracy.
        finer: level and time for a tenth of the error, as text.
        cause: why no elements are fine enough; empty if there is no such cause.
    """

    accuracy: float
    trials: tuple[Trial, ...]
    reached: bool
    finer: str
    cause: str = ""

    @property
    def chosen(self) -> Trial:
        """The level that the results are of."""
        return self.trials[-1]

    def __str__(self) -> str:
        lines = [f"{self.accuracy:.2g} of the largest displacement requested"]
        lines += [f"  not enough: {trial}" for trial in self.trials[:-1]]
        if self.cause:
            return "\n".join([*lines, f"  no finer one helps: {self.chosen}", f"  cause: {self.cause}"])
        lines += [f"  {'chosen' if self.reached else 'the finest there is'}: {self.chosen}"]
        return "\n".join([*lines, f"  ten times the accuracy: {self.finer}"])


class AccuracyControl:
    """The levels of a scene for a required relative error, and the ``level`` chosen last; at first the coarsest.

    The ``thickness`` is that of all links or of each; None where their shapes have one. STEP files are measured on the
    first process.

    Raises:
        DescriptionError: the scene cannot be simulated, or a link is a mesh, and its thickness is not given.
        MeshingError: a file cannot be read.
    """

    def __init__(
        self,
        scene: Scene,
        accuracy: float,
        thickness: float | Mapping[FlexibleLink, float] | None,
        formulation: Formulation,
        options: AccuracyOptions | None = None,
        comm: MPI.Comm = MPI.COMM_SELF,
    ) -> None:
        self._accuracy, self._formulation = positive("accuracy", accuracy), formulation
        self.options = options or AccuracyOptions()
        links = scene.mechanism.flexible_links
        self._thickness = {
            link: from_one(comm, partial(link_thickness, link.name, link.shape))
            if given is None
            else positive(f"thickness of {link.name!r}", given)
            for link, given in per_link(scene.mechanism, thickness).items()
        }
        self._planar = fidelity_levels(PLANE_STRESS) if fits(scene, PLANE_STRESS) else []
        self._spatial = fidelity_levels(spatial_model(scene, [link.shape for link in links]))
        check_scene(scene, self._spatial[0].model)
        self.level = (self._planar or self._spatial)[0]

    def fidelity(self, level: FidelityLevel) -> Fidelity:
        """The fidelity that a level stands for."""
        sizes = {link: level.size * thickness for link, thickness in self._thickness.items()}
        layers = {PLANE_STRESS: None, MID_PLANE_SYMMETRIC: level.layers, SPATIAL: 2 * level.layers}[level.model]
        rule = Quadrature.for_order(level.order, level.model.dim)
        return Fidelity(level.model, level.order, sizes, rule, self._formulation, layers, level.segments)

    def choose(self, run: Callable[[FidelityLevel], LevelErrors], cause: str = "") -> Choice:
        """Tries levels, from the last one on, until one suffices; ``run`` simulates a level.

        No level suffices where each halving of the elements adds more than the accuracy: the first is kept, for this
        ``cause``.
        """
        trials: list[Trial] = []
        level: FidelityLevel | None = self.level
        while level is not None:
            self.level, start = level, perf_counter()
            found = run(level)
            scale = max(abs(found.value), sys.float_info.min)
            errors, seconds = (found.elements / scale, found.plane_stress / scale), perf_counter() - start
            trials.append(Trial(level, *errors, found.unknowns, seconds, self.options))
            _log.info("%s", trials[-1])
            growth = abs(found.growth) / scale
            if growth > self._accuracy:
                _log.warning("accuracy %g: %s (each halving adds %.2g)", self._accuracy, cause, growth)
                return Choice(self._accuracy, tuple(trials), False, "beyond any level", cause)
            level = self._next(trials[-1])
        reached = trials[-1].error <= self._accuracy
        if not reached:
            _log.warning("accuracy %g: the error of the finest level is about %.2g", self._accuracy, trials[-1].error)
        return Choice(self._accuracy, tuple(trials), reached, self._tenfold(trials[-1]))

    def _next(self, trial: Trial) -> FidelityLevel | None:
        """The first finer level expected to suffice, else the finest; None if none is needed or there is none."""
        finer = [] if trial.error <= self._accuracy else self._finer(trial.level)
        return next((level for level in finer if self._suffices(trial.expected(level))), finer[-1] if finer else None)

    def _tenfold(self, trial: Trial) -> str:
        """Level and time for a tenth of the error, as text."""
        for level in self._finer(trial.level):
            if self._suffices(10.0 * trial.expected(level)):
                work = level.work * (1.0 if level.model is trial.level.model else self.options.space_work)
                return f"{level.name}, about {work / trial.level.work * trial.seconds:.2g} s"
        return "beyond the finest level; give size=… and order=3, and extrapolate"

    def _suffices(self, error: float) -> bool:
        return self.options.safety * error <= self._accuracy

    def _finer(self, level: FidelityLevel) -> list[FidelityLevel]:
        """Levels above, cheap ones first."""
        planar = level.model is PLANE_STRESS
        finer = [other for other in (self._planar if planar else self._spatial) if other.gain < level.gain]
        return finer + self._spatial if planar else finer
