"""Equilibria of a curve with their measured quantities, and modes of their KKT matrices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fenicsmech.collective import agreed
from fenicsmech.equilibrium import (
    EquilibriumPoint,
    EquilibriumSystem,
    LoadControl,
    MotorControl,
    Reaction,
    State,
    Step,
    joint_reactions,
    motor_torques,
)
from fenicsmech.errors import DescriptionError, expect
from fenicsmech.mechanism import Motor, Output
from fenicsmech.model import Design, MechanismModel
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.stress import (
    LawStability,
    Life,
    Links,
    Safety,
    StressPeak,
    StressRecovery,
    SurfacePeaks,
    life_between,
    safety_of,
)


@dataclass(frozen=True, eq=False)
class Frame:
    """An equilibrium and its measured quantities; prints numbers, not arrays.

    Attributes:
        force: magnitude of the prescribed force, or torque or force of the prescribed motors.
        displacement: of the force's point along its direction, from the unloaded configuration, or the motors'
            position, from the drawing.
        snapped_through: whether the mechanism snapped on the way from the frame before: the path turns back there, and
            this equilibrium lies on another one, perhaps not the one that dynamics would lead to.
        unstable_modes: directions in which the energy has a maximum, under dead loads.
        stable_under_control: whether it is stable while its control is held.
        strain_energy: elastic energy of all links.
        outputs: displacement of each output of the mechanism, from the unloaded configuration.
        reactions: force and moment of each joint on its second link, by joint name.
        motors: torque or force of each motor.
        iterations: Newton iterations, load steps on the way included.
        residuals: relative residual before each iteration of the last step, and at the end.
        seconds: wall-clock time.
        phases: wall-clock time by phase.
        state: the equilibrium itself.
        design: that it belongs to.
        stresses: of the model, from which ``peak`` is recovered when it is first read.
    """

    force: float
    displacement: float
    snapped_through: bool
    unstable_modes: int
    stable_under_control: bool
    strain_energy: float
    outputs: Mapping[Output, float]
    reactions: Mapping[str, Reaction]
    motors: Mapping[Motor, float]
    iterations: int
    residuals: tuple[float, ...]
    seconds: float
    phases: Mapping[str, float]
    state: State
    design: Design
    stresses: StressRecovery

    @property
    def peak(self) -> StressPeak:
        """The largest von Mises stress at the surface of flexible links, places left out where it has no limit.

        The first read of it, or of what follows from it, is collective.
        """
        return self._peaks.whole

    @property
    def peaks(self) -> Mapping[str, StressPeak]:
        """The peak of each flexible link, by its name; one evaluation serves all of them."""
        return {peak.link: peak for peak in self._peaks.links}

    @property
    def strain_peak(self) -> StressPeak:
        """The largest principal nominal strain λ₁ − 1 of the elastic deformation, what allowable strains limit.

        It is one at the surface of flexible links too, with the same places left out. The first read is collective.
        """
        return self._strain_peaks.whole

    @property
    def strain_peaks(self) -> Mapping[str, StressPeak]:
        """That of each flexible link, by its name; one evaluation serves all of them."""
        return {peak.link: peak for peak in self._strain_peaks.links}

    @cached_property
    def _peaks(self) -> SurfacePeaks:
        return self.stresses.peaks(self.state, self.design)

    @cached_property
    def _strain_peaks(self) -> SurfacePeaks:
        return self.stresses.strain_peaks(self.state, self.design)

    @property
    def safety(self) -> Safety:
        """The factor of safety: least over the links of allowable over peak, each with the strength of its material.

        Raises:
            DescriptionError: no material has an allowable stress or strain.
        """
        return safety_of(self.stresses.materials, lambda own: self.strain_peaks if own.is_strain else self.peaks)

    @cached_property
    def law_stability(self) -> Mapping[str, LawStability]:
        """Drucker's stability of the law of each flexible link where it is least, by the link's name: 1 at rest.

        Not above zero the law is used beyond the strains it describes. The first read is collective.
        """
        return {own.link: own for own in self.stresses.law_stabilities(self.state, self.design)}

    def life(self, other: Frame, *, links: Links | None = None) -> Life:
        """Cycles to failure between this frame and another one, by Basquin with Goodman's mean stress.

        Args:
            other: of the same simulation and design, on any of its curves.
            links: flexible links that count, one or several, or their names; by default all whose materials have an
                ultimate stress and a line of Basquin or an endurance limit: ``Life.unknown`` names the others.

        Raises:
            DescriptionError: the frames are of different simulations or designs, no link is named, or a material lacks
                the ultimate stress, or the line of Basquin where the stress is above its endurance limit.
        """
        expect("life", other, Frame, "a frame", "Give a frame of a curve of the same simulation")
        if other.stresses is not self.stresses:
            problem = "the frames belong to different simulations"
            raise DescriptionError("life", problem, "Take both from curves of one simulation")
        return life_between(self.stresses, (self.state, self.design), (other.state, other.design), links)

    @property
    def max_stress(self) -> float:
        """The value of ``peak``, whose first read is collective."""
        return self.peak.value

    @property
    def stable(self) -> bool:
        """Whether small disturbances die out under dead loads."""
        return self.unstable_modes == 0

    def __repr__(self) -> str:
        figures = [f"force {self.force:.6g}", f"displacement {self.displacement:.6g}"]
        named: list[tuple[Output | Motor, float]] = [*self.outputs.items(), *self.motors.items()]
        figures += [f"{part.name} {value:.6g}" for part, value in named]
        figures.append(f"strain energy {self.strain_energy:.4g}")
        figures.append("stable" if self.stable else f"{self.unstable_modes} unstable modes")
        figures += ["snapped through"] * self.snapped_through
        return f"<Frame: {', '.join(figures)}>"


@dataclass(frozen=True, eq=False)
class FrameRecorder:
    """What makes frames of equilibria under a part, with displacements counted from one of them.

    Attributes:
        discretisation: of the scene.
        system: the equations of the part.
        followed: the control whose value changes along the curve.
        origin: zero of its displacements.
        zeros: those of outputs, 0 by default.
    """

    discretisation: Discretisation
    system: EquilibriumSystem
    followed: LoadControl | MotorControl
    origin: float = 0.0
    zeros: Mapping[Output, float] = field(default_factory=dict)

    def zeroed(self, state: State) -> FrameRecorder:
        """The recorder that counts from ``state``; motors count from where they were drawn."""
        model, origin = self.discretisation.model, 0.0
        self.system.load(state)
        if not self.followed.displaces:
            origin = agreed(self.discretisation.comm, self.followed.conjugate(self.system, state))
        zeros = {output: model.travel(output, state) for output in model.mechanism.outputs}
        return replace(self, origin=origin, zeros=zeros)

    def frame(self, point: EquilibriumPoint) -> Frame:
        """The measured quantities of an equilibrium, of the last solve on the way there alone."""
        model, state, followed = self.discretisation.model, point.state, self.followed
        self.system.load(state)
        with model.clock.phase("measure"):
            value, conjugate = followed.value(self.system, state), followed.conjugate(self.system, state)
            outputs = model.mechanism.outputs
            measured = [value, conjugate, *(model.travel(output, state) for output in outputs)]
            value, conjugate, *travels = agreed(self.discretisation.comm, measured)
            displacement, force = (value, conjugate) if followed.displaces else (conjugate, value)
            return Frame(
                force=force,
                displacement=displacement - self.origin,
                snapped_through=False,
                unstable_modes=point.unstable_modes,
                stable_under_control=point.unstable_under_control == 0,
                strain_energy=model.elastic.strain_energy(),
                outputs={out: end - self.zeros.get(out, 0.0) for out, end in zip(outputs, travels, strict=True)},
                reactions=joint_reactions(model.linkage.joints, state),
                motors=motor_torques(model.linkage.joints, state),
                iterations=point.iterations,
                residuals=point.residuals,
                seconds=0.0,
                phases={},
                state=state,
                design=model.design,
                stresses=self.discretisation.stresses,
            )


@dataclass(frozen=True, eq=False)
class ModeShape:
    """A direction in which a mechanism moves.

    Attributes:
        link: name of the flexible link that moves most.
        out_of_plane: fraction of its squared displacements that is across the plane of the mechanism, 0 … 1.
        step: the direction itself, its largest displacement the mechanism's length (or one rad).
    """

    link: str
    out_of_plane: float
    step: Step

    def __repr__(self) -> str:
        return f"<ModeShape: {self.link!r} moves most, {self.out_of_plane:.0%} out of the plane>"


@dataclass(frozen=True)
class BucklingPoint:
    """A force, or a position of the motors that move, at which the KKT matrix is singular; and the mode."""

    value: float
    mode: ModeShape


@dataclass(frozen=True)
class SoftMode:
    """A mode of the KKT matrix; its stiffness is in units of the mean stiffness of the links, negative if unstable."""

    stiffness: float
    mode: ModeShape


def mode_shape(model: MechanismModel, step: Step) -> ModeShape:
    """The direction ``step`` and its characteristics."""
    comm, links = model.mesh.mesh.comm, model.mechanism.flexible_links
    # where half is meshed, nodes move in space and bodies in the plane; pressures come last
    dim = model.interfaces.block
    squares = model.elastic.split(step.u)[0].reshape(-1, dim) ** 2
    owners = model.node_link[: len(squares)]
    sums = comm.allreduce(np.array([squares[owners == index].sum(axis=0) for index in range(len(links))]))
    whole = float(sums.sum())
    across = float(sums[:, 2].sum()) / whole if dim == 3 and whole > 0.0 else 0.0
    return ModeShape(links[int(np.argmax(sums.sum(axis=1)))].name, across, step)
