"""Files that links are read from."""

from __future__ import annotations

from pathlib import Path

from fenicsmech.errors import MeshingError


def require_header(path: Path, header: str, *, kind: str, part: str) -> None:
    """Make sure that ``path`` is a file of the right kind before gmsh guesses what to do with it.

    Args:
        path: the file.
        header: text with which such files begin.
        kind: what the file should be, for messages.
        part: the link, for messages.

    Raises:
        MeshingError: the file cannot be read, or begins otherwise.
    """
    try:
        with open(path, "rb") as file:
            start = file.read(len(header) + 64).lstrip()
    except OSError as failure:
        raise MeshingError(
            part, f"the {kind} {str(path)!r} cannot be read ({failure.strerror})", "Check the path"
        ) from failure
    if not start.startswith(header.encode()):
        raise MeshingError(
            part, f"{str(path)!r} is not a {kind}: it does not begin with {header!r}", f"Give the path of a {kind}"
        )
