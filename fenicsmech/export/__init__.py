"""Links as STEP and STL files for manufacture: smooth curves through the mesh's boundary, extruded.

``write_step``      the solid, with ``PinHole``s
``write_stl``       its surface
``smooth_outline``  the curves through a closed polygon

``solid`` writes the section of a link between curves from corner to corner of its boundary (``outlines``).
"""

from fenicsmech.export.outlines import corners_of, smooth_outline
from fenicsmech.export.solid import PinHole, write_step, write_stl
