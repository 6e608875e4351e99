"""Random design problems: some links of a random mechanism in plane stress, and one or two targets.

The end of an optimisation is right if its targets are met, or if a second start, independent of the first, does not
meet them either. In both cases the values reported must be those of a curve that starts unloaded.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from random import Random

import numpy as np

import fenicsmech as fm

from .blueprint import Blueprint, Built, build
from .draw import bending_force, decade
from .generator import planar_scene
from .potential import Potential
from .reasons import snaps
from .residual_check import energy_digits
from .thresholds import THRESHOLDS

UNMET = "designed: two starts meet no target"
_DENSITY = 1e-9
_HEARD = (
    1e-13  # load over the stiffest link's modulus, depth and the length, above which links are not lost in rounding
)


@dataclass(frozen=True)
class DesignScene:
    """A scene whose links are to be designed.

    Attributes:
        blueprint: of the mechanism as drawn; one force, one sample.
        links: names of those that change, each within ``thickness`` times its own.
        factor: wanted displacement, or what else is wanted, over that of the drawn design.
        light: whether the mass of these links is to be least, with the displacement at most as wanted.
        thickness: least and largest, over the drawn one.
        start: seed of the second start.
        goal: what is wanted: "displacement", "strain energy" or, at the drawn displacement, "force".
    """

    blueprint: Blueprint
    links: tuple[str, ...]
    factor: float
    light: bool
    thickness: tuple[float, float]
    start: int
    goal: str = "displacement"

    @property
    def summary(self) -> str:
        """In a few words."""
        wanted = f"{self.factor:.2f} of the {self.goal}{', least mass' if self.light else ''}"
        return f"design of {len(self.links)} links of a {self.blueprint.topology}: {wanted}"


def design_scene(seed: int) -> DesignScene:
    """The design problem of a seed."""
    rng = Random(f"design {seed}")
    while True:
        scene = planar_scene(rng, "plane-stress")
        load = bending_force(min(scene.flexible, key=bending_force)) * decade(rng, -2.0, -0.3)
        at_pin = any(joint.at == scene.forces[0].at for joint in scene.joints)
        stiffest = max(link.young * link.depth for link in scene.flexible) * scene.length
        heard = load > _HEARD * stiffest  # motors turn stiff links, whose nodal forces are rounded
        if (scene.motors or scene.topology == "two-link arch") and not at_pin and heard:
            break
    motors = tuple(replace(motor, position=0.0) for motor in scene.motors)
    links = tuple(replace(link, size=1.5 * link.thickness) if link.centreline else link for link in scene.links)
    scene = replace(
        scene,
        links=links,
        motors=motors,
        forces=scene.forces[:1],
        ratios=(1.0,),
        order=2,
        control="forces",
        samples=(load,),
    )
    names = [link.name for link in scene.flexible]
    return DesignScene(
        blueprint=scene,
        links=tuple(sorted(rng.sample(names, rng.randint(1, min(2, len(names)))))),
        factor=rng.uniform(0.5, 2.0),
        light=rng.random() < 0.3,
        thickness=(rng.uniform(0.4, 0.8), rng.uniform(1.2, 2.0)),
        start=rng.randrange(10**6),
    )


def with_goal(scene: DesignScene, seed: int) -> DesignScene:
    """The design problem of a seed with any goal."""
    rng = Random(f"goal {seed}")
    goal = rng.choices(("displacement", "strain energy", "force"), (5, 3, 2))[0]
    return replace(scene, goal=goal, light=scene.light and goal == "displacement")


def run(scene: DesignScene) -> tuple[str, str]:
    """Outcome and detail.

    Raises:
        FenicsmechError: of the drawn mechanism, or an optimisation.
    """
    try:
        return _optimised(scene)
    except fm.FenicsmechError as error:
        if "Use smaller elements" not in str(error):
            raise
        _optimised(_refined(scene))
        return "refused: elements too large for handles, smaller ones are not", str(error)


def _refined(scene: DesignScene) -> DesignScene:
    """The same problem on elements half as large."""
    links = tuple(replace(link, size=0.5 * link.size) for link in scene.blueprint.links)
    return replace(scene, blueprint=replace(scene.blueprint, links=links))


def _optimised(scene: DesignScene, *, refine: bool = True) -> tuple[str, str]:
    """Outcome and detail; where targets are missed and the result asks for smaller elements, those on these."""
    built = build(scene.blueprint)
    (frame,) = built.curve(scene.blueprint).frames
    if abs(frame.displacement) < THRESHOLDS.closed * scene.blueprint.length:
        return "true: the force moves nothing", f"{frame.displacement:.3g}"
    problem = design_problem(scene, built, scene.factor * _reached(scene, frame), frame.displacement)
    try:
        result = problem.optimise()
    except fm.DescriptionError as error:
        if _idle(scene, frame.displacement):
            return "true: DescriptionError, the links do not carry the force", str(error)
        raise
    except fm.EquilibriumError as error:
        if "snaps on the way there from zero load" in error.problem and (excuse := snaps(scene.blueprint, built)):
            return "true: EquilibriumError, the drawn mechanism snaps", f"{excuse.proof}; {error}"
        raise
    if (misreport := _misreported(scene, built, result, frame.displacement)) is not None:
        return misreport
    if _met(result):
        return "designed: targets met", result.reason
    if "allow more" in result.reason:  # as the result says
        result = problem.optimise(start=result)
        if (misreport := _misreported(scene, built, result, frame.displacement)) is not None:
            return misreport
        if _met(result):
            return "designed: targets met by more iterations", result.reason
    if refine and "refine them" in result.reason:
        outcome, detail = _optimised(_refined(scene), refine=False)
        met = outcome.startswith("designed: targets met")
        return ("designed: targets met on smaller elements" if met else outcome), detail
    # an independent start, from shapes that differ by what the bounds allow
    rng, initial = np.random.default_rng(scene.start), problem.initial
    other = problem.optimise(start=initial + _spread(scene) * rng.uniform(-1.0, 1.0, initial.shape))
    if (misreport := _misreported(scene, built, other, frame.displacement)) is not None:
        return misreport
    if _met(other):
        return "wrong: a second start meets the targets", f"{result.reason}; {result.targets[0]}"
    return UNMET, f"{result.reason}; {', '.join(result.active)}; {result.targets[0]}"


def design_problem(scene: DesignScene, built: Built, wanted: float, displacement: float = 0.0) -> fm.DesignProblem:
    """The optimisation to a ``wanted`` value of the goal, that of a force at a ``displacement``."""
    designs = []
    for name in scene.links:
        plan = scene.blueprint.link(name)
        least, largest = (share * plan.thickness for share in scene.thickness)
        designs.append(fm.SplineDesign(built.links[name], segments=2, thickness=(least, largest)))
    force, (load,) = built.forces[scene.blueprint.forces[0].name], scene.blueprint.samples
    sample = fm.Sample({force: load}, built.configuration)
    if scene.goal == "strain energy":
        targets = [fm.Target(fm.StrainEnergy(), sample, equals=wanted)]
    elif scene.goal == "force":
        there = fm.Sample({force: fm.at(displacement)}, built.configuration)
        targets = [fm.Target(fm.ForceMagnitude(force), there, equals=wanted)]
    elif not scene.light:
        targets = [fm.Target(fm.Displacement(force), sample, equals=wanted)]
    else:
        bound = {"at_most" if wanted > 0.0 else "at_least": wanted}
        mass = fm.LinkMass(tuple(built.links[name] for name in scene.links), density=_DENSITY)
        targets = [fm.Target(fm.Displacement(force), sample, **bound), fm.Target(mass, least=True)]
    return fm.DesignProblem(built.simulation, designs, targets=targets)


def _reached(scene: DesignScene, frame: fm.Frame) -> float:
    """The value of the goal at an equilibrium."""
    return float(getattr(frame, scene.goal.replace(" ", "_")))


def _idle(scene: DesignScene, displacement: float) -> bool:
    """Whether the displacement of the drawn design stays as it is when the links that may change are stiffer."""
    links = tuple(
        replace(link, young=2.0 * link.young) if link.name in scene.links else link for link in scene.blueprint.links
    )
    stiffer = replace(scene.blueprint, links=links)
    (frame,) = build(stiffer).curve(stiffer).frames
    return abs(frame.displacement - displacement) < THRESHOLDS.energy * abs(displacement)


def _met(result: fm.DesignResult) -> bool:
    return all(target.met for target in result.targets if target.wanted is not None)


def _spread(scene: DesignScene) -> float:
    """A share of the least thickness: parameters are lengths."""
    return 0.2 * min(scene.thickness[0] * scene.blueprint.link(name).thickness for name in scene.links)


def _misreported(
    scene: DesignScene, built: Built, result: fm.DesignResult, displacement: float
) -> tuple[str, str] | None:
    """Outcome and detail if a curve of the design says otherwise than the result, or does not get there."""
    force = built.forces[scene.blueprint.forces[0].name]
    simulation, (load,) = built.simulation.with_design(result), scene.blueprint.samples
    sample = {"displacements": [displacement]} if scene.goal == "force" else {"forces": [load]}
    try:
        curve = simulation.load_displacement(force, **sample, configuration=built.configuration)
    except fm.EquilibriumError as error:
        if result.verified:
            raise
        return "designed: not verified, and not reached from rest", str(error)
    found, reported = _reached(scene, curve.frames[-1]), float(result.targets[0].reached)
    grain, size = 0.0, abs(found)
    if scene.goal == "displacement":
        grain = THRESHOLDS.reached * scene.blueprint.length
    elif scene.goal == "strain energy":
        size = max(size, energy_digits(Potential.of(scene.blueprint, simulation)))
    if abs(found - reported) > grain + THRESHOLDS.energy * size:
        return f"wrong: {scene.goal} of a design", f"{reported:.9g} reported, {found:.9g} on a curve from rest"
    return None
