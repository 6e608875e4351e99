"""Parameters of materials from measured forces and displacements of mechanisms, and from tests of specimens.

Displacements u_k(θ) under the measured forces are fitted to the measured ū_k by least squares,

    min Σ_k ((u_k(θ) − ū_k) / s_k)²,     s_k the size of the displacement's error, up to a factor that all share,

which is maximum likelihood if forces are exact and displacements have independent normal errors of these sizes. Where a
curve falls or snaps through, one force belongs to several displacements, and u_k jumps as a limit point passes it with
θ: there forces f_k(θ) at the measured displacements are fitted likewise. Tests of specimens add the residuals of
``law_fit``. Slopes are those of the adjoint; with the unloaded configuration y°, from which displacements count, and
the controlled displacement v = ū + q(y°),

    d(u − q(y°))/dθ = dq/dθ − dq(y°)/dθ,     df/dθ = ∂f/∂θ + ∂f/∂v dq(y°)/dθ.

Young's modulus alone is fitted by Gauss–Newton on ln E. With the residuals' standard deviation σ and J = ∂(u/s)/∂ln E,

    standard error of ln E = σ / |J|,     interval  E exp(± t σ / |J|),     t Student's quantile for n − 1.

Other parameters are fitted without the logarithm, and have the intervals of ``regression``.

Source: Seber & Wild, Nonlinear Regression (doi:10.1002/0471725315), chapters 2 and 5.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares
from scipy.stats import t as student

from fenicsmech.collective import agreed
from fenicsmech.design.law_fit import SpecimenTest
from fenicsmech.design.regression import error_sizes, regression
from fenicsmech.elasticity import Specimen
from fenicsmech.equilibrium import Control, DisplacementControl, LoadControl, State, Unknown
from fenicsmech.errors import DescriptionError, EquilibriumError, counted, expect, finite, set_fields, set_options
from fenicsmech.files import column, read_csv
from fenicsmech.laws import Law
from fenicsmech.mechanism import DRAWN, Configuration, Force, Material
from fenicsmech.quantities import Displacement, ForceMagnitude, Gradient, LawParameter, Observable, Sensitivity
from fenicsmech.simulation import Curve, CurveRequest, Simulation, read_request


@dataclass(frozen=True, eq=False)
class Experiment:
    """Measurements on one mechanism, or on a specimen in its test rig.

    Readings above zero and those below belong to two runs, each from zero to the farthest: a part that snaps under push
    starts anew under pull.

    Attributes:
        simulation: of it.
        part: the force that was applied.
        forces: its magnitudes, (n,).
        displacements: of the force's point along its direction, (n,).
        configuration: motor positions.
        unknown: what is compared: displacements under the measured forces, or forces at the measured displacements,
            which curves that fall or snap through need.
        errors: size of the errors of what is compared, one or (n,), up to a factor common to all experiments and
            tests; None: the largest of its measured values, so that experiments count alike.

    Raises:
        DescriptionError: the simulation or the part is something else, there are not as many forces as displacements, a
            number is not finite, no force moves anything, an error is not positive, or the simulation belongs to
            another design.
    """

    simulation: Simulation
    part: Force
    forces: NDArray[np.float64]
    displacements: NDArray[np.float64]
    configuration: Configuration = DRAWN
    unknown: Unknown = Unknown.DISPLACEMENT
    errors: Any = None

    def __post_init__(self) -> None:
        expect(
            "measurements", self.simulation, Simulation, "a simulation", "Give fm.Simulation(…) of what was measured"
        )
        part = f"measurements of {self.simulation.scene.mechanism.name!r}"
        self.simulation.check_drawn(part)
        expect(part, self.part, Force, "a force", "Give the force that was applied")
        expect(part, self.unknown, Unknown, "what is compared", "Give Unknown.DISPLACEMENT or Unknown.FORCE")
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
        set_fields(self, errors=error_sizes(part, self.errors, self.measured))

    @classmethod
    def read(
        cls,
        simulation: Simulation,
        part: Force,
        path: str | Path,
        *,
        configuration: Configuration = DRAWN,
        unknown: Unknown = Unknown.DISPLACEMENT,
        errors: ArrayLike | None = None,
    ) -> Experiment:
        """The measurements in a CSV file, as ``read_csv`` takes it, such as one of ``curve.write_csv``. *Local.*

        Args:
            path: with one column whose header begins with "force" and one that begins with "displacement"; units may
                follow, those of the scene: "force [N]".

        Raises:
            DescriptionError: no such columns, or what ``Experiment`` refuses.
            OSError: the file cannot be read.
        """
        table, what = read_csv(path), f"measurements in '{path}'"
        forces, displacements = (table[column(what, table, name)] for name in ("force", "displacement"))
        return cls(simulation, part, forces, displacements, configuration, unknown, errors)

    @property
    def measured(self) -> np.ndarray:
        """The values that are compared, (n,)."""
        return self.displacements if self.unknown is Unknown.DISPLACEMENT else self.forces

    @property
    def prescribed(self) -> np.ndarray:
        """The values at which they are compared, (n,)."""
        return self.forces if self.unknown is Unknown.DISPLACEMENT else self.displacements

    @property
    def requests(self) -> tuple[CurveRequest, ...]:
        """The curves through all prescribed values: from zero upwards, then from zero downwards if some are below."""
        values = sorted(set(self.prescribed.tolist()), key=abs)
        runs = [value for value in values if value >= 0.0], [value for value in values if value < 0.0]
        by_force = self.unknown is Unknown.DISPLACEMENT
        return tuple(
            read_request(
                self.simulation.scene.mechanism,
                self.part,
                forces=run if by_force else None,
                displacements=None if by_force else run,
                configuration=self.configuration,
                others=None,
            )
            for run in runs
            if run
        )


@dataclass(frozen=True)
class ModulusFit:
    """Young's modulus fitted to experiments.

    Attributes:
        youngs_modulus: E.
        standard_error: of E.
        interval: the 95 % confidence interval of E.
        spread: standard deviation of the residuals relative to the experiments' ``errors``.
        curves: simulated at the fitted modulus, one per experiment, or two where readings are on both sides of zero.
        residuals: simulated minus measured displacement, or force, per experiment.
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


_Parameter = tuple[Material, str]
"""One of the parameters that change: whose, and its name in ``Law.constants``."""


def fit_modulus(experiments: Sequence[Experiment], material: Material) -> ModulusFit:
    """Young's modulus of ``material``; the experiments' simulations stay as they are.

    Args:
        experiments: measurements, at least two readings in all.
        material: that of some links; its modulus is the initial guess.

    Raises:
        DescriptionError: no link of an experiment is of this material, or there are fewer than two readings.
        EquilibriumError: a measured force or displacement is not reached in simulation, or no modulus fits best.
    """
    parameters = [(material, "E")]
    rigs = [_Rig(experiment, parameters) for experiment in experiments]
    readings = sum(len(experiment.forces) for experiment in experiments)
    if readings < 2:
        raise DescriptionError(
            f"modulus of {material.name!r}", counted(readings, "reading"), "Give two or more: an interval needs them"
        )
    log_modulus, iterations, step = float(np.log(material.law.parameters["E"])), 0, np.inf
    while True:
        at = _compare(rigs, np.exp([log_modulus]))
        scaled, J = at.scaled, np.exp(log_modulus) * at.slopes[:, 0]
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
        curves=at.curves,
        residuals=at.residuals,
        iterations=iterations,
        material=_fitted(parameters, np.array([modulus]))[material],
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
    """Parameters of materials' laws fitted to experiments and tests.

    Attributes:
        materials: by each one given, that with the fitted parameters, as ``Simulation.with_material`` takes it.
        standard_errors: of each fitted parameter, by the material given and by name in ``Law.parameters``.
        intervals: confidence interval of each.
        spread: standard deviation of the residuals relative to the ``errors`` of experiments and tests.
        curves: simulated with the fitted parameters, one per experiment, or two where readings are on both sides of
            zero.
        residuals: simulated minus measured displacement or force, per experiment; then stress of the law minus
            measured stress, per test, in the order of materials.
    """

    materials: Mapping[Material, Material]
    standard_errors: Mapping[Material, Mapping[str, float]]
    intervals: Mapping[Material, Mapping[str, tuple[float, float]]]
    spread: float
    curves: tuple[Curve, ...]
    residuals: tuple[tuple[float, ...], ...]

    @property
    def values(self) -> dict[Material, dict[str, float]]:
        """Each fitted parameter, by the material given and by name."""
        return {
            given: {name: fitted.law.parameters[name] for name in self.intervals[given]}
            for given, fitted in self.materials.items()
        }


_OPTIONS = ParameterFitOptions()


def fit_parameters(
    experiments: Sequence[Experiment],
    parameters: Mapping[Material, Sequence[str]],
    *,
    tests: Mapping[Material, Sequence[SpecimenTest]] | None = None,
    options: ParameterFitOptions = _OPTIONS,
) -> ParameterFit:
    """Parameters of the laws of some materials; the experiments' simulations stay as they are.

    Args:
        experiments: measurements; with the tests at least one reading more than parameters in all.
        parameters: names of ``material.law.constants`` that are fitted, by materials of links or of tests; their
            values are the initial guess, and the others are kept.
        tests: of specimens of these materials.

    Raises:
        DescriptionError: an unknown or repeated name, a material that no link of the experiments and no test is of, an
            experiment without any of the materials, two materials of one name, too few readings, or readings that do
            not determine a parameter.
        EquilibriumError: a measured force or displacement is not reached with the initial guess, or no parameters fit
            best.
    """
    what, wanted = _read(parameters)
    tested = [(material, test) for material, own in (tests or {}).items() for test in own]
    for _, test in tested:
        expect(what, test, SpecimenTest, "a test of a specimen", "Give SpecimenTest(kind, stretches, stresses)")
    readings = sum(len(own.forces) for own in experiments) + sum(len(test.stresses) for _, test in tested)
    if readings <= len(wanted):
        problem = f"{counted(readings, 'reading')} for {counted(len(wanted), 'parameter')}"
        raise DescriptionError(what, problem, "Give more readings than parameters: intervals need them")
    sources: list[_Rig | _TestedSpecimen] = [
        *(_Rig(experiment, wanted) for experiment in experiments),
        *(_TestedSpecimen(test, material, wanted) for material, test in tested),
    ]
    concerned = {k for source in sources for k in source.concerned}
    for k, (material, _) in enumerate(wanted):
        if k not in concerned:
            problem = f"no link of an experiment, and no test, is of {material.name!r}"
            raise DescriptionError(what, problem, "Leave it out, or give readings of it")
    start = np.array([material.law.parameters[name] for material, name in wanted])
    last: list[tuple[bytes, _Comparison]] = []

    def compare(x: np.ndarray) -> _Comparison:
        if not last or last[0][0] != x.tobytes():
            last[:] = [(x.tobytes(), _compare(sources, x))]
        return last[0][1]

    def residuals(x: np.ndarray) -> np.ndarray:
        # where there is no such law, or no equilibrium, the search takes shorter steps
        try:
            _fitted(wanted, x)
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
    names = [f"{name} of {material.name!r}" for material, name in wanted]
    of = regression(what, names, found.x, best.scaled, best.slopes, options.confidence)

    def by_material(values: Iterable[Any]) -> dict[Material, dict[str, Any]]:
        sorted_out: dict[Material, dict[str, Any]] = {material: {} for material in parameters}
        for (material, name), value in zip(wanted, values, strict=True):
            sorted_out[material][name] = value
        return sorted_out

    return ParameterFit(
        materials=_fitted(wanted, found.x),
        standard_errors=by_material(of.standard_errors.values()),
        intervals=by_material(of.intervals.values()),
        spread=of.spread,
        curves=best.curves,
        residuals=best.residuals,
    )


def _read(parameters: Mapping[Material, Sequence[str]]) -> tuple[str, list[_Parameter]]:
    """What the parameters are called in messages, and each of them."""
    remedy = "Give names by material: {material: ['E']}"
    if not isinstance(parameters, Mapping) or not parameters:
        raise DescriptionError("parameters of a fit", f"they are {parameters!r}", remedy)
    for material, names in parameters.items():
        expect("parameters of a fit", material, Material, "a material", remedy)
        known = material.law.constants
        unknown = [name for name in names if name not in known]
        if unknown or len(set(names)) < len(names) or not names:
            problem = f"there is no {unknown[0]!r}" if unknown else f"the names are {', '.join(names) or 'missing'}"
            raise DescriptionError(
                f"parameters of {material.name!r}", problem, f"Give some of {', '.join(known)}, each once"
            )
    called = [material.name for material in parameters]
    what = f"parameters of {' and '.join(map(repr, called))}"
    if len(set(called)) < len(called):
        raise DescriptionError(what, "two materials have one name", "Give each a name of its own")
    return what, [(material, name) for material, names in parameters.items() for name in names]


def _law_of(material: Material, parameters: Sequence[_Parameter], values: np.ndarray) -> Law:
    """The law of a material with those of the values that are of it; its numbers are not checked."""
    own = {name: float(v) for (given, name), v in zip(parameters, values, strict=True) if given == material}
    return material.law.with_parameters({**material.law.parameters, **own})


def _fitted(parameters: Sequence[_Parameter], values: np.ndarray) -> dict[Material, Material]:
    """By each material the one with these values.

    Raises:
        DescriptionError: a law refuses them.
    """
    given = dict.fromkeys(material for material, _ in parameters)
    # replace runs the checks of the law
    return {own: replace(own, law=replace(_law_of(own, parameters, values))) for own in given}


@dataclass(frozen=True)
class _Comparison:
    """Curves, computed minus measured values of each source, all of them per error (n,), with their slopes (n, p)."""

    curves: tuple[Curve, ...]
    residuals: tuple[tuple[float, ...], ...]
    scaled: np.ndarray
    slopes: np.ndarray


def _compare(sources: Sequence[_Rig | _TestedSpecimen], values: np.ndarray) -> _Comparison:
    curves, residuals, slopes = zip(*(source.compare(values) for source in sources), strict=True)
    sizes = np.concatenate([source.errors for source in sources])
    return _Comparison(
        tuple(chain.from_iterable(curves)),
        tuple(tuple(own.tolist()) for own in residuals),
        np.concatenate(residuals) / sizes,
        np.concatenate(slopes) / sizes[:, None],
    )


class _TestedSpecimen:
    """One test of a specimen.

    Attributes:
        concerned: indices of the parameters that are of its material.
        errors: sizes of the errors of its stresses, (n,).
    """

    def __init__(self, test: SpecimenTest, material: Material, parameters: Sequence[_Parameter]) -> None:
        self._test, self._material, self._parameters, self.errors = test, material, parameters, test.errors
        self.concerned = [k for k, (given, _) in enumerate(parameters) if given == material]
        if not self.concerned:
            problem, remedy = f"no parameter of {material.name!r} is fitted", "Leave the test out, or name parameters"
            raise DescriptionError(f"test {test.name!r}", problem, remedy)
        self._specimen = Specimen(material.law, test.kind, tuple(parameters[k][1] for k in self.concerned))

    def compare(self, values: np.ndarray) -> tuple[tuple[()], np.ndarray, np.ndarray]:
        """P − P̄ (n,) and ∂P/∂θ (n, p) at these parameters θ.

        Raises:
            EquilibriumError: the law has no equilibrium at a stretch of the test.
        """
        test, slopes = self._test, np.zeros((len(self.errors), len(self._parameters)))
        stress, own = self._specimen.response(_law_of(self._material, self._parameters, values), test.stretches)
        slopes[:, self.concerned] = own
        if np.any(lost := ~np.isfinite(stress)):
            problem = f"the law of {self._material.name!r} has no equilibrium at stretch {test.stretches[lost][0]:.4g}"
            raise EquilibriumError(f"test {test.name!r}", problem, "Give a guess nearer to the test")
        return (), stress - test.stresses, slopes


class _Rig:
    """One experiment in a simulation of its own, in which parameters of laws change.

    Attributes:
        concerned: indices of the parameters that are of materials of its links.
        errors: sizes of the errors of what is compared, (n,).
    """

    def __init__(self, experiment: Experiment, parameters: Sequence[_Parameter]) -> None:
        self._experiment, self._requests, self.errors = experiment, experiment.requests, experiment.errors
        simulation, made_of = experiment.simulation, experiment.simulation.materials
        self._count = len(parameters)
        self.concerned = [k for k, (given, _) in enumerate(parameters) if given in made_of.values()]
        # without any of the materials, the first one is refused by the simulation
        for material in dict.fromkeys(parameters[k][0] for k in self.concerned or [0]):
            simulation = simulation.with_material(material, material)
        self._simulation, model = simulation, simulation.model
        kinds = []
        for material, name in (parameters[k] for k in self.concerned):
            kinds.append(LawParameter(name, *(link for link, own in made_of.items() if own == material)))
        self._numbers, self._adjoint = [model.number(kind) for kind in kinds], Sensitivity(model, kinds)

    def compare(self, values: np.ndarray) -> tuple[tuple[Curve, ...], np.ndarray, np.ndarray]:
        """The curves at these parameters θ, computed minus measured values (n,), and their slopes by θ (n, p)."""
        for number, value in zip(self._numbers, values[self.concerned], strict=True):
            number.set(float(value))
        found: dict[float, tuple[float, np.ndarray]] = {}
        curves = tuple(self._run(request, found) for request in self._requests)
        computed, own = zip(*(found[value] for value in self._experiment.prescribed.tolist()), strict=True)
        slopes = np.zeros((len(self.errors), self._count))
        slopes[:, self.concerned] = agreed(self._simulation.comm, np.array(own))
        return curves, np.array(computed) - self._experiment.measured, slopes

    def _run(self, request: CurveRequest, found: dict[float, tuple[float, np.ndarray]]) -> Curve:
        """One curve; its values and their slopes are added to those ``found``, by prescribed value."""
        curve, part = self._simulation.compute(request), request.part
        assert isinstance(part, Force), "experiments prescribe forces, or displacements of their points"
        travel, by_force = Displacement(part).on(self._simulation.model), curve.unknown is Unknown.DISPLACEMENT
        # displacements count from the unloaded configuration, which changes unless it is a rigid assembly
        origin = np.zeros(len(self.concerned))
        if curve.unloaded.has_reactions:
            origin = self._gradient(curve.unloaded, LoadControl(0.0), travel).numbers
        for control, frame in zip(request.controls, curve.frames, strict=True):
            if by_force:
                slope = self._gradient(frame.state, control, travel).numbers - origin
                found[control.prescribed] = frame.displacement, slope
            else:
                held = DisplacementControl(float(travel.values(frame.state)[0]))
                by = self._gradient(frame.state, held, ForceMagnitude(part).on(self._simulation.model))
                found[control.prescribed] = frame.force, by.numbers + by.control * origin
        return curve

    def _gradient(self, state: State, control: Control, observable: Observable) -> Gradient:
        solver = self._simulation.solver(self._experiment.part)
        (gradient,) = self._adjoint.gradients(solver, state, control, [observable])
        return gradient
