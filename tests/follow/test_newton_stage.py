"""Cameras in simulations of Newton: ranges, bodies and colors are those of its own ray caster."""

import numpy as np
import pytest

from omnisim import OmniCamera, pose
from omnisim.cameras import EquidistantCamera
from omnisim.cameras.camera import pixel_grid
from omnisim.core.errors import OmnisimError
from omnisim.follow import NewtonStage
from omnisim.follow.body_stage import NO_BODY
from tests.follow.pixel_masks import is_inside

newton = pytest.importorskip("newton", reason="Newton is not installed")
wp = pytest.importorskip("warp")
pytestmark = pytest.mark.usefixtures("needs_opengl")
LENS = EquidistantCamera(96, 96, 40.0, (47.5, 47.5), 1.15)
TURN = (0.2, -0.1, 0.4, 0.888819)
SQUARE = [(0.0, -0.5, -0.5), (0.0, 0.5, -0.5), (0.0, 0.5, 0.5), (0.0, -0.5, 0.5)]
QUADRANTS = np.array([[(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (90, 90, 90)]], np.uint8)


def _shapes(axis):
    """Model with one body of each kind of shape in a ring, and terrain that stands still."""
    builder = newton.ModelBuilder(up_axis=newton.Axis[axis.upper()])
    up = {"y": lambda x, y, z: (x, z, -y), "z": lambda x, y, z: (x, y, z)}[axis]

    def body(number):
        angle = number * np.pi / 4.0
        place = up(1.7 * np.cos(angle), 1.7 * np.sin(angle), 0.8)
        return builder.add_body(xform=wp.transform(place, TURN), label=f"ring/{number}")

    mesh = newton.Mesh.create_cone(0.4, 0.4)
    square = newton.Mesh(
        SQUARE, [0, 1, 2, 0, 2, 3], uvs=[(0, 0), (1, 0), (1, 1), (0, 1)],
        texture=QUADRANTS.repeat(8, axis=0).repeat(8, axis=1),
    )  # fmt: skip
    builder.add_shape_box(body(0), hx=0.2, hy=0.3, hz=0.4, color=(0.9, 0.2, 0.1))
    builder.add_shape_sphere(body(1), radius=0.4)
    builder.add_shape_capsule(body(2), radius=0.2, half_height=0.3)
    builder.add_shape_cylinder(body(3), radius=0.3, half_height=0.4)
    builder.add_shape_cone(body(4), radius=0.3, half_height=0.4)
    builder.add_shape_ellipsoid(body(5), rx=0.3, ry=0.4, rz=0.5)
    builder.add_shape_mesh(body(6), mesh=mesh, scale=(1.0, 1.5, -0.7))
    builder.add_shape_mesh(body(7), mesh=square, color=(1.0, 1.0, 1.0))
    hidden = newton.ModelBuilder.ShapeConfig(is_visible=False)
    builder.add_shape_sphere(0, radius=0.6, cfg=hidden)
    heights = newton.Heightfield(
        np.random.default_rng(0).random((5, 4)), 5, 4, hx=0.6, hy=1.0, min_z=0.1, max_z=0.5
    )
    level = wp.quat_rpy(-0.5 * np.pi, 0.0, 0.0) if axis == "y" else wp.quat_identity()
    builder.add_shape_heightfield(heightfield=heights, xform=wp.transform(up(3.0, 0.0, 0.0), level))
    builder.add_ground_plane()
    return builder.finalize()


def _theirs(model, state, origin, directions):
    """Ranges, shapes and albedo (n, 3) by Newton's ray caster along rays in its world."""
    sensor = newton.sensors.SensorCamera(model)
    count = len(directions)
    rays = np.stack((np.broadcast_to(origin, directions.shape), directions), axis=1)
    ranges, shapes = (
        sensor.allocate_image_depth(1, count, 1),
        sensor.allocate_image_shape_index(1, count, 1),
    )
    albedo = sensor.allocate_image_albedo(1, count, 1)
    model.bvh_refit_shapes(state)
    sensor.update(
        state, wp.array([wp.transform_identity()], dtype=wp.transformf),
        wp.array(rays.reshape(1, count, 1, 2, 3).astype(np.float32), dtype=wp.vec3f),
        depth_image=ranges, shape_index_image=shapes, albedo_image=albedo,
        render_config=sensor.RenderConfig(enable_backface_culling=False, enable_textures=True),
    )  # fmt: skip
    found = shapes.numpy().ravel().astype(np.int64)
    packed = np.ascontiguousarray(albedo.numpy().ravel()).view(np.uint8).reshape(-1, 4)
    return ranges.numpy().ravel(), np.where(found < model.shape_count, found, -1), packed[:, :3]


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["z", "y"])
def test_ranges_bodies_and_colors_are_those_of_newtons_rays(axis):
    model = _shapes(axis)
    state = model.state()
    rays = LENS.ray_from_pixel(pixel_grid(96, 96))
    bodies, seen = model.shape_body.numpy(), []
    with NewtonStage(model, state) as stage:
        assert stage.names[:2] == ("ring/0", "ring/1")
        assert stage.notices == ()
        camera = stage.open(OmniCamera(LENS, supersampling=1), unlit=True)
        host_from_world = (
            np.array([(1.0, 0, 0), (0, 0, 1), (0, -1, 0)]) if axis == "y" else np.eye(3)
        )
        for number in range(10):
            there = pose(
                (0.05 * number, 0.1 - 0.03 * number, 1.1), yaw_deg=37.0 * number, pitch_deg=15.0
            )
            frame = camera.render(stage.now().moved({"body": there}), also=("range", "instance"))
            world_from_optical = np.array(frame.metadata["world_from_optical"])
            directions = rays.directions[frame.valid] @ world_from_optical[:3, :3].T
            found = _theirs(
                model, state, host_from_world @ world_from_optical[:3, 3],
                directions @ host_from_world.T,
            )  # fmt: skip
            ranges, shapes, albedo = (np.full((96, 96, *one.shape[1:]), -1.0) for one in found)
            ranges[frame.valid], shapes[frame.valid], albedo[frame.valid] = found
            ours = frame.channels["instance"]
            inside = is_inside(shapes) & is_inside(ours) & frame.valid & (ranges < 100.0)
            owners = np.where(shapes < 0.0, NO_BODY, bodies[shapes.astype(int)])
            is_right = stage.body_ids(frame) == owners
            hit = inside & (ranges > 0.0)
            errors_m = np.abs(frame.channels["range"][hit] - ranges[hit])
            steps = np.abs(frame.rgb[hit].astype(int) - albedo[hit]).max(axis=-1)
            seen.append((is_right[inside], errors_m, steps, shapes[hit]))
    is_right, errors_m, steps, shapes = (np.concatenate(each) for each in zip(*seen, strict=True))
    assert is_right.mean() > 0.999
    assert (errors_m < 1e-3).mean() > 0.999
    assert set(np.unique(shapes)) == {*range(8), 9, 10}  # all that are visible
    for shape in np.unique(shapes):  # pixels beside edges are mixed, 7 has a texture's
        assert np.median(steps[shapes == shape]) <= (8 if shape == 7 else 1), shape


def _ball(builder, height_m, **shape):
    body = builder.add_body(xform=wp.transform((0.0, 0.0, height_m), TURN), label="ball")
    builder.add_shape_sphere(body, radius=0.2, **shape)


def _worlds(*builders):
    model = newton.ModelBuilder()
    for builder in builders:
        model.add_world(builder)
    _ball(model, 5.0)  # of no world: all have it
    model.add_ground_plane()
    return model.finalize()


def test_many_worlds_are_a_batch_of_one_robot():
    builder = newton.ModelBuilder()
    _ball(builder, 1.0)
    _ball(builder, 2.0)
    model = _worlds(builder, builder, builder)
    state = model.state()
    poses = state.body_q.numpy()
    poses[:, 0] = np.arange(len(poses))
    state.body_q.assign(poses)
    with NewtonStage(model, state) as stage:
        assert stage.names == ("ball", "ball_2", "ball_3")
        assert stage.scene.instance_names == ("ground_plane",)
        places = [
            [one.world_from_object[name][0, 3] for name in stage.names]
            for one in stage.worlds_now()
        ]
        assert places == [[0.0, 1.0, 6.0], [2.0, 3.0, 6.0], [4.0, 5.0, 6.0]]
        other = model.state()
        assert stage.worlds_now(other, 2.0)[1].world_from_object["ball"][0, 3] == 0.0
        assert stage.worlds_now(other, 2.0)[1].time_s == 2.0
        with pytest.raises(OmnisimError, match="state: expected one world, got 3: see worlds_now"):
            stage.now()


def test_worlds_of_other_bodies_or_shapes_are_refused():
    builders = [newton.ModelBuilder() for _ in range(3)]
    _ball(builders[0], 1.0)
    _ball(builders[1], 1.0, xform=wp.transform((0.0, 0.0, 0.1), wp.quat_identity()))
    for _ in range(2):
        _ball(builders[2], 1.0)
    for second, message in (
        (1, "model: world 1: expected the shapes and places as in world 0, got others"),
        (2, "model: world 1: expected 1 bodies as in world 0, got 2"),
    ):
        with pytest.raises(OmnisimError, match=message):
            NewtonStage(_worlds(builders[0], builders[second]))
    with pytest.raises(OmnisimError, match="model: expected bodies, got none"):
        NewtonStage(newton.ModelBuilder().finalize())


def test_velocities_are_those_of_the_centers_of_mass():
    builder = newton.ModelBuilder()
    _ball(builder, 1.0, xform=wp.transform((0.3, 0.1, 0.0), wp.quat_identity()))
    model = builder.finalize()
    state = model.state()
    state.body_qd.assign(np.array([(0.5, 0.0, 0.0, 1.0, -2.0, 3.0)], np.float32))
    center = np.array((0.3, 0.1, 0.0, 1.0))
    assert model.body_com.numpy()[0] == pytest.approx(center[:3], abs=1e-6)
    with NewtonStage(model, state) as stage:
        motion, step_s = stage.motion_now(time_s=1.0), 1e-3
        before, after = (motion(1.0 + at_s).world_from_object["ball"] for at_s in (0.0, step_s))
    # of second order: the arm of 0.3 m, 14 rad²/s² and the step's square
    assert ((after - before) @ center)[:3] == pytest.approx((0.5 * step_s, 0.0, 0.0), abs=5e-6)
    turn = (after @ np.linalg.inv(before))[:3, :3]
    rates = np.array([turn[2, 1], turn[0, 2], turn[1, 0]]) / step_s
    assert rates == pytest.approx((1.0, -2.0, 3.0), abs=1e-2)


def test_particles_and_cloth_are_named_as_not_drawn():
    builder = newton.ModelBuilder()
    _ball(builder, 1.0)
    for place in ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        builder.add_particle(wp.vec3(place), wp.vec3(), 1.0)
    builder.add_triangle(0, 1, 2)
    with NewtonStage(builder.finalize()) as stage:
        assert stage.notices == ("not drawn: 3 particles, 1 face",)
