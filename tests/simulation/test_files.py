"""Pictures, tables and fields: complete files, alone and on several ranks, and nothing beside them."""

import xml.etree.ElementTree as ElementTree
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from dolfinx.io import XDMFFile
from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.files import read_csv
from fenicsmech.plot import Trace
from fenicsmech.simulation import gather

from ..plot.png import colour_fraction, png_size
from .demo_scenes import describe

pytestmark = pytest.mark.parallel

COMM = MPI.COMM_WORLD
FORCES = [0.0, 2.0, 5.0]
RIGID_GREY = (86, 91, 99)


@cache
def claw(space: str):
    """The claw gripper, coarse, on all ranks, and its curve."""
    scene, grasp = describe("claw")
    order, size = (1, 6.0) if space == "3d" else (2, 4.0)
    simulation = fm.Simulation(scene, space=space, order=order, size=size, comm=COMM)
    return simulation, simulation.load_displacement(grasp, forces=FORCES)


def names(folder: Path) -> set[str]:
    """Content of ``folder``, once all ranks are done with it."""
    COMM.Barrier()
    found = {path.name for path in folder.iterdir()}
    COMM.Barrier()
    return found


@pytest.mark.parametrize(
    "space", ["plane-stress", *(pytest.param(s, marks=pytest.mark.thorough) for s in ("3d-symmetric", "3d"))]
)
def test_fields_are_written_as_a_time_series_over_the_force(space, shared_tmp_path):
    simulation, curve = claw(space)
    path = shared_tmp_path / "new folder" / "claw.xdmf"
    curve.write(path)
    assert names(path.parent) == {"claw.xdmf", "claw.h5"}

    tree = ElementTree.parse(path)
    heavy = {item.text.strip().split(":")[0] for item in tree.iter("DataItem") if item.get("Format") == "HDF"}
    assert heavy == {"claw.h5"}
    attributes = {attribute.get("Name") for attribute in tree.iter("Attribute")}
    assert attributes == {"displacement", "von Mises stress", "largest principal strain", "stress", "strain"}
    for name in attributes:
        series = next(g for g in tree.iter("Grid") if g.get("Name") == name and g.get("GridType") == "Collection")
        assert [float(time.get("Value")) for time in series.iter("Time")] == FORCES

    with XDMFFile(COMM, str(path), "r") as file:
        mesh = file.read_mesh(name="mesh")
    topology = mesh.topology
    assert topology.index_map(topology.dim).size_global == len(simulation.model.mesh.cells)
    # HDF5 holds plain doubles: the largest displacement of the last frame stands among them
    snapshot = gather(simulation.model, curve.frames[-1])
    if snapshot is not None:
        largest = snapshot.displacement.ravel()[np.argmax(np.abs(snapshot.displacement))]
        heavy = path.with_suffix(".h5").read_bytes()
        with np.errstate(invalid="ignore"):
            distance = np.abs(np.frombuffer(heavy[: len(heavy) // 8 * 8]) - largest)
        assert np.nanmin(distance) <= 1e-12 * abs(largest)


def test_frames_of_a_load_that_returns_are_numbered(shared_tmp_path):
    simulation, curve = claw("plane-stress")
    path, first = shared_tmp_path / "loop.xdmf", float(FORCES[-1])
    simulation.load_displacement(curve.part, forces=[first, 0.5 * first, first]).write(path)
    COMM.Barrier()
    assert {float(time.get("Value")) for time in ElementTree.parse(path).iter("Time")} == {0.0, 1.0, 2.0}


def test_folders_that_cannot_be_written_are_refused_on_all_ranks(shared_tmp_path):
    _, curve = claw("plane-stress")
    if COMM.rank == 0:
        (shared_tmp_path / "no folder").touch()
    with pytest.raises(OSError, match="no folder"):
        curve.write(shared_tmp_path / "no folder" / "claw.xdmf")


def test_errors_of_one_rank_are_raised_on_all_and_leave_no_file(shared_tmp_path, monkeypatch):
    _, curve = claw("plane-stress")

    def failing(*arguments):
        if COMM.rank == 0:
            raise OSError("no space left")

    monkeypatch.setattr("fenicsmech.simulation.fields.write_series", failing)
    with pytest.raises(OSError, match="no space left"):
        curve.write(shared_tmp_path / "claw.xdmf")
    monkeypatch.setattr("fenicsmech.simulation.curve.MechanismPlotter", failing)
    with pytest.raises(OSError, match="no space left"):
        curve.picture(shared_tmp_path / "claw.png")
    assert names(shared_tmp_path) == set()


def test_files_of_an_earlier_run_are_replaced(shared_tmp_path):
    simulation, curve = claw("plane-stress")
    other = simulation.load_displacement(curve.part, forces=[1.0])
    path = shared_tmp_path / "claw.xdmf"
    curve.write(path)
    other.write(path)
    COMM.Barrier()
    times = {float(time.get("Value")) for time in ElementTree.parse(path).iter("Time")}
    assert times == set(other.forces)
    assert names(shared_tmp_path) == {"claw.xdmf", "claw.h5"}


@pytest.mark.parametrize(
    "space", ["plane-stress", *(pytest.param(name, marks=pytest.mark.thorough) for name in ("3d-symmetric", "3d"))]
)
def test_picture_shows_links_rigid_and_flexible(space, shared_tmp_path):
    simulation, curve = claw(space)
    (motor,) = simulation.scene.mechanism.motors
    turn = [simulation.scene.configuration(f"{angle}", {motor: angle}) for angle in (-0.2, 0.0, 0.2)]
    path = simulation.path(curve.part, turn)
    assert path[1] == pytest.approx(curve.part.at if space != "3d" else (*curve.part.at, 0.0), abs=1e-9)
    curve.picture(shared_tmp_path / "claw.png")
    traces = [Trace(path[:, :2], "tip", path[1:2, :2])]
    curve.picture(shared_tmp_path / "plain.png", stress=False, traces=traces, beside=[curve])
    assert names(shared_tmp_path) == {"claw.png", "plain.png"}
    for name in ("claw.png", "plain.png"):
        width, height = png_size(shared_tmp_path / name)
        assert width > 400 and height > 400
        assert colour_fraction(shared_tmp_path / name, RIGID_GREY) > 0.002
    assert (shared_tmp_path / "claw.png").read_bytes() != (shared_tmp_path / "plain.png").read_bytes()


def test_curve_is_drawn_and_tabulated(shared_tmp_path):
    _, curve = claw("plane-stress")
    curve.plot(shared_tmp_path / "curve.png")
    curve.write_csv(shared_tmp_path / "curve.csv")
    assert names(shared_tmp_path) == {"curve.png", "curve.csv"}
    assert min(png_size(shared_tmp_path / "curve.png")) > 300
    table = read_csv(shared_tmp_path / "curve.csv")
    assert table["force [N]"] == pytest.approx(FORCES, abs=0.0)
    assert table["displacement [mm]"] == pytest.approx(curve.displacements, abs=0.0)
    assert table["stable"] == pytest.approx([1.0, 1.0, 1.0])
    assert table["strain energy [N mm]"] == pytest.approx([frame.strain_energy for frame in curve.frames], abs=0.0)
    assert table["max von Mises [MPa]"] == pytest.approx([frame.max_stress for frame in curve.frames], abs=0.0)


def test_labels_name_the_units_of_the_scene(shared_tmp_path):
    units, beam = fm.Units(length="in", force="lbf", stress="psi"), fm.Mechanism("beam")
    ground, shape = beam.rigid("ground", fixed=True), fm.strip([(0, 0), (4, 0)], thickness=0.5, depth=0.5)
    beam.clamp(ground, strip := beam.flexible("strip", shape, fm.material("POM", units=units)), end="start", length=0.5)
    push = beam.force(on=strip, at=(4, 0), direction=(0, 1), region=fm.Disc(0.3))
    simulation = fm.Simulation(fm.Scene(beam, units=units), space="plane-stress", order=1, size=0.5, comm=COMM)
    simulation.load_displacement(push, forces=[1.0]).write_csv(shared_tmp_path / "curve.csv")
    COMM.Barrier()
    header = (shared_tmp_path / "curve.csv").read_text().splitlines()[0]
    assert all(label in header for label in ("displacement [in]", "force [lbf]", "[lbf in]", "[psi]"))
