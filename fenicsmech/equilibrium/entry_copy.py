"""A matrix by entries that follows one by blocks of the same pattern.

PETSc's conversion finds the place of each entry anew, which takes a third as long as assembling them all. Here it is
asked once, with the numbers of the entries for values; from then on values are copied in that order. petsc4py shows the
arrays of values of neither format, hence PETSc's own functions.
"""

from __future__ import annotations

import ctypes

import numpy as np
from petsc4py import PETSc

_LIBRARY = ctypes.CDLL(PETSc.__file__)  # PETSc is linked to it
_LOCAL, _INFO, _USED = 1, 10, 2  # MAT_LOCAL; members of MatInfo, all doubles, and the place of nz_used among them
_Pointer = ctypes.c_void_p


class EntryCopy:
    """The copy (collective).

    Args:
        blocked: the matrix by blocks, assembled, whose pattern does not change any more.

    Attributes:
        matrix: its copy by entries, good after an ``update``.
    """

    def __init__(self, blocked: PETSc.Mat) -> None:
        self._blocked, self.matrix = blocked, PETSc.Mat()
        kept = [values.copy() for values in _values(blocked, "BAIJ")]
        for values in _values(blocked, "BAIJ"):
            values[:] = np.arange(len(values))
        blocked.convert(PETSc.Mat.Type.AIJ, self.matrix)
        self._order = [numbers.astype(np.int32) for numbers in _values(self.matrix, "AIJ")]
        for values, before in zip(_values(blocked, "BAIJ"), kept, strict=True):
            values[:] = before

    def update(self) -> None:
        """Takes the values of the matrix by blocks (collective)."""
        pairs = zip(_values(self._blocked, "BAIJ"), _values(self.matrix, "AIJ"), self._order, strict=True)
        for values, entries, order in pairs:
            np.take(values, order, out=entries, mode="clip")  # the only mode that takes without a copy
        self.matrix.stateIncrease()


def _values(matrix: PETSc.Mat, kind: str) -> list[np.ndarray]:
    """The values that this rank stores in a matrix of ``kind``, in its own columns and in those of others."""
    parts = [_Pointer(matrix.handle)]
    if matrix.comm.size > 1:
        parts = [_Pointer(), _Pointer()]
        # the columns' numbers are of no interest
        _call(f"MatMPI{kind}GetSeq{kind}", _Pointer(matrix.handle), *map(ctypes.byref, parts), None)
    found = []
    for part in parts:
        info, values = (ctypes.c_double * _INFO)(), ctypes.POINTER(ctypes.c_double)()
        _call("MatGetInfo", part, ctypes.c_int(_LOCAL), info)
        _call(f"MatSeq{kind}GetArray", part, ctypes.byref(values))
        count = int(info[_USED])
        found.append(np.ctypeslib.as_array(values, (count,)) if count else np.empty(0))
    return found


def _call(name: str, *arguments) -> None:
    """One of PETSc's functions."""
    if code := getattr(_LIBRARY, name)(*arguments):
        raise RuntimeError(f"{name} of PETSc failed with code {code}")
