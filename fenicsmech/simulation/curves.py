"""The curves of a scene at one fidelity: traced from sample to sample, or followed wherever they lead."""

from __future__ import annotations

from collections.abc import Callable

from fenicsmech.equilibrium import ArcSteps, Iteration, Quantity, Sense
from fenicsmech.errors import DescriptionError
from fenicsmech.multibody import Freedom, assemble_before_strain, count_freedom
from fenicsmech.simulation.buckling import ModeShape
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.followed import FollowedCurve, PathEvent
from fenicsmech.simulation.follower import Follower
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.request import CurveRequest
from fenicsmech.simulation.tracer import Tracer
from fenicsmech.simulation.until import Until


class Curves:
    """Computes curves at the present rest shape of a model.

    Args:
        discretisation: of the scene.
    """

    def __init__(self, discretisation: Discretisation) -> None:
        self._discretisation, self._model = discretisation, discretisation.model

    def trace(self, request: CurveRequest, watch: Callable[[int], None]) -> Curve:
        """The frames of all samples of a request; ``watch`` is called with the number of frames so far.

        Raises:
            AssemblyError: the configuration does not assemble.
            EquilibriumError: a sample was not reached; carries the frames before it.
        """
        tracer, _, freedom = self._tracer(request)
        frames: list[Frame] = []
        for control in request.controls:
            frames.append(tracer.frame(control, frames))
            watch(len(frames))
        return Curve(
            request.part,
            request.configuration,
            freedom,
            tuple(frames),
            self._discretisation,
            others=request.others,
            quantity=Quantity.FORCE if request.controls[0].constrained else Quantity.DISPLACEMENT,
        )

    def follow(
        self, request: CurveRequest, until: Until, steps: ArcSteps | None, watch: Callable[[int], None]
    ) -> FollowedCurve:
        """The curve from the configuration without the force that leads, as ``Simulation.follow``."""
        follower, freedom = self._follower(request, until, steps)
        follower.from_rest(watch)
        return self._followed(request, freedom, follower)

    def branches(
        self, curve: FollowedCurve, event: PathEvent, until: Until, steps: ArcSteps | None, mode: ModeShape | None
    ) -> tuple[FollowedCurve, FollowedCurve]:
        """The curve that crosses another one, in both senses, as ``Simulation.branches``."""
        if event not in curve.bifurcations:
            raise DescriptionError(
                "branches", "the event is no bifurcation of the curve", "Choose from its bifurcations"
            )
        if mode is None and event.modes != 1:
            raise DescriptionError(
                "branches",
                f"{event.modes} modes become unstable at once: {', '.join(shape.link for shape in event.null_space)}",
                "Say which with mode=event.null_space[…], or break the symmetry a little",
            )
        if mode is not None and mode not in event.null_space:
            raise DescriptionError("branches", "the mode is none of the event's", "Choose from its null_space")
        request = CurveRequest(curve.part, (), curve.configuration, curve.others)
        found = []
        with self._model.shaped(event.frame.design):
            for sense in Sense:
                follower, freedom = self._follower(request, until, steps)
                follower.from_bifurcation(event, mode or event.mode, sense, lambda done: None)
                found.append(self._followed(request, freedom, follower))
        return found[0], found[1]

    def _tracer(self, request: CurveRequest) -> tuple[Tracer, Iteration, Freedom]:
        """What starts the path of a request, its solver, and the freedom of its configuration."""
        linkage, holding = self._model.linkage, self._model.holding
        assembly = assemble_before_strain(linkage, request.configuration, holding)
        rigid = linkage.rigid
        motors = assembly.fraction * rigid.motor_values(request.configuration.position)
        freedom = count_freedom(rigid, assembly.poses, motors, holding)
        newton = self._discretisation.newton(request.part, request.others)
        tracer = Tracer(
            self._model, newton, request, assembly=assembly, freedom=freedom, predictor=self._discretisation.predictor
        )
        return tracer, newton, freedom

    def _follower(self, request: CurveRequest, until: Until, steps: ArcSteps | None) -> tuple[Follower, Freedom]:
        tracer, newton, freedom = self._tracer(request)
        return Follower(self._model, newton, request, tracer, until=until, steps=steps or ArcSteps()), freedom

    def _followed(self, request: CurveRequest, freedom: Freedom, follower: Follower) -> FollowedCurve:
        return FollowedCurve(
            request.part,
            request.configuration,
            freedom,
            tuple(follower.frames),
            self._discretisation,
            others=request.others,
            # loads have limit points, where no displacement belongs to a slightly larger one
            quantity=Quantity.FORCE,
            events=tuple(follower.events),
        )
