"""Nodes that enclose a point, by hand."""

import dataclasses

import numpy as np
import pytest

from omnisim.scene.model import AlphaMode, Material, Mesh
from omnisim.scene.space.enclosure import enclosing_nodes
from tests import scenes

# The unit cube's corners and its sides, counter-clockwise from outside, z up.
CORNERS = np.array([(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=np.float32)
SIDES = {
    "bottom": (0, 2, 3, 1), "top": (4, 5, 7, 6), "front": (1, 3, 7, 5), "back": (0, 4, 6, 2),
    "left": (2, 6, 7, 3), "right": (0, 1, 5, 4),
}  # fmt: skip


PLAIN = (Material(),)


def halves(sides):
    return np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))], dtype=np.uint32)


def scene_of(parts, materials=PLAIN):
    """Scene of nodes: name, triangles of the cube, scale, center, material."""
    meshes, poses = [], []
    for name, triangles, scale, center, material in parts:
        meshes.append(Mesh(name, CORNERS, triangles, material))
        poses.append(np.diag((*np.broadcast_to(scale, 3).astype(float), 1.0)))
        poses[-1][:3, 3] = center
    scene = scenes.scene_of(meshes, materials, poses)
    named = zip(scene.instances, meshes, strict=True)
    instances = tuple(dataclasses.replace(one, name=mesh.name) for one, mesh in named)
    return dataclasses.replace(scene, instances=instances)


def box(name="box", scale=1.0, center=(0, 0, 0), sides=SIDES, material=0):
    return name, halves([SIDES[side] for side in sides]), scale, center, material


@pytest.mark.parametrize(
    ("point", "inside"),
    [
        ((0, 0, 0), True),
        ((0.999, 0.999, -0.999), True),
        ((1.001, 0, 0), False),
        ((0, 0, 5), False),
        ((1.001, 1.001, 1.001), False),
        ((1e6, 1e6, 0), False),
    ],
)
@pytest.mark.parametrize("inside_out", [False, True])
def test_box(point, inside, inside_out):
    name, triangles, *rest = box()
    scene = scene_of([(name, triangles[:, ::-1] if inside_out else triangles, *rest)])
    assert enclosing_nodes(scene, point) == (("box",) if inside else ())


def test_all_nodes_around_a_point_enclose_it():
    scene = scene_of([box("near"), box("far", center=(5, 0, 0)), box("large", 3.0)])
    assert enclosing_nodes(scene, (0, 0, 0)) == ("near", "large")
    assert enclosing_nodes(scene, (0, 0, 0), ignored=("near",)) == ("large",)
    assert enclosing_nodes(scene, (0, 0, 0), ignored=("near", "large")) == ()


def test_sides_that_close_together_enclose():
    scene = scene_of([box(side, sides=(side,)) for side in SIDES])
    assert enclosing_nodes(scene, (0.2, 0.1, 0.3)) == tuple(SIDES)
    assert enclosing_nodes(scene, (0.2, 0.1, 1.3)) == ()


def test_parts_of_one_node_count_as_one():
    scene = scene_of([box("hull", sides=list(SIDES)[:3]), box("hull", sides=list(SIDES)[3:])])
    assert enclosing_nodes(scene, (0, 0, 0)) == ("hull",)


def test_on_a_deck_is_not_inside_of_it():
    deck = scene_of([box("deck", (5.0, 5.0, 0.1))])
    assert enclosing_nodes(deck, (0, 0, 0.1 + 1e-6)) == ()
    assert enclosing_nodes(deck, (0, 0, 0.1 - 1e-6)) == ("deck",)
    plate = scene_of([box("plate", 1e3, sides=("top",))])
    for height in (-1e-3, 1e-3):
        assert enclosing_nodes(plate, (0, 0, 1e3 + height)) == ()


def test_triangles_before_the_near_plane_do_not_enclose():
    cap = scene_of([box("cap", 0.02)])  # its corners are 35 mm away
    assert enclosing_nodes(cap, (0, 0, 0), near_m=0.03) == ("cap",)
    assert enclosing_nodes(cap, (0, 0, 0), near_m=0.04) == ()
    # within reach of a lid, whose corners are farther: still inside
    assert enclosing_nodes(scene_of([box("case")]), (0, 0, 0.99), near_m=0.05) == ("case",)


def test_blended_surfaces_do_not_enclose():
    glass = Material(alpha_mode=AlphaMode.BLEND)
    scene = scene_of([box("tube", material=1), box("case", 2.0)], (*PLAIN, glass))
    assert enclosing_nodes(scene, (0, 0, 0)) == ("case",)


def test_degenerate_triangles_and_points_on_surfaces():
    name, triangles, *rest = box()
    flat = np.array([(0, 0, 0), (1, 1, 2), (0, 7, 0)], dtype=np.uint32)
    scene = scene_of([(name, np.concatenate((triangles, flat)), *rest)])
    assert enclosing_nodes(scene, (0, 0, 0)) == ("box",)
    assert enclosing_nodes(scene, (5, 0, 0)) == ()
    enclosing_nodes(scene, (1, 1, 1))
    enclosing_nodes(scene, (1, 0, 0))
