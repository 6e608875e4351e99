"""Young's modulus of a material from measured forces and displacements.

Displacements u_k(E) of specimens under the measured forces are fitted to the measured ū_k by Gauss–Newton on ln E:

    min Σ_k ((u_k(E) − ū_k) / s_k)²,     s_k the largest |ū| of the specimen's measurements,

which is maximum likelihood if forces are exact and displacements are read with independent normal errors of one size
relative to each specimen's range. With the residuals' standard deviation σ and J = ∂(u/s)/∂ln E from the adjoint,

    standard error of ln E = σ / |J|,     interval  E exp(± t σ / |J|),     t Student's quantile for n − 1.

Source: Seber & Wild, Nonlinear Regression (doi:10.1002/0471725315), chapters 2 and 5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import t as student

from fenicsmech.equilibrium import LoadControl, State
from fenicsmech.errors import DescriptionError, EquilibriumError, counted, finite, set_fields
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
        curves, residuals, slopes = zip(*(rig.compare(np.exp(log_modulus)) for rig in rigs), strict=True)
        scaled = np.concatenate([r / rig.range for r, rig in zip(residuals, rigs, strict=True)])
        J = np.concatenate([slope / rig.range for slope, rig in zip(slopes, rigs, strict=True)])
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


def _with_modulus(material: Material, modulus: float) -> Material:
    return replace(material, law=material.law.with_parameters({**material.law.parameters, "E": modulus}))


class _Rig:
    """One experiment in a simulation of its own, whose modulus changes."""

    def __init__(self, experiment: Experiment, material: Material) -> None:
        self._experiment, self._request = experiment, experiment.request
        self._simulation = experiment.simulation.with_material(material, material)
        model = self._simulation.model
        links = zip(model.mechanism.flexible_links, model.materials, strict=True)
        modulus = LawParameter("E", *(link for link, made_of in links if made_of == material))
        self._modulus, self._adjoint = model.number(modulus), Sensitivity(model, [modulus])
        self.range = float(np.abs(experiment.displacements).max())

    def compare(self, modulus: float) -> tuple[Curve, np.ndarray, np.ndarray]:
        """The curve at ``modulus`` E, u − ū (n,) and ∂u/∂ln E (n,)."""
        simulation, part = self._simulation, self._request.part
        assert isinstance(part, Force), "experiments prescribe forces"
        model, solver = simulation.model, simulation.solver(part)
        self._modulus.set(modulus)
        curve = simulation.compute(self._request)
        travel: list[Observable] = [Displacement(part).on(model)]

        def slope_of(state: State, force: float) -> float:
            (gradient,) = self._adjoint.gradients(solver, state, LoadControl(force), travel)
            return modulus * float(gradient.numbers[0])

        # displacements count from the unloaded configuration, which changes unless it is a rigid assembly
        unloaded = slope_of(curve.unloaded, 0.0) if curve.unloaded.has_reactions else 0.0
        slopes, travels = {}, {}
        for frame in curve.frames:
            travels[frame.force] = frame.displacement
            slopes[frame.force] = slope_of(frame.state, frame.force) - unloaded
        measured = self._experiment
        reached, slope = (np.array([values[force] for force in measured.forces]) for values in (travels, slopes))
        return curve, reached - measured.displacements, slope
