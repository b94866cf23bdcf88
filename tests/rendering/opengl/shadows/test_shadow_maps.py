"""Shadows of the virtual cameras: against geometry, against rays, and as things move."""

from ctypes import c_int, c_uint, c_void_p
from dataclasses import replace

import numpy as np
import pytest

from omnisim.cameras import pixel_grid
from omnisim.core.poses import pose
from omnisim.core.world import WorldState
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.opengl.gl.functions import gl_function
from omnisim.rendering.opengl.scene_view import SceneView
from omnisim.rendering.opengl.shadows import shadow_plan
from omnisim.rendering.opengl.shadows.shadow_drawer import CasterDrawer
from omnisim.rendering.opengl.shadows.shadow_maps import LEVELS, ShadowMaps
from omnisim.rendering.opengl.shadows.shadow_plan import ShadowPlan, make_shadow_plan
from omnisim.rendering.stage import Stage, open_sensor
from omnisim.scene.labels import BODY
from omnisim.scene.model import AlphaMode, Light, Lighting, LightKind, Material, Texture
from tests.rendering.frames import assert_batch_is_frames, each_backend, frame_of
from tests.scenes import room, scene_of, square

pytestmark = pytest.mark.usefixtures("needs_opengl")

FLOOR_LIGHT, AMBIENT = 0.6, 0.1
HEIGHT_M, HALF_M = 1.0, 0.5
VIEWPOINT_M = np.array([0.3, -0.2, 0.8])
LAMP_M = np.array([0.4, 0.3, 2.5])


DOWN, SLANTED = np.array([0.0, 0.0, -1.0]), np.array([0.36, -0.48, -0.8])


def _light(kind, position_m=LAMP_M, direction=SLANTED, **options):
    return Light(kind, (1.0, 1.0, 1.0), 1.0, position_m, direction, **options)


LIGHTS = {
    "directional": _light(LightKind.DIRECTIONAL),
    "point": _light(LightKind.POINT),
    "spot": _light(LightKind.SPOT, direction=DOWN, cone_cosines=(0.7, 0.6)),
    "wide-spot": _light(LightKind.SPOT, direction=DOWN, cone_cosines=(0.3, 0.1)),
}


CAMERA = OmniCamera(polygons=None).resized(120)
HERE = CAMERA.base_pose(VIEWPOINT_M, yaw_deg=20.0)
BOTH_SIDES = Material(double_sided=True)


def _lighting(*lights):
    return Lighting((AMBIENT,) * 3, lights, exposure=1.0)


def _unshadowed(scene):
    return replace(scene, lighting=scene.lighting.with_shadows(False))


def _table(material=0):
    """A floor, and a square above it."""
    return [square(6.0), square(HALF_M, HEIGHT_M, material=material, name="table")]


def _render(scene, backend="cube", camera=CAMERA):
    return frame_of(scene, camera, HERE, backend, linear=True).linear[..., 1]


def _is_shadowed(light, points_m):
    """Mask of points (n, 3) of the floor from where the table hides the lamp."""
    if light.kind is LightKind.DIRECTIONAL:
        toward = np.broadcast_to(-light.direction, points_m.shape)
    else:
        toward = light.position_m - points_m
    at_m = points_m + toward * (HEIGHT_M - points_m[..., 2:]) / toward[..., 2:]
    return np.all(np.abs(at_m[..., :2]) < HALF_M, axis=-1)


@pytest.mark.parametrize("light", LIGHTS.values(), ids=LIGHTS.keys())
def test_edges_of_shadows_are_where_geometry_has_them(light):
    scene = scene_of(_table(), lighting=_lighting(light))
    shown, lit = _render(scene), _render(_unshadowed(scene))
    # samples of the pixels on the floor
    model, side = CAMERA.model, 6
    fine = (pixel_grid(model.width_px * side, model.height_px * side) + 0.5) / side - 0.5
    rays, has_ray = model.ray_from_pixel(fine)[:2]
    world_from_optical = HERE[:3, :3] @ model.rig_from_optical
    directions = rays @ world_from_optical.T
    with np.errstate(all="ignore"):
        floor_m = VIEWPOINT_M + directions * (-VIEWPOINT_M[2] / directions[..., 2:])
    on_floor = has_ray & (directions[..., 2] < -0.2) & (np.abs(floor_m).max(axis=-1) < 5.0)
    dark = _is_shadowed(light, np.nan_to_num(floor_m))

    def of_pixels(mask):
        height, width = mask.shape
        return mask.reshape(height // side, side, width // side, side).mean(axis=(1, 3))

    whole = of_pixels(on_floor) == 1.0
    dark = of_pixels(dark)
    assert (dark[whole] == 1.0).sum() > 100
    seen = (lit - shown) / np.maximum(lit - AMBIENT, 1e-3)
    off = np.abs(seen - dark)[whole & (lit > AMBIENT + 0.02)]
    edge_px = np.count_nonzero((dark > 0.0) & (dark < 1.0) & whole)
    # areas of wrong light over the length of the edges: how far they are off, in pixels
    assert off.sum() / edge_px < 0.5
    assert np.mean(off > 0.02) < 2.0 * edge_px / off.size


@pytest.mark.parametrize("name", ["point", "wide-spot"])
def test_a_convex_room_has_no_shadow(name):
    at = LAMP_M * (1.0, 1.0, 0.4)
    lighting = _lighting(replace(LIGHTS[name], position_m=at))
    poses = [pose((0.0, 0.0, 0.0), yaw_deg=37.0, roll_deg=18.5)]
    scene = scene_of([room()], [BOTH_SIDES], poses, lighting)
    shown, expected = (
        _render(one, camera=CAMERA.resized(240)) for one in (scene, _unshadowed(scene))
    )
    # in its corners a map's texel has two walls
    assert np.mean(np.abs(shown - expected) > 0.01) < 0.003
    np.testing.assert_allclose(shown, expected, atol=0.08)


def _leaves():
    pixels = np.full((2, 2, 4), 255, dtype=np.uint8)
    pixels[0, 0, 3] = pixels[1, 1, 3] = 0
    return Texture(pixels)


MATERIALS = {
    "one-sided": Material(base_color=(0.8, 0.2, 0.2, 1.0)),
    "holes": Material(texture=_leaves(), alpha_mode=AlphaMode.MASK, double_sided=True),
    "clear": Material(base_color=(1, 1, 1, 0.3), alpha_mode=AlphaMode.BLEND, double_sided=True),
    "dense": Material(base_color=(1, 1, 1, 0.7), alpha_mode=AlphaMode.BLEND, double_sided=True),
}


def _flat(mesh, material):
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32) * 0.5 + 0.25
    return replace(mesh, material=material, texture_coordinates=uv)


@pytest.mark.parametrize(
    ("name", "kind"), [*((name, "directional") for name in MATERIALS), ("holes", "point")]
)
def test_materials_cast_the_shadows_of_rays(name, kind):
    pytest.importorskip("embreex")
    material, light = MATERIALS[name], LIGHTS[kind]
    floor, table = _table()
    # upside down: a front that the lamp does not see
    table = replace(_flat(table, 1), triangles=table.triangles[:, ::-1].copy())
    scene = scene_of([floor, table], [BOTH_SIDES, material], lighting=_lighting(light))
    shown, expected = _render(scene), _render(scene, "rays")
    assert np.sqrt(np.mean((shown - expected) ** 2)) < 0.02
    if name == "clear":
        np.testing.assert_allclose(shown, _render(_unshadowed(scene)), atol=1e-3)


@each_backend
def test_materials_may_cast_no_shadow(backend):
    materials = [BOTH_SIDES, replace(BOTH_SIDES, casts_shadow=False)]
    scene = scene_of(_table(1), materials, lighting=_lighting(LIGHTS["directional"]))
    plain = _render(_unshadowed(scene), backend)
    np.testing.assert_allclose(_render(scene, backend), plain, atol=1e-3)


@pytest.mark.parametrize("transmission", [0.9, 0.3])
def test_clear_glass_casts_no_shadow_and_dark_glass_does(transmission):
    pane = Material(specular=1.0, roughness=0.0, transmission=transmission, double_sided=True)
    scene = scene_of(_table(1), [BOTH_SIDES, pane], lighting=_lighting(LIGHTS["directional"]))
    other = _unshadowed(scene)
    if transmission < 0.5:  # its gloss has shadows, too, of which it casts none on itself
        other = replace(scene, materials=(BOTH_SIDES, replace(pane, transmission=0.0)))
    shown, expected = _render(scene), _render(other)
    # below the floor's horizon of the glass: pixels that show the floor alone
    is_floor = np.abs(expected - AMBIENT) < 1e-3
    assert (transmission > 0.5) or is_floor.sum() > 100
    some = is_floor if transmission < 0.5 else np.isfinite(shown)
    np.testing.assert_allclose(shown[some], expected[some], atol=1e-3)


def _moving():
    return scene_of([square(0.25, 0.0, name="moving")], [BOTH_SIDES])


def _state(place, base=HERE):
    return WorldState({BODY: base, "moving": pose(place)})


PLACES = [(0.2, 0.1, 1.0), (-0.6, 0.5, 0.7), (0.2, 0.1, 1.0)]


@pytest.mark.parametrize("name", ["directional", "point", "wide-spot"])
def test_shadows_of_what_moves_follow_it(name):
    """The same bytes as if it had been drawn there first, whatever was drawn before."""
    scene = scene_of([square(6.0)], lighting=_lighting(LIGHTS[name]))
    states = [_state(place) for place in PLACES]
    with Stage(scene, dynamic_objects={"moving": _moving()}) as stage:
        renderer = stage.open(CAMERA)
        frames = [renderer.render(state, linear=True).linear for state in states]
        assert_batch_is_frames(renderer, states)
    assert np.array_equal(frames[0], frames[2])
    assert not np.array_equal(frames[0], frames[1])
    # as static geometry it is rounded elsewhere
    still = scene.added("moving", _moving(), pose(PLACES[1]))
    assert np.mean(np.abs(_render(still) - frames[1][..., 1]) > 0.01) < 2e-3


def test_batches_by_several_lights_are_single_frames():
    lights = _lighting(*(replace(light, intensity=0.3) for light in LIGHTS.values()))
    scene = scene_of([*_table(), square(0.3, 1.8)], lighting=lights)
    with open_sensor(scene, CAMERA) as renderer:
        assert_batch_is_frames(
            renderer, [CAMERA.base_pose(VIEWPOINT_M + (0.1 * i, 0, 0)) for i in range(4)]
        )


def _in_batches(renderer, states, monkeypatch):
    """Images of a batch, and whether they were drawn together."""
    groups = []
    with monkeypatch.context() as patch:
        draw = SceneView.draw
        patch.setattr(SceneView, "draw", lambda *given: groups.append(given) or draw(*given))
        return renderer.render_batch(states), len(groups) == 1


@pytest.mark.parametrize("name", ["directional", "point"])
def test_a_batch_in_a_world_that_rests_is_drawn_together(name, monkeypatch):
    """Shadows of what moves are drawn once for all viewpoints, and again when it has moved."""
    scene = scene_of([square(6.0)], lighting=_lighting(LIGHTS[name]))
    eyes = [VIEWPOINT_M, VIEWPOINT_M + (0.3, 0.2, 0.0), VIEWPOINT_M - 0.1]
    with Stage(scene, dynamic_objects={"moving": _moving()}) as stage:
        renderer = stage.open(CAMERA)
        rests = [
            [_state(place, CAMERA.base_pose(at, yaw_deg=10.0)) for at in eyes] for place in PLACES
        ]
        for states in (*rests, rests[0][:1] + rests[1][1:]):
            batch, is_together = _in_batches(renderer, states, monkeypatch)
            assert is_together == (states in rests)
            single = [renderer.render(state).rgb for state in states]
            assert np.array_equal(batch, single)
            assert len({image.tobytes() for image in batch}) == 3


def test_edited_instances_cast_shadows_where_they_are():
    scene = scene_of(_table(), lighting=_lighting(LIGHTS["point"]))
    edited = scene.moved("object 1", pose((0.5, 0.2, 0.3)))
    with open_sensor(scene, CAMERA) as renderer:
        before = renderer.render(HERE).rgb
        renderer.scene = edited
        moved = renderer.render(HERE).rgb
        renderer.scene = scene
        assert np.array_equal(renderer.render(HERE).rgb, before)
    expected = frame_of(edited, CAMERA, HERE).rgb
    # one is drawn by its matrix, the other one's vertices are in the world
    assert np.mean(np.abs(moved.astype(int) - expected) > 1) < 1e-3


def test_cascades_are_around_the_viewpoint(monkeypatch):
    """Far apart in a large scene, shadows are as fine as in a small one."""
    light = LIGHTS["directional"]
    small = _render(scene_of(_table(), lighting=_lighting(light)))
    away_m = np.array([400.0, -300.0, 0.0])
    moved = [pose(away_m), pose(away_m), pose((-600.0, 600.0, 0.0))]
    large = scene_of([*_table(), square(0.5)], poses=moved, lighting=_lighting(light))
    with open_sensor(large, CAMERA) as renderer:
        renderer.render(CAMERA.base_pose((0.0, 0.0, 1.0)))
        there = CAMERA.base_pose(VIEWPOINT_M + away_m, yaw_deg=20.0)
        shown = renderer.render(there, linear=True).linear[..., 1]
        beside = CAMERA.base_pose(VIEWPOINT_M + away_m + 0.02, yaw_deg=60.0)
        for states, has_same_maps in [([there, beside], True), ([there, HERE], False)]:
            batch, is_together = _in_batches(renderer, states, monkeypatch)
            assert is_together == has_same_maps
            assert np.array_equal(batch, [renderer.render(state).rgb for state in states])
    assert np.mean(np.abs(shown - small) > 0.02) < 0.01


DEPTH_COMPONENT, FLOAT = 0x1902, 0x1406
MOVED = pose((0.5, 0.2, 1.5))
WALK_M = [(0, 0), (3, 0.5), (4.5, -4), (-1, -7), (-8, -2), (-2, 2.5)]


def _depths(maps):
    """All levels of shadow maps; moderngl reads only the first."""
    read = gl_function("glGetTextureImage", c_uint, c_int, c_uint, c_uint, c_int, c_void_p)
    levels = []
    for level in range(LEVELS):
        width, height = (side >> level for side in maps.size_px)
        depth = np.empty((height, width), dtype=np.float32)
        read(maps.texture.glo, level, DEPTH_COMPONENT, FLOAT, depth.nbytes, depth.ctypes.data)
        levels.append(depth)
    return levels


def _walk(scene, walk_m, dynamic_objects, monkeypatch):
    """Depths of the sun's maps, and the number of texels drawn to keep them, for each place."""
    camera, drawn_px, used = CAMERA.resized(60), [], []
    draw_part, prepare = CasterDrawer.draw_part, ShadowMaps.prepare

    def counted(self, target, part, *given):
        drawn_px.append(part.part_px[2] * part.part_px[3])
        draw_part(self, target, part, *given)

    steps = []
    with monkeypatch.context() as patch, Stage(scene, dynamic_objects=dynamic_objects) as stage:
        patch.setattr(CasterDrawer, "draw_part", counted)
        patch.setattr(
            ShadowMaps, "prepare", lambda *given: used.append(given[0]) or prepare(*given)
        )
        renderer = stage.open(camera)
        for x, y in walk_m:
            drawn_px.clear()
            state = {BODY: camera.base_pose((x, y, 0.8))}
            renderer.render(WorldState(state | {name: MOVED for name in dynamic_objects}))
            with stage.current():
                steps.append((_depths(used[-1]._maps[-1]), sum(drawn_px)))
    return steps


@pytest.mark.parametrize("moving", [{}, {"moving": _moving()}], ids=["static", "dynamic"])
def test_cascades_keep_what_they_have_drawn(moving, monkeypatch):
    """The same bytes as if all had been drawn there, though little is drawn on the way."""
    monkeypatch.setattr(shadow_plan, "_CASCADE_PX", 512)
    materials = [BOTH_SIDES, MATERIALS["dense"]]
    # wider than the finest cascade, so that what is left behind would show
    places = [(x, y, 0.4 + 0.1 * (x % 5)) for x in range(-26, 27, 4) for y in range(-26, 27, 13)]
    tables = [square(0.7, material=i % 2, name=f"table {i}") for i in range(len(places))]
    far = [square(0.5), square(0.5)]
    poses = [pose((0, 0, 0)), *map(pose, places), pose((700, -600, 0)), pose((-700, 600, 0))]
    lighting = _lighting(LIGHTS["directional"])
    scene = scene_of([square(300.0), *tables, *far], materials, poses, lighting)

    kept = _walk(scene, WALK_M, moving, monkeypatch)
    anew = _walk(
        scene, [at for place in WALK_M for at in (place, (400.0, 300.0))], moving, monkeypatch
    )
    for (depths, kept_px), (expected, all_px) in zip(kept[1:], anew[2::2], strict=True):
        assert 0 < kept_px < 0.5 * all_px
        for level, depth in enumerate(depths):
            assert np.array_equal(depth, expected[level])
            assert np.array_equal(depth, depths[0][:: 1 << level, :: 1 << level])

    # each map drawn as a whole: other matrices round differently
    monkeypatch.setattr(ShadowPlan, "follows_viewpoint", False)
    none = property(lambda plan: np.zeros(len(plan.rectangles_px), dtype=np.bool_))
    monkeypatch.setattr(ShadowPlan, "maps_that_follow", none)
    [(whole, _)] = _walk(scene, WALK_M[-1:], moving, monkeypatch)
    assert np.mean(whole[0] > 0.0) > 0.2
    assert np.mean(np.abs(kept[-1][0][0] - whole[0]) > 1e-5) < 1e-4


def test_only_a_step_of_a_cascade_needs_new_matrices(monkeypatch):
    planned, clips = [], ShadowPlan.clips
    monkeypatch.setattr(shadow_plan, "_CASCADE_PX", 64)
    monkeypatch.setattr(ShadowPlan, "clips", lambda *given: planned.append(given) or clips(*given))
    scene = scene_of([square(300.0)], lighting=_lighting(LIGHTS["directional"]))
    camera, counts = CAMERA.resized(24), []
    with open_sensor(scene, camera) as renderer:
        for x_m in (0.1, 0.11, 0.1, 40.0, 40.0):
            renderer.render(camera.base_pose((x_m, 0.1, 0.8)))
            counts.append(len(planned))
    first = counts[0]
    assert counts == [first, first, first, first + 1, first + 1]


def test_many_lamps_share_bounded_memory():
    lights = [replace(LIGHTS["point"], position_m=LAMP_M + (0.02 * i, 0, 0)) for i in range(32)]
    plan = make_shadow_plan(_lighting(*lights), np.array([[[-5.0] * 3, [5.0] * 3]]), 16384)
    assert plan.width_px * plan.height_px <= 1 << 25
    left, top, width, height = plan.rectangles_px.T
    assert (left + width).max() <= plan.width_px
    assert (top + height).max() <= plan.height_px
    corners = np.stack((left, top), axis=1)
    assert len(np.unique(corners, axis=0)) == 32 * 6


def test_many_suns_keep_their_cascades_apart():
    suns = [_light(LightKind.DIRECTIONAL, direction=np.array([0.6, 0.0, -0.8]))] * 40
    plan = make_shadow_plan(_lighting(*suns), np.array([[[-900.0] * 3, [900.0] * 3]]), 16384)
    size_px, places_px = plan.blocks[0].size_px, plan.kept_places_px
    assert len(np.unique(places_px, axis=0)) == np.count_nonzero(plan.maps_that_follow) == 40 * 3
    assert np.all(places_px % size_px == 0)
    assert np.all(places_px + size_px <= plan.kept_size_px)
    assert np.all(np.array(plan.kept_size_px) <= (plan.width_px, plan.height_px))


@pytest.mark.parametrize(
    ("kind", "scale"),  # what is very near to a lamp casts no shadow
    [
        ("directional", 1e-3),
        ("directional", 1e3),
        ("point", 1.0),
        ("point", 1e3),
    ],
)
@pytest.mark.parametrize("grazing_deg", [1.0, 15.0])
def test_no_surface_shadows_itself_however_light_grazes_it(kind, grazing_deg, scale):
    """A panel above a floor, lit at an angle to its plane; the floor has its shadow."""
    angle = np.deg2rad(grazing_deg)
    # the panel's normal is the world's y, after the mesh's z
    toward = np.array([0.3 * np.cos(angle), np.sin(angle), np.cos(angle)])
    toward /= np.linalg.norm(toward)
    light = _light(LightKind[kind.upper()], 3.0 * scale * toward, -toward)
    light = replace(light, intensity=9.0 * scale**2 if kind == "point" else 1.0)
    panel = square(0.5 * scale, material=1, name="panel")
    floor = square(6.0 * scale)
    poses = [pose((0.0, 0.0, -scale)), pose((0.0, 0.0, 0.0), roll_deg=-90.0)]
    blue, red = (0, 0, 1, 1), (1, 0, 0, 1)
    materials = [Material(base_color=one, double_sided=True) for one in (blue, red)]
    scene = scene_of([floor, panel], materials, poses, _lighting(light))
    camera = replace(CAMERA.resized(200), near_m=CAMERA.near_m * scale)
    state = camera.base_pose(np.array([0.1, 0.7, 0.05]) * scale, yaw_deg=-90.0)
    expected, shown = (
        frame_of(one, camera, state, linear=True).linear for one in (_unshadowed(scene), scene)
    )
    on_panel = expected[..., 0] > 0.02
    assert on_panel.sum() > 500
    assert (shown[..., 2] < 0.9 * expected[..., 2]).sum() > 20  # the shadow on the floor
    off = np.abs(shown - expected)[..., 0][on_panel]
    assert np.mean(off > 0.01) == 0.0
