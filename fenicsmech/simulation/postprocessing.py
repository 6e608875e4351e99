"""What a simulation tells of the curves it has computed: stability, errors, stresses, files and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as FilePath

import numpy as np

from fenicsmech.checks import positive
from fenicsmech.collective import from_one, on_one
from fenicsmech.compat import owned_values
from fenicsmech.equilibrium import Iteration
from fenicsmech.errors import DescriptionError
from fenicsmech.mechanism import Force, Leader, Output
from fenicsmech.meshing import radius_ratios
from fenicsmech.model import Fidelity, MechanismModel
from fenicsmech.multibody import Linkage
from fenicsmech.plot import Panel, Trace, draw_configurations
from fenicsmech.simulation.buckling import (
    BucklingLoad,
    BucklingPosition,
    SoftMode,
    buckling_loads,
    buckling_positions,
    soft_modes,
)
from fenicsmech.simulation.curve import Curve
from fenicsmech.simulation.discretisation import Discretisation
from fenicsmech.simulation.estimates import Estimates
from fenicsmech.simulation.explanation import Explanation, hints, simulated
from fenicsmech.simulation.export import write_xdmf
from fenicsmech.simulation.frame import Frame
from fenicsmech.simulation.picture import panel
from fenicsmech.simulation.snapshot import gather, rest_vertices


class Postprocessing:
    """Questions about computed curves, the last one unless another is given; they change nothing.

    ``Simulation`` adds how curves are computed.

    Args:
        discretisation: what curves are computed with.
    """

    def __init__(self, discretisation: Discretisation) -> None:
        self._discretisation = discretisation
        self._last: Curve | None = None
        self.scene, self.comm, self.clock = discretisation.scene, discretisation.comm, discretisation.clock

    @property
    def fidelity(self) -> Fidelity:
        """How finely is computed."""
        return self._discretisation.fidelity

    @property
    def linkage(self) -> Linkage:
        """The mechanism's bodies and joints."""
        return self._discretisation.linkage

    @property
    def model(self) -> MechanismModel:
        """The meshed mechanism (collective)."""
        return self._discretisation.model

    @property
    def estimates(self) -> Estimates:
        """Error estimates at equilibria of the present fidelity (collective)."""
        return self._discretisation.estimates

    @property
    def setup_seconds(self) -> float:
        """Seconds spent before the first frame: mesh, compiled forms, matrix patterns."""
        return sum(self.clock.seconds.get(phase, 0.0) for phase in ("mesh", "setup", "compile"))

    @property
    def mesh_ratio_max(self) -> float:
        """Largest ratio of circumradius to inradius among the cells of the rest shape (collective)."""
        rest, dim = rest_vertices(self.model), self.fidelity.model.dim
        return from_one(self.comm, lambda: dim / float(radius_ratios(rest, self.model.mesh.cells).min()))

    def buckling_loads(
        self, curve: Curve | None = None, *, frame: Frame | None = None, count: int = 3
    ) -> tuple[BucklingLoad, ...]:
        """Forces at which the equilibrium would stop being unique, from the tangent and its rate (collective).

        Exact for columns and others that hardly move before they buckle; else the better the nearer the frame is.

        Args:
            curve: the last curve computed by default.
            frame: the equilibrium; the last one of the curve by default.
            count: how many, those nearest to the force of the frame, in both senses, nearest first.

        Raises:
            DescriptionError: no curve was computed yet, or motors lead it.
            EquilibriumError: the force moves nothing, or the tangent is singular.
        """
        chosen = self._chosen(curve)
        newton = self.newton(chosen.force_part, chosen.others)
        return buckling_loads(self.model, newton, chosen, frame or chosen.frames[-1], count)

    def buckling_positions(
        self, curve: Curve | None = None, *, frame: Frame | None = None, count: int = 3
    ) -> tuple[BucklingPosition, ...]:
        """Positions of the motors that led a curve at which the equilibrium would stop being unique (collective).

        How well they are told, and the arguments, as of ``buckling_loads``.

        Raises:
            DescriptionError: no curve was computed yet, or a force leads it.
            EquilibriumError: the motors move nothing, or the tangent is singular.
        """
        chosen = self._chosen(curve)
        newton = self.newton(chosen.motor_part, chosen.others)
        return buckling_positions(self.model, newton, chosen, frame or chosen.frames[-1], count)

    def soft_modes(
        self, curve: Curve | None = None, *, frame: Frame | None = None, count: int = 3
    ) -> tuple[SoftMode, ...]:
        """The directions in which an equilibrium is softest under dead loads, softest first (collective).

        Arguments and errors as those of ``buckling_loads``.
        """
        chosen = self._chosen(curve)
        newton = self.newton(chosen.part, chosen.others)
        return soft_modes(self.model, newton, chosen, frame or chosen.frames[-1], count)

    def error_estimates(self, curve: Curve | None = None, *, output: Output | None = None) -> np.ndarray:
        """What finer elements would add to what each frame leaves open, (frames,) (collective).

        That is the displacement where forces were prescribed, the force where displacements were, or where the curve
        was followed: ``curve.goal``.

        Args:
            curve: the last curve computed by default.
            output: whose displacement is asked for instead, while what was prescribed stays as it is.

        Raises:
            DescriptionError: no curve was computed yet, or motors lead it.
            EquilibriumError: the tangent of a frame is singular.
        """
        return self.estimates.elements(self._chosen(curve), output)

    def modelling_errors(self, curve: Curve | None = None, *, output: Output | None = None) -> np.ndarray:
        """What a simulation in space would add to plane stress, arguments and result as of ``error_estimates``.

        Raises:
            DescriptionError: no curve was computed yet, motors lead it, or this is not plane stress.
            EquilibriumError: the tangent of a frame is singular.
        """
        return self.estimates.depth(self._chosen(curve), output)

    def explain(self, curve: Curve | None = None, *, tolerance: float = 0.01) -> Explanation:
        """What is simulated and what is left out, with figures where that may matter (collective).

        Args:
            curve: whose last frame the figures are of; the last curve computed by default.
            tolerance: relative change of the displacement from which something matters.

        Raises:
            DescriptionError: no curve was computed yet, motors lead it, or the tolerance is not a positive number.
            EquilibriumError: the tangent of the frame is singular.
        """
        positive("tolerance of an explanation", tolerance)
        chosen, fidelity = self._chosen(curve), self.fidelity
        left_out = hints(
            self.model,
            self.newton(chosen.force_part, chosen.others),
            chosen,
            order=fidelity.order,
            tolerance=tolerance,
            units=self.scene.units,
        )
        return Explanation(simulated(self.model, fidelity.model.name, fidelity.order), tuple(left_out))

    def newton(self, part: Leader, others: tuple[tuple[Force, float], ...] = ()) -> Iteration:
        """The solver for what leads and some fixed forces, kept for all configurations (collective)."""
        return self._discretisation.curves.newton(part, others)

    def von_mises(self, frame: Frame) -> np.ndarray | None:
        """Von Mises stress at the midpoints of all cells, on rank 0; None elsewhere (collective).

        Cells are numbered as in ``model.mesh.cells``, (cells,).
        """
        snapshot = gather(self.model, frame)
        return None if snapshot is None else snapshot.von_mises

    def write(self, path: str | FilePath, curve: Curve | None = None) -> None:
        """Writes the frames of ``curve`` (the last one computed) as XDMF for ParaView (collective).

        Raises:
            DescriptionError: no curve was computed yet, or the path does not end in .xdmf.
        """
        write_xdmf(path, self.model, self._chosen(curve).frames)

    def picture(
        self,
        path: str | FilePath,
        curve: Curve | None = None,
        *,
        stress: bool = True,
        traces: Sequence[Trace] = (),
    ) -> None:
        """Draws the first and the last frame of ``curve`` as a PNG (collective).

        Args:
            path: the file.
            curve: the last curve computed by default.
            stress: colour links by von Mises stress.
            traces: paths of points to draw along.

        Raises:
            DescriptionError: no curve was computed yet.
        """
        panel, units = self.panel(self._chosen(curve), stress=stress, traces=traces), self.scene.units
        label = f"von Mises stress [{units.stress}]" if stress else ""
        title = self.scene.mechanism.name
        on_one(
            self.comm,
            lambda: draw_configurations(path, [panel], title=title, colour_label=label, unit=units.length),
        )

    def panel(self, curve: Curve, *, stress: bool = True, traces: Sequence[Trace] = ()) -> Panel | None:
        """The picture of a curve's first and last frame, on rank 0; None elsewhere (collective)."""
        return panel(self.model, curve, stress=stress, traces=traces)

    def _chosen(self, curve: Curve | None) -> Curve:
        """The one that is asked about (collective).

        Raises:
            DescriptionError: no curve was computed yet, or this one at another fidelity.
        """
        chosen = curve or self._last
        if chosen is None:
            raise DescriptionError("simulation", "no curve was computed yet", "Call load_displacement first")
        elastic, frame = self.model.elastic, chosen.frames[-1]
        own = len(elastic.d.x.array), sum(len(owned_values(field)) for field in elastic.fields)
        if self.comm.allreduce(int((len(frame.design), len(frame.state.u)) != own)):
            raise DescriptionError(
                f"curve of {chosen.part.name!r}",
                "it was computed at another fidelity than this simulation has now",
                "Ask the simulation that computed it, before an accuracy makes it go on to a finer mesh",
            )
        return chosen
