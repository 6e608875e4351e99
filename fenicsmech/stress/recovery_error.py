"""Estimated error of recovered values, from two other fits.

With weights exp(−a |X − X_v|² / R²) a fit reaches over lengths ~ R / √a; one of degree k is off by ~ a^(−(k+1)/2). With
v_(k, a) the value recovered by fits of degree k and decay a, half the decay tells by how much,

    s = (v_(k, a/2) − v_(k, a)) / (2^((k+1)/2) − 1)          (Richardson).

Elements leave errors too, which another fit takes up in other shares. One of the next degree and half the decay reaches
about as far, so that it sees about as many elements:

    r = v_(k+1, a/2) − v_(k, a),     |error| ≈ √(s² + r²).

Neither sees errors that are alike in all elements of a patch. The error of the fit, what the samples keep of the
elements' errors, and the error of the displacement may have either sign, and are about as large as each other in fine
elements: errors below half a per cent are what these leave of each other, and the estimate is a bound of them.
"""

from __future__ import annotations

import numpy as np

SMOOTHER, HIGHER = (0, 0.5), (1, 0.5)
"""Degrees more and times the decay of the other fits."""


def recovery_error(value: np.ndarray, smoother: np.ndarray, higher: np.ndarray, degree: int) -> np.ndarray:
    """Estimated errors √(s² + r²) of recovered values.

    Args:
        value: those recovered by fits of ``degree``, any shape.
        smoother: by fits of half the decay.
        higher: by fits of one degree more and half the decay.
        degree: k.
    """
    times = 1.0 / SMOOTHER[1]
    return np.hypot((smoother - value) / (times ** (0.5 * (degree + 1)) - 1.0), higher - value)
