"""Lidars behind a pane and by a mirror: the validation's numbers, and that it finds faults."""

import numpy as np
import pytest

pytest.importorskip("embreex", reason="embreex, which casts the beams, is missing")

from omnisim.rendering.rays import cast_beams
from omnisim.validation import reflective_rooms
from omnisim.validation.checks.traced_images import beam_measures


def measures():
    rooms = reflective_rooms.rooms()
    at = reflective_rooms.camera_pose()
    return beam_measures(rooms["thin pane"], rooms["planar mirror"], at, firings=90)


def test_ranges_are_within_a_millimeter_and_intensities_within_a_percent():
    found = measures()
    assert [one.unit for one in found] == ["mm", "%", "mm", "%"]
    assert all(one.passed for one in found), found


def test_other_intensities_and_straight_mirrored_rays_are_found(monkeypatch):
    seen = cast_beams.surface_light

    def brighter(shading, view):
        light = seen(shading, view)
        return light._replace(passed=1.02 * light.passed, reflected=1.02 * light.reflected)

    monkeypatch.setattr(cast_beams, "surface_light", brighter)
    assert [measure.passed for measure in measures()] == [True, False, True, False]
    monkeypatch.setattr(cast_beams, "surface_light", seen)
    mirrored = cast_beams.mirrored_rays

    def late(caster, rays, hits, light):
        rays = mirrored(caster, rays, hits, light)
        return rays._replace(origins_m=rays.origins_m - 2e-3 * rays.directions)

    monkeypatch.setattr(cast_beams, "mirrored_rays", late)
    assert [bool(np.isfinite(measure.value)) and measure.passed for measure in measures()][
        2
    ] is False
