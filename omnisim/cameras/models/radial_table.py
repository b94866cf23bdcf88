"""Measured lens: radii in pixels at given angles, and a smooth monotone curve through them.

The curve is a cubic on each interval, with the slopes of Fritsch and Butland (PCHIP): it rises with
the table, without ripples in between.

Domain: 0 ≤ θ ≤ the table's last angle.

GLSL twin: `shaders/camera/radial_table.glsl`. Source: Fritsch & Butland, "A method for constructing
local monotone piecewise cubic interpolants", 1984.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from pydantic import Field

from omnisim.cameras.camera import Uniforms
from omnisim.cameras.lens_polynomials import solve_increasing
from omnisim.cameras.parametric_camera import Coefficients, PrincipalPoint, RadialCamera
from omnisim.core.arrays import Floats

MAX_NODES = 64  # array size in the GLSL twin
Nodes = Annotated[Coefficients, Field(min_length=2, max_length=MAX_NODES)]


@dataclass(frozen=True)
class RadialTableCamera(RadialCamera):
    """Lens given by a table of angles and radii."""

    principal_point_px: PrincipalPoint
    """(u, v) of the optical axis in the image; typically its center."""
    thetas_rad: Nodes
    """2 to 64 angles from the axis, increasing from 0; typically every 5°."""
    radii_px: Nodes
    """Radii at these angles, increasing from 0."""
    model_name = "radial_table"
    pixels_per_plane = 1.0  # the plane is in pixels

    def _check(self) -> None:
        super()._check()
        if len(self.thetas_rad) != len(self.radii_px):
            raise self._error("radii_px", "as many as thetas_rad")
        for name in ("thetas_rad", "radii_px"):
            values = getattr(self, name)
            if values[0] != 0.0 or min(np.diff(values)) <= 0.0:
                raise self._error(name, "values that rise from 0")
        if self.thetas_rad[-1] > math.pi:
            raise self._error("thetas_rad", "angles of at most π")

    @property
    def theta_edge_rad(self) -> float:
        """Angle from the axis where the domain ends: the last of the table."""
        return self.thetas_rad[-1]

    @cached_property
    def slopes_px(self) -> Floats:
        """Slopes dr/dθ (n,) at the table's angles.

        Source: weighted harmonic means inside; at the ends, the parabola through three points, kept
            monotone (Moler, "Numerical computing with MATLAB", section 3.6).
        """
        steps = np.diff(self.thetas_rad)
        chords = np.diff(self.radii_px) / steps
        if len(chords) == 1:
            return np.repeat(chords, 2)
        before, after = 2.0 * steps[1:] + steps[:-1], steps[1:] + 2.0 * steps[:-1]
        inner = (before + after) / (before / chords[:-1] + after / chords[1:])
        first = _end_slope(steps[0], steps[1], chords[0], chords[1])
        last = _end_slope(steps[-1], steps[-2], chords[-1], chords[-2])
        return np.array([first, *inner, last])

    def _local(self, theta: Floats) -> tuple[Floats, ...]:
        """Position t (...,) in an interval; its width, end radii, and end slopes times width."""
        nodes, radii = np.array(self.thetas_rad), np.array(self.radii_px)
        left = np.clip(np.searchsorted(nodes, theta, side="right") - 1, 0, len(nodes) - 2)
        width = nodes[left + 1] - nodes[left]
        t = (theta - nodes[left]) / width
        first, last = self.slopes_px[left] * width, self.slopes_px[left + 1] * width
        return t, width, radii[left], radii[left + 1], first, last

    def _radius_from_theta(self, theta: Floats) -> Floats:
        t, _, r0, r1, m0, m1 = self._local(theta)
        rise = r1 - r0
        return r0 + t * (m0 + t * (3.0 * rise - 2.0 * m0 - m1 + t * (m0 + m1 - 2.0 * rise)))

    def _slope(self, theta: Floats) -> Floats:
        t, width, r0, r1, m0, m1 = self._local(theta)
        rise = r1 - r0
        bend = 3.0 * rise - 2.0 * m0 - m1
        return (m0 + t * (2.0 * bend + 3.0 * t * (m0 + m1 - 2.0 * rise))) / width

    def _theta_from_radius(self, radius: Floats) -> Floats:
        return solve_increasing(
            self._radius_from_theta, self._slope, radius, 0.0, self.theta_edge_rad
        )

    def uniforms(self) -> Uniforms:
        """Values for `shaders/camera/radial_table.glsl`; the last entry pads the arrays."""
        fill = MAX_NODES - len(self.thetas_rad)
        slopes = tuple(self.slopes_px.tolist())
        return {
            "u_principal_point_px": self.principal_point_px,
            "u_thetas_rad": self.thetas_rad + self.thetas_rad[-1:] * fill,
            "u_radii_px": self.radii_px + self.radii_px[-1:] * fill,
            "u_slopes_px": slopes + slopes[-1:] * fill,
        }


def _end_slope(step: float, next_step: float, chord: float, next_chord: float) -> float:
    slope = ((2.0 * step + next_step) * chord - step * next_chord) / (step + next_step)
    return float(max(slope, 0.0))  # chords are positive, but the parabola's slope could fall
