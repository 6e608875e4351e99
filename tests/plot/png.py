"""Just enough of the PNG format to measure a picture."""

from pathlib import Path

import numpy as np
from matplotlib.image import imread


def png_size(path: Path) -> tuple[int, int]:
    """Width and height in pixels, from the header."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


def colour_fraction(path: Path, colour: tuple[int, int, int], *, tolerance: int = 12) -> float:
    """Share of pixels whose three channels are within ``tolerance`` of ``colour`` (0 to 255)."""
    pixels = np.rint(255 * imread(path)[..., :3])
    return float((np.abs(pixels - colour) <= tolerance).all(axis=-1).mean())
