"""gmsh sessions always end, report the reason of a failure, and leave Ctrl-C to Python."""

import os
import signal
import subprocess
import sys

import pytest

from fenicsmech.errors import MeshingError
from fenicsmech.mechanism import strip
from fenicsmech.meshing import gmsh, gmsh_session, mesh_link


def assert_gmsh_works():
    mesh = mesh_link("bar", strip([(0, 0), (10, 0)], thickness=2, depth=1), dim=2, size=1.0)
    assert len(mesh.cells) > 10


def test_an_error_of_gmsh_becomes_one_that_names_the_part_and_the_reason():
    with pytest.raises(MeshingError, match=r"link 'rod': gmsh reports '.*curve.*'"), gmsh_session("link 'rod'"):
        gmsh.model.occ.addCurveLoop([77])
    assert_gmsh_works()


def test_other_errors_pass_through_and_end_the_session():
    with pytest.raises(LookupError, match="mine"), gmsh_session("link 'rod'"):
        raise LookupError("mine")
    assert_gmsh_works()


def test_ctrl_c_reaches_python_inside_and_after_a_session(python_interrupts):
    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt), gmsh_session("link 'rod'"):
        assert signal.getsignal(signal.SIGINT) is handler
        os.kill(os.getpid(), signal.SIGINT)
        signal.sigtimedwait([], 1.0)
    assert signal.getsignal(signal.SIGINT) is handler
    assert_gmsh_works()


@pytest.fixture
def python_interrupts():
    """Python's own handler of Ctrl+C: shells start background jobs with the signal ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_importing_and_meshing_print_nothing_and_keep_the_interrupt_handler():
    script = (
        "import signal; before = signal.getsignal(signal.SIGINT)\n"
        "from fenicsmech.mechanism.shapes import strip\n"
        "from fenicsmech.meshing import mesh_link\n"
        "mesh_link('bar', strip([(0, 0), (10, 0)], thickness=2, depth=1), dim=3, size=1.0)\n"
        "assert signal.getsignal(signal.SIGINT) is before\n"
    )
    # os.environ, unlike the environment of this process, lacks what MPI_Init put there
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=dict(os.environ))
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
