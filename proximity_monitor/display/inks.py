"""Colours to send for lines and instances, so that the picture shows the colours that are meant.

viser's picture takes the colours of lines for linear light, and maps their tones by the film curve
of ACES, as three.js does by default (the fit of S. Hill: a matrix, a rational function of each
channel, another matrix). So vermilion sent as such would be drawn as yellow, and so would orange.
This module inverts that mapping.
"""

from __future__ import annotations

import numpy as np

EDGE = (45, 50, 60)
"""Colour of parts' edges."""

_EXPOSURE = 0.6
_INTO = np.array(
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]]
)
_OUT_OF = np.array(
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]]
)
# The curve is (v (v + A) - B) / (v (C v + D) + E).
_A, _B, _C, _D, _E = 0.0245786, 0.000090537, 0.983729, 0.4329510, 0.238081


def sent(colours: np.ndarray) -> np.ndarray:
    """Return the colours to send (n, 3), 0 to 255, for lines drawn in sRGB colours (n, 3).

    A colour that the film curve cannot give, such as a pure blue, comes as near as possible.
    """
    y = _light(colours) @ np.linalg.inv(_OUT_OF).T
    # Invert the curve: v is the greater root of a quadratic equation.
    a, b, c = 1.0 - _C * y, _A - _D * y, -_B - _E * y
    v = (-b + np.sqrt(np.maximum(b * b - 4.0 * a * c, 0.0))) / (2.0 * a)
    light = _EXPOSURE * (v @ np.linalg.inv(_INTO).T)
    return np.round(255.0 * np.clip(light, 0.0, 1.0)).astype(np.uint8)


def linear(colours: np.ndarray) -> np.ndarray:
    """Return the colours to send (n, 3), 0 to 255, so that instances look like meshes of `colours`.

    viser's picture takes colours of meshes for sRGB, but those of instances for linear light.
    """
    return np.round(255.0 * _light(colours)).astype(np.uint8)


def _light(colours: np.ndarray) -> np.ndarray:
    """Return sRGB colours, 0 to 255, as linear light, 0 to 1 (IEC 61966-2-1)."""
    share = np.asarray(colours, float) / 255.0
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
