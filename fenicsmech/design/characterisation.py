"""Young's modulus, and other parameters of a material, from measured forces and displacements.

Displacements u_k(E) of specimens under the measured forces are fitted to the measured ū_k by Gauss–Newton on ln E:

    min Σ_k ((u_k(E) − ū_k) / s_k)²,     s_k the largest |ū| of the specimen's measurements,

which is maximum likelihood if forces are exact and displacements are read with independent normal errors of one size
relative to each specimen's range. With the residuals' standard deviation σ and J = ∂(u/s)/∂ln E from the adjoint,

    standard error of ln E = σ / |J|,     interval  E exp(± t σ / |J|),     t Student's quantile for n − 1.

Other parameters of its law, θ, are fitted likewise, without the logarithm, and have the intervals of ``regression``.

Source: Seber & Wild, Nonlinear Regression (doi:10.1002/0471725315), chapters 2 and 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from fenicsmech.design.regression import regression
from fenicsmech.equilibrium import LoadControl, State
from fenicsmech.errors import DescriptionError, EquilibriumError, counted, finite, set_fields, set_options
from fenicsmech.mechanism import DRAWN, Configuration, Force, Material
from fenicsmech.quantities import Displacement, LawParameter, Observable, Sensitivity
from fenicsmech.simulation import Curve, CurveRequest, Simulation, read_request


@dataclass(frozen=True, eq=False)
class Experiment:
    """Measurements on one specimen.

    Attributes:
        simulation: of the specimen in its test rig.
        part: the force that was applied.
        forces: its magnitudes, (n,).
        displacements: of the force's point along its direction, (n,).
        configuration: motor positions.

    Raises:
        DescriptionError: there are not as many forces as displacements, a number is not finite, no force moves
            anything, or the simulation belongs to another design.
    """

    simulation: Simulation
    part: Force
    forces: Sequence[float]
    displacements: Sequence[float]
    configuration: Configuration = DRAWN

    def __post_init__(self) -> None:
        part = f"measurements of {self.simulation.scene.mechanism.name!r}"
        self.simulation.check_drawn(part)
        forces = np.array([finite(f"force among the {part}", value) for value in self.forces])
        displacements = np.array([finite(f"displacement among the {part}", value) for value in self.displacements])
        if len(forces) != len(displacements):
            raise DescriptionError(
                part,
                f"{counted(len(forces), 'force')} for {counted(len(displacements), 'displacement')}",
                "Give one of each per reading",
            )
        if not np.any(forces * displacements):
            raise DescriptionError(part, "no force moves anything", "Give readings under load")
        set_fields(self, forces=forces, displacements=displacements)

    @property
    def request(self) -> CurveRequest:
        """The curve through all measured forces, from the smallest to the largest."""
        request = read_request(
            self.simulation.scene.mechanism,
            self.part,
            forces=self.forces,
            displacements=None,
            configuration=self.configuration,
            others=None,
        )
        loads = sorted({control.prescribed for control in request.controls}, key=abs)
        return CurveRequest(request.part, tuple(map(LoadControl, loads)), request.configuration, request.others)


@dataclass(frozen=True)
class ModulusFit:
    """Young's modulus fitted to experiments.

    Attributes:
        youngs_modulus: E.
        standard_error: of E.
        interval: the 95 % confidence interval of E.
        spread: standard deviation of the residuals, relative to each specimen's largest displacement.
        curves: simulated at the fitted modulus, one per experiment.
        residuals: simulated minus measured displacement, per experiment.
        iterations: of Gauss–Newton.
        material: the one given, with the fitted modulus, as ``Simulation.with_material`` takes it.
    """

    youngs_modulus: float
    standard_error: float
    interval: tuple[float, float]
    spread: float
    curves: tuple[Curve, ...]
    residuals: tuple[tuple[float, ...], ...]
    iterations: int
    material: Material


def fit_modulus(experiments: Sequence[Experiment], material: Material) -> ModulusFit:
    """Young's modulus of ``material``; the experiments' simulations stay as they are.

    Args:
        experiments: measurements, at least two readings in all.
        material: that of some links; its modulus is the initial guess.

    Raises:
        DescriptionError: no link of an experiment is of this material, or there are fewer than two readings.
        EquilibriumError: a measured force is not reached in simulation, or no modulus fits best.
    """
    rigs = [_Rig(experiment, material) for experiment in experiments]
    readings = sum(len(experiment.forces) for experiment in experiments)
    if readings < 2:
        raise DescriptionError(
            f"modulus of {material.name!r}", counted(readings, "reading"), "Give two or more: an interval needs them"
        )
    log_modulus, iterations, step = float(np.log(material.law.parameters["E"])), 0, np.inf
    while True:
        at = _compare(rigs, np.exp([log_modulus]))
        curves, residuals, scaled, J = at.curves, at.residuals, at.scaled, np.exp(log_modulus) * at.slopes[:, 0]
        if abs(step) <= 1e-6:
            break
        if iterations == 30:
            raise EquilibriumError(
                f"modulus of {material.name!r}",
                f"at {np.exp(log_modulus):.4g} its logarithm still changes by {step:.2g} in iteration {iterations}",
                "Give readings that depend on it, with displacements along the force",
            )
        step = float(np.clip(-(J @ scaled) / (J @ J), -1.0, 1.0))  # far from the minimum, by a factor of e at most
        log_modulus += step
        iterations += 1
    spread = float(np.sqrt(scaled @ scaled / (readings - 1)))
    error, modulus = spread / float(np.linalg.norm(J)), float(np.exp(log_modulus))
    reach = float(student.ppf(0.975, readings - 1)) * error
    return ModulusFit(
        youngs_modulus=modulus,
        standard_error=modulus * error,
        interval=(modulus * float(np.exp(-reach)), modulus * float(np.exp(reach))),
        spread=spread,
        curves=tuple(curves),
        residuals=tuple(tuple(r.tolist()) for r in residuals),
        iterations=iterations,
        material=_with_modulus(material, modulus),
    )


@dataclass(frozen=True)
class ParameterFitOptions:
    """Options of ``fit_parameters``.

    Attributes:
        evaluations: of all curves, at most.
        tolerance: relative change of the parameters, and of the sum of squares, at which the search ends.
        confidence: probability of intervals.
    """

    evaluations: int = 50
    tolerance: float = 1e-8
    confidence: float = 0.95

    def __post_init__(self) -> None:
        set_options(self, "the fit of parameters", below_one=("confidence",), evaluations=1)


@dataclass(frozen=True)
class ParameterFit:
    """Parameters of a material's law fitted to experiments.

    Attributes:
        material: the one given, with the fitted parameters, as ``Simulation.with_material`` takes it.
        standard_errors: of each fitted parameter, by its name in ``Law.parameters``.
        intervals: confidence interval of each.
        spread: standard deviation of the residuals, relative to each specimen's largest displacement.
        curves: simulated with the fitted parameters, one per experiment.
        residuals: simulated minus measured displacement, per experiment.
    """

    material: Material
    standard_errors: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    spread: float
    curves: tuple[Curve, ...]
    residuals: tuple[tuple[float, ...], ...]

    @property
    def values(self) -> dict[str, float]:
        """Each fitted parameter by its name."""
        return {name: self.material.law.parameters[name] for name in self.intervals}


_OPTIONS = ParameterFitOptions()


def fit_parameters(
    experiments: Sequence[Experiment],
    material: Material,
    names: Sequence[str],
    *,
    options: ParameterFitOptions = _OPTIONS,
) -> ParameterFit:
    """Parameters of the law of ``material``; the experiments' simulations stay as they are.

    Args:
        experiments: measurements, at least one reading more than parameters in all.
        material: that of some links; its parameters are the initial guess.
        names: those of ``material.law.constants`` that are fitted; the others keep their values.

    Raises:
        DescriptionError: an unknown or repeated name, no link of an experiment is of this material, there are too few
            readings, or these do not determine a parameter.
        EquilibriumError: a measured force is not reached with the initial guess, or no parameters fit best.
    """
    what, names, known = f"parameters of {material.name!r}", tuple(names), material.law.constants
    unknown = [name for name in names if name not in known]
    if unknown or len(set(names)) < len(names) or not names:
        problem = f"there is no {unknown[0]!r}" if unknown else f"the names are {', '.join(names) or 'missing'}"
        raise DescriptionError(what, problem, f"Give some of {', '.join(known)}, each once")
    readings = sum(len(experiment.forces) for experiment in experiments)
    if readings <= len(names):
        problem = f"{counted(readings, 'reading')} for {counted(len(names), 'parameter')}"
        raise DescriptionError(what, problem, "Give more readings than parameters: intervals need them")
    rigs = [_Rig(experiment, material, names) for experiment in experiments]
    start = np.array([known[name] for name in names])
    last: list[tuple[bytes, _Comparison]] = []

    def compare(x: np.ndarray) -> _Comparison:
        if not last or last[0][0] != x.tobytes():
            last[:] = [(x.tobytes(), _compare(rigs, x))]
        return last[0][1]

    def residuals(x: np.ndarray) -> np.ndarray:
        # where there is no such law, or no equilibrium, the search takes shorter steps
        try:
            _with(material, dict(zip(names, x.tolist(), strict=True)))
            return compare(x).scaled
        except (DescriptionError, EquilibriumError):
            return np.full(readings, np.nan)

    compare(start)  # raises what the guess does not reach
    found = least_squares(
        residuals,
        start,
        lambda x: compare(x).slopes,
        x_scale="jac",
        xtol=options.tolerance,
        ftol=options.tolerance,
        gtol=None,
        max_nfev=options.evaluations,
    )
    if found.status == 0:
        problem = f"after {found.nfev} evaluations they still change"
        raise EquilibriumError(what, problem, "Give readings that depend on them, or a guess nearer to them")
    best = compare(found.x)
    of = regression(what, names, found.x, best.scaled, best.slopes, options.confidence)
    return ParameterFit(
        material=_with(material, dict(zip(names, found.x.tolist(), strict=True))),
        standard_errors=of.standard_errors,
        intervals=of.intervals,
        spread=of.spread,
        curves=best.curves,
        residuals=tuple(tuple(r.tolist()) for r in best.residuals),
    )


@dataclass(frozen=True)
class _Comparison:
    """Curves, u − ū of each, and all (u − ū) / s (n,) with their slopes (n, p)."""

    curves: tuple[Curve, ...]
    residuals: tuple[np.ndarray, ...]
    scaled: np.ndarray
    slopes: np.ndarray


def _compare(rigs: Sequence[_Rig], values: np.ndarray) -> _Comparison:
    curves, residuals, slopes = zip(*(rig.compare(*values.tolist()) for rig in rigs), strict=True)
    scaled = np.concatenate([r / rig.range for r, rig in zip(residuals, rigs, strict=True)])
    return _Comparison(
        curves, residuals, scaled, np.concatenate([s / rig.range for s, rig in zip(slopes, rigs, strict=True)])
    )


def _with(material: Material, values: dict[str, float]) -> Material:
    law = material.law.with_parameters({**material.law.parameters, **values})
    return replace(material, law=replace(law))  # runs its checks


def _with_modulus(material: Material, modulus: float) -> Material:
    return replace(material, law=material.law.with_parameters({**material.law.parameters, "E": modulus}))


class _Rig:
    """One experiment in a simulation of its own, in which parameters of a law change."""

    def __init__(self, experiment: Experiment, material: Material, names: Sequence[str] = ("E",)) -> None:
        self._experiment, self._request = experiment, experiment.request
        self._simulation = experiment.simulation.with_material(material, material)
        model = self._simulation.model
        links = zip(model.mechanism.flexible_links, model.materials, strict=True)
        changed = [link for link, made_of in links if made_of == material]
        kinds = [LawParameter(name, *changed) for name in names]
        self._numbers, self._adjoint = [model.number(kind) for kind in kinds], Sensitivity(model, kinds)
        self.range = float(np.abs(experiment.displacements).max())

    def compare(self, *values: float) -> tuple[Curve, np.ndarray, np.ndarray]:
        """The curve at these parameters θ, u − ū (n,) and ∂u/∂θ (n, p)."""
        simulation, part = self._simulation, self._request.part
        assert isinstance(part, Force), "experiments prescribe forces"
        model, solver = simulation.model, simulation.solver(part)
        for number, value in zip(self._numbers, values, strict=True):
            number.set(value)
        curve = simulation.compute(self._request)
        travel: list[Observable] = [Displacement(part).on(model)]

        def slope_of(state: State, force: float) -> np.ndarray:
            (gradient,) = self._adjoint.gradients(solver, state, LoadControl(force), travel)
            return np.array(gradient.numbers, dtype=float)

        # displacements count from the unloaded configuration, which changes unless it is a rigid assembly
        unloaded: np.ndarray | float = slope_of(curve.unloaded, 0.0) if curve.unloaded.has_reactions else 0.0
        slopes, travels = {}, {}
        for frame in curve.frames:
            travels[frame.force] = frame.displacement
            slopes[frame.force] = slope_of(frame.state, frame.force) - unloaded
        measured = self._experiment
        reached, slope = (np.array([values[force] for force in measured.forces]) for values in (travels, slopes))
        return curve, reached - measured.displacements, slope
