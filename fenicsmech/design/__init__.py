"""Shape design of flexible links.

- ``sensitivity``: adjoint derivatives of displacements by design field, moduli and force
"""

from fenicsmech.design.sensitivity import Adjoint, Gradient

__all__ = ["Adjoint", "Gradient"]
