"""stub"""
import os, time, pytest, sys
from mpi4py import MPI
R=MPI.COMM_WORLD.rank
MODE=os.environ.get("STUB","")
@pytest.mark.parallel
def test_shared(shared_tmp_path):
    assert len(set(MPI.COMM_WORLD.allgather(shared_tmp_path)))==1
    if R==0: (shared_tmp_path/"a").write_text("x")
    MPI.COMM_WORLD.barrier()
    assert (shared_tmp_path/"a").exists()
@pytest.mark.parallel
def test_one_fails():
    assert not (MODE=="fail1" and R==1), "rank one unhappy"
@pytest.mark.parallel
def test_skip():
    pytest.skip("x")
@pytest.mark.parallel
def test_hang():
    if MODE=="hang" and R==1: assert False,"x"
    if MODE=="hang": MPI.COMM_WORLD.barrier()
def test_imports():
    import dolfinx, gmsh, slepc4py, petsc4py, scipy, sympy, matplotlib, matplotlib.pyplot
    from petsc4py import PETSc
    from slepc4py import SLEPc
    import ufl
    from dolfinx import mesh, fem
    m = mesh.create_unit_square(MPI.COMM_WORLD, 3, 3)
    f = fem.form(ufl.as_ufl(3.0)*ufl.dx(m))
    assert abs(fem.assemble_scalar(f)-3)<1e-12
def test_mpirun(mpirun, tmp_path):
    (tmp_path/"s.py").write_text("from mpi4py import MPI\nprint(MPI.COMM_WORLD.size)")
    assert mpirun(2, tmp_path/"s.py").stdout.split()==["2","2"]
