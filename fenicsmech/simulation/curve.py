"""A load–displacement curve: the frames of one configuration under a changing force or moving motor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from fenicsmech.collective import on_one
from fenicsmech.continuation import Mode, critical_changes, softest_modes
from fenicsmech.elasticity import PLANE_STRESS
from fenicsmech.equilibrium import LoadControl, MotorControl, NotConverged, Unknown
from fenicsmech.errors import DescriptionError, EquilibriumError, counted, real_array
from fenicsmech.estimates import AccuracyOptions, DoubtOptions, ErrorKind
from fenicsmech.files import write_csv
from fenicsmech.log import logger
from fenicsmech.mechanism import DRAWN, FlexibleLink, Force, ForceGroup, Joint, Output, PrescribedPart, Units
from fenicsmech.plot import Arrow, CurveSeries, Panel, Trace, draw_configurations, plot_curve
from fenicsmech.simulation.curve_errors import CheckedErrors, CurveErrors
from fenicsmech.simulation.fields import MechanismPlotter, gather, peak_mark, position, write_xdmf
from fenicsmech.simulation.frame import BucklingPoint, Frame, ModeShape, SoftMode, mode_shape
from fenicsmech.simulation.frame_series import FrameSeries
from fenicsmech.simulation.omitted_effects import Explanation, ExplanationOptions, PinFriction, explain, friction_band
from fenicsmech.simulation.recomputed import Recomputed
from fenicsmech.stress import EdgeStress, LinkSurface, StressField, allowables, von_mises

_log = logger(__name__)


@dataclass(frozen=True)
class Axis:
    """A quantity and its unit."""

    quantity: str
    unit: str

    @property
    def label(self) -> str:
        """The label of plots and columns."""
        return f"{self.quantity} [{self.unit}]"

    def __call__(self, value: float, digits: int = 3) -> str:
        """A value with its unit."""
        return f"{value:.{digits}g} {self.unit}"


def axes(part: PrescribedPart, units: Units) -> tuple[Axis, Axis]:
    """Quantities and units on the axes of the curve of a part."""
    if isinstance(part, Force | ForceGroup):
        return Axis("displacement", units.length), Axis("force", units.force)
    if part.sliding:
        return Axis("position", units.length), Axis("force", units.force)
    return Axis("angle", "rad"), Axis("torque", f"{units.force} {units.length}")


@dataclass(frozen=True, eq=False, repr=False)
class Curve(FrameSeries):
    """Frames of one configuration; methods compute at the rest shape that these belong to."""

    _estimates: dict[tuple[ErrorKind, Output | None], np.ndarray] = field(default_factory=dict, init=False)

    def __repr__(self) -> str:
        (across, up), first, last = self.axes, self.frames[0], self.frames[-1]
        unstable, frames = int(np.sum(~self.stable)), counted(len(self.frames), "frame")
        return (
            f"<{type(self).__name__} of {self.part.name!r}, {self.configuration.name}: {frames}, "
            f"{across.quantity} {across(first.displacement)} to {across(last.displacement)}, "
            f"{up.quantity} {up(first.force)} to {up(last.force)}{f', {unstable} unstable' if unstable else ''}>"
        )

    @property
    def axes(self) -> tuple[Axis, Axis]:
        """Quantities and units across and up."""
        return axes(self.part, self.units)

    @property
    def remarks(self) -> tuple[str, ...]:
        """Warnings of snap-throughs and of unstable equilibria, a sentence each."""
        (across, up), name, said = self.axes, self.configuration.name, []
        for before, after in zip((None, *self.frames), self.frames, strict=False):
            if after.snapped_through:
                since = "on the way there" if before is None else f"after {up.quantity} {up(before.force)}"
                said.append(
                    f"{name}: snaps {since}, to {across.quantity} {across(after.displacement)} at {up.quantity} "
                    f"{up(after.force)}, which is one of perhaps several equilibria beyond the fold"
                )
        unstable = int(np.sum(~self.stable))
        if unstable:
            said.append(f"{name}: {unstable} of {len(self.frames)} equilibria are unstable under dead loads")
        return tuple(said)

    # -- errors --------------------------------------------------------------------------------------------------

    @property
    def _errors(self) -> CurveErrors:
        self._need_force()
        return CurveErrors(self, self._estimates)

    def error_estimates(self, *, output: Output | None = None) -> np.ndarray:
        """Estimated discretisation errors of ``values``, (frames,), to be added to them; computed once.

        A warning is logged where ``growth_by_halving`` is more than a hundredth of the largest value: then the values
        have no limit as elements shrink.

        Args:
            output: whose displacement is estimated instead, under the same control.

        Raises:
            DescriptionError: motors move along the curve.
            EquilibriumError: the KKT matrix of a frame is singular.
        """
        return self._errors.estimated([ErrorKind.ELEMENTS], output)[0]

    def modelling_errors(self, *, output: Output | None = None) -> np.ndarray:
        """Estimated errors of plane stress, (frames,), to be added; arguments as those of ``error_estimates``.

        They include contraction that interfaces prevent, and wide thin links that curl across their depth as they bend,
        but not motion out of the plane. Of laws with directions they take typical isotropic constants: compare links
        of such laws in 3D.

        Raises:
            DescriptionError: motors move along the curve, or it is not in plane stress.
            EquilibriumError: the KKT matrix of a frame is singular.
        """
        return self._errors.estimated([ErrorKind.PLANE_STRESS], output)[0]

    def errors_by_kind(self) -> tuple[np.ndarray, np.ndarray]:
        """``error_estimates`` and ``modelling_errors``, from one adjoint per frame; the latter 0 in other models."""
        if self.discretisation.fidelity.model is not PLANE_STRESS:
            return self.error_estimates(), np.zeros(len(self.frames))
        elements, plane_stress = self._errors.estimated(list(ErrorKind))
        return elements, plane_stress

    def doubts(self, options: DoubtOptions | None = None, *, modelling: bool = False) -> tuple[tuple[str, ...], ...]:
        """Why ``error_estimates``, or ``modelling_errors``, may be off by more than a factor of two, for every frame.

        Two factorisations a frame; estimates that are not known yet come with them.

        Args:
            options: when estimates are in doubt.
            modelling: those of ``modelling_errors``.

        Raises as ``error_estimates``, or ``modelling_errors``.
        """
        return tuple(self._errors.doubts(_kind(modelling), options or DoubtOptions()))

    def checked_errors(
        self, options: DoubtOptions | None = None, *, modelling: bool = False, frame: Frame | None = None
    ) -> CheckedErrors:
        """Errors as ``error_estimates`` or ``modelling_errors``, each from an equilibrium elsewhere.

        The equilibrium of a frame is sought again, from its own as the guess: in elements of the next order, in the
        plane half as wide too. How the value changes, and estimates there, make up the error; that of plane stress is
        what elements of the next order in space change (``simulation.recomputed``). Much of what is said against
        estimates (``doubts``) holds no more then. What the other elements need is compiled and kept for further calls.

        Args:
            options: when errors are in doubt.
            modelling: those of plane stress.
            frame: the one of the curve's whose errors are wanted; all by default.

        Raises as ``error_estimates`` or ``modelling_errors``, and a DescriptionError where the frame is of another
        curve or the scene cannot be simulated in space.
        """
        options, errors = options or DoubtOptions(), self._errors
        if frame is not None:
            errors = CurveErrors(replace(self, frames=(self._chosen(frame),)))
        return errors.checked(_kind(modelling), options)

    def in_finer_elements(self, frame: Frame | None = None) -> Frame:
        """The equilibrium near that of a frame in elements of the next order, in the plane half as wide too.

        All its quantities show what elements leave of them: peaks of stress closer than their own estimates do.

        Args:
            frame: one of the curve's; the last one by default.

        Raises:
            DescriptionError: motors move along the curve, or the frame is of another one.
            EquilibriumError: no equilibrium is near.
        """
        self._need_force()
        return Recomputed(self, self.discretisation.refined, DoubtOptions()).frame(self._chosen(frame))

    @cached_property
    def corrections(self) -> np.ndarray:
        """Sums of the estimated errors, to be added to ``values``, (frames,); 0 and a warning where they are too large.

        Corrected values are those of infinitely fine elements in 3D, from plane stress too. Targets of designs are
        corrected by the errors of elements alone, ``error_estimates``: they stay in the model of their simulation.

        Raises as ``error_estimates``.
        """
        elements, plane_stress = self.errors_by_kind()
        options, errors = AccuracyOptions(), elements + plane_stress
        found = options.corrections(errors, self.values)
        if left := np.count_nonzero(found != errors):
            model = self.discretisation.fidelity.model
            _log.warning(
                "%d of %d estimated errors of %r are above %g of the largest %s and not added: use finer elements%s",
                *(left, len(found), self.part.name, options.first_order, self.unknown.value),
                " or space='3d'" if model is PLANE_STRESS else "",
            )
        return found

    @property
    def corrected(self) -> np.ndarray:
        """``values`` with their ``corrections``, (frames,). Raises as ``error_estimates``."""
        return self.values + self.corrections

    @property
    def growth_by_halving(self) -> np.ndarray:
        """Growth of ``values`` with each halving of the elements, (frames,): a bound in the plane, approximate in 3D.

        They grow without limit if the force is at a point of a flexible link; 0 if it does not, and where motors move.
        """
        return CurveErrors(self).growth()

    # -- stability, friction, assumptions ------------------------------------------------------------------------

    def buckling_points(self, *, frame: Frame | None = None, count: int = 3) -> tuple[BucklingPoint, ...]:
        """Forces, or positions of the motors, at which the equilibrium would stop being unique.

        From the KKT matrix and its rate: exact for columns and other mechanisms that hardly move before they buckle;
        otherwise more accurate from closer frames.

        Args:
            frame: one of the curve's; the last one by default.
            count: how many, those nearest to the force or position of the frame, in both directions, nearest first.

        Raises:
            DescriptionError: the frame is of another curve.
            EquilibriumError: the force or the motors move nothing, or the KKT matrix is singular.
        """
        control = self.discretisation.followed_control(self.part)
        at, found = self._modes(control, critical_changes, frame, count)
        start = at.displacement if control.displaces else at.force
        return tuple(BucklingPoint(start + change, mode) for change, mode in found)

    def soft_modes(self, *, frame: Frame | None = None, count: int = 3) -> tuple[SoftMode, ...]:
        """The directions in which an equilibrium is softest under dead loads, softest first.

        Arguments and errors as those of ``buckling_points``.
        """
        _, found = self._modes(LoadControl(), softest_modes, frame, count)
        return tuple(SoftMode(value, mode) for value, mode in found)

    def friction_band(self, pins: Mapping[Joint, PinFriction]) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the force between which friction holds the mechanism, at every frame.

        Turning angles are differences along the curve, of second order in the distance of its frames; ends of the curve
        are less accurate than the rest. Only forces across the axes of pins count.

        Args:
            pins: friction of revolute joints.

        Returns:
            The lower and the upper bound, (frames,) each; infinite where the force's point does not move but pins turn.

        Raises:
            DescriptionError: the curve has one frame only or a frame twice, a joint is not a hinge that turns, or its
                friction is not a ``PinFriction``.
        """
        return friction_band(self.frames, pins, self.discretisation.model)

    def explain(self, *, tolerance: float = 0.01, weight: float | None = None) -> Explanation:
        """The assumptions of the simulation as text, with figures of the last frame where these may matter.

        Args:
            tolerance: relative change of the displacement above which an omitted effect matters.
            weight: of the flexible links per volume, in units of the scene; in mm and N that of plastics and silicones,
                1.2 g/cm³, by default.

        Raises:
            DescriptionError: motors move along the curve, or the tolerance or weight is not a positive number.
            EquilibriumError: the KKT matrix of the frame is singular.
        """
        if weight is None and (self.units.length, self.units.force) == ("mm", "N"):
            weight = 1.2e-9 * 9810.0  # N/mm³
        options, frame = ExplanationOptions(tolerance, weight), self.frames[-1]
        self._need_force()
        at = self.equilibrium(frame)
        return explain(self.discretisation, self.part, self.solver, at, frame, self.units, options)

    # -- pictures and files --------------------------------------------------------------------------------------

    def stress_field(self, frame: Frame | None = None) -> StressField | None:
        """Recovered stress and strain at the vertices of the mesh, on rank 0; None elsewhere.

        Args:
            frame: one of the curve's; the last one by default.

        Returns:
            numbered as ``model.mesh.vertices``.
        """
        chosen = self._chosen(frame)
        return chosen.stresses.field(chosen.state, chosen.design)

    def edge_stress(
        self,
        link: FlexibleLink,
        *,
        start: Sequence[float] | None = None,
        end: Sequence[float] | None = None,
        frame: Frame | None = None,
    ) -> EdgeStress:
        """Recovered stress and strain along the outline of a flexible link, at mid-depth in space: a plot and data.

        Args:
            link: the link.
            start: drawn point, (2,), from whose nearest point of the outline arc lengths count; by default the leftmost
                one of the outer outline. The outline of a hole is that of a point near it.
            end: drawn point to which the edge goes, the shorter way; by default all around, the link on the left.
            frame: one of the curve's; the last one by default.

        Raises:
            DescriptionError: the frame is of another curve, the link is not a flexible link of the mechanism, or the
                points lie on different outlines.
        """
        chosen = self._chosen(frame)
        if link not in self.discretisation.scene.mechanism.flexible_links:
            raise DescriptionError(
                f"edge of {link!r}", "it is not a flexible link of the mechanism", "Give one of its flexible links"
            )
        given = [None if point is None else real_array("point of an edge", point, 2) for point in (start, end)]
        if start is None and end is not None:
            raise DescriptionError(f"edge of {link.name!r}", "it has an end, but no start", "Give start=… too")
        return chosen.stresses.edge(chosen.state, chosen.design, link.name, self.units, *given)

    def series(self, label: str = "", *, colour: str | None = None, faint: bool = False) -> CurveSeries:
        """The curve as a plot draws it, arguments as those of ``CurveSeries``."""
        x, y, snapped = self.displacements, self.forces, self.snapped_through
        return CurveSeries(x, y, label, self.stable, colour=colour, faint=faint, snapped_through=snapped)

    def plot(self, path: str | Path) -> None:
        """Draws force over displacement as a PNG."""
        (across, up), title = self.axes, f"{self.part.name}, {self.configuration.name}"
        comm = self.discretisation.comm
        plot_curve(path, [self.series()], xlabel=across.label, ylabel=up.label, title=title, comm=comm)

    def picture(
        self, path: str | Path, *, stress: bool = True, traces: Sequence[Trace] = (), beside: Sequence[Curve] = ()
    ) -> None:
        """Draws the mechanism in the first and the last frame as a PNG.

        Args:
            path: the file.
            stress: colour links by recovered von Mises stress, and mark its peak.
            traces: paths of points to draw along.
            beside: curves of other configurations to draw beside this one.
        """
        panels = [self.panel(stress=stress, traces=traces), *(curve.panel(stress=stress) for curve in beside)]
        drawn = [panel for panel in panels if panel is not None]
        label = f"von Mises stress [{self.units.stress}]" if stress else ""
        title = self.discretisation.scene.mechanism.name
        options = {"title": title, "colour_label": label, "unit": self.units.length}
        on_one(self.discretisation.comm, lambda: draw_configurations(path, drawn, **options))

    def panel(self, *, stress: bool = True, traces: Sequence[Trace] = ()) -> Panel | None:
        """The picture of the first and the last frame, on rank 0; None elsewhere."""
        model, (across, up), end = self.discretisation.model, self.axes, self.frames[-1]
        first, last = (gather(model, self.frames[k]) for k in (0, -1))
        forces = self.part.ratios if isinstance(self.part, Force | ForceGroup) else ()
        places = [position(model, force, end)[:2] for force, _ in forces]
        # an optimised design in the drawn configuration is not the drawn design
        name = "" if self.configuration == DRAWN else f"{self.configuration.name}: "
        plotter = on_one(self.discretisation.comm, lambda: MechanismPlotter(model))
        peak, safety, found = None, None, None
        if stress:

            def seen(_: LinkSurface) -> tuple[np.ndarray, np.ndarray]:
                assert plotter is not None and last is not None  # on rank 0
                return plotter.places(last)

            safety = end.safety if allowables(end.stresses.materials) else None
            peak, found = end.peak, end.stresses.at(end.state, end.design, seen)

        def draw() -> Panel:
            assert plotter is not None and first is not None and last is not None  # on rank 0
            arrows = []
            for (force, ratio), place in zip(forces, places, strict=True):
                size = ratio * end.force
                arrows.append(Arrow(place, size * np.array(force.direction[:2]), label=f"{size:g} {up.unit}"))
            values, mark = None if found is None else von_mises(found.stress), None
            if peak is not None and peak.value > 0.0:
                mark = peak_mark(last, end.stresses, peak, safety, self.units.stress)
            return Panel(
                plotter.shape(first),
                (plotter.shape(last, values),),
                tuple(arrows),
                tuple(traces),
                f"{name}{up(end.force)}, {across(end.displacement)}",
                mark,
            )

        return on_one(self.discretisation.comm, draw)

    def write(self, path: str | Path) -> None:
        """Writes displacement, recovered stress and strain, and pressure fields of all frames as XDMF for ParaView.

        All are at vertices: stress of Cauchy, its von Mises stress, the nominal strain of the elastic deformation, in
        the plane of planar models, and its largest principal value. They vanish where joints hold a link. The time of
        a frame is its force; its number where two frames have the same.

        Raises:
            DescriptionError: the path does not end in .xdmf.
            OSError: nothing can be written there.
        """
        write_xdmf(path, self.discretisation.model, self.frames)

    def write_csv(self, path: str | Path, *, errors: bool = False) -> None:
        """Writes displacement, force, stability, energy, largest stress and its error of every frame, one row each.

        Args:
            path: the file.
            errors: also ``error_estimates``, in plane stress ``modelling_errors``, and ``corrected``, in columns of
                their own.
        """
        (across, up), length, force, stress = self.axes, self.units.length, self.units.force, self.units.stress
        columns = {
            across.label: self.displacements,
            up.label: self.forces,
            "stable": self.stable,
            "snapped_through": self.snapped_through,
            f"strain energy [{force} {length}]": np.array([frame.strain_energy for frame in self.frames]),
            f"max von Mises [{stress}]": np.array([frame.max_stress for frame in self.frames]),
            f"error of max von Mises [{stress}]": np.array([frame.peak.error for frame in self.frames]),
        }
        if errors:
            name, unit = self.unknown.value, force if self.unknown is Unknown.FORCE else length
            elements, plane_stress = self.errors_by_kind()
            columns[f"finer elements add to the {name} [{unit}]"] = elements
            if self.discretisation.fidelity.model is PLANE_STRESS:
                columns[f"space adds to the {name} [{unit}]"] = plane_stress
            columns[f"corrected {name} [{unit}]"] = self.corrected
        on_one(self.discretisation.comm, lambda: write_csv(path, columns))

    # -- helpers --------------------------------------------------------------------------------------------------

    def _need_force(self) -> None:
        if not isinstance(self.part, Force | ForceGroup):
            where, remedy = f"curve of {self.part.name!r}", "Call this on a curve under a changing force"
            raise DescriptionError(where, "no force changes along it", remedy)

    def _chosen(self, frame: Frame | None) -> Frame:
        if frame is not None and frame not in self.frames:
            raise DescriptionError(
                f"curve of {self.part.name!r}", "the frame belongs to another curve", "Choose from its frames"
            )
        return frame or self.frames[-1]

    def _modes(
        self, control: LoadControl | MotorControl, modes: Callable[..., list[Mode]], frame: Frame | None, count: int
    ) -> tuple[Frame, list[tuple[float, ModeShape]]]:
        """The chosen frame, and eigenvalues and shapes of its modes while the value of ``control`` changes."""
        model, at = self.discretisation.model, self._chosen(frame)
        with model.shaped(at.design):
            try:
                found = modes(self.solver, control, at.state, count=count)
                return at, [(mode.value, mode_shape(model, mode.step)) for mode in found]
            except NotConverged as failure:
                where = f"{self.part.name!r} in configuration {self.configuration.name!r}"
                raise EquilibriumError(
                    f"modes of {where} at {self.axes[1](at.force)}",
                    f"they are not defined there ({failure.reason})",
                    "Choose another frame, or prescribe another part",
                    last=at,
                ) from failure


def _kind(modelling: bool) -> ErrorKind:
    return ErrorKind.PLANE_STRESS if modelling else ErrorKind.ELEMENTS
