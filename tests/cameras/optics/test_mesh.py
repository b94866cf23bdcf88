"""The paper's mesh for any mirror, against the central mirror's, Embree, and exact rays."""

import dataclasses
import math

import numpy as np
import pytest

from omnisim import OmniCamera, open_sensor
from omnisim.cameras import PerspectiveCamera, pixel_grid
from omnisim.cameras.mirrors import tessellate
from omnisim.cameras.mirrors.hyperbolic import mesh_rays
from omnisim.cameras.optics import OpticalSystem, Surface, read_optics_file
from omnisim.cameras.optics.mesh_rays import (
    MeshRays,
    SystemMeshErrors,
    has_mesh,
    tessellate_surface,
)
from omnisim.cameras.optics.shapes import Conic, Hyperbolic
from omnisim.core.errors import OmnisimError, OpticsError
from omnisim.core.poses import pose
from omnisim.rendering.atlas.parallax_plan import sample_rays
from omnisim.rendering.camera.captured_image import valid_mask
from omnisim.rendering.camera.quality import MAX_ERROR_PX, auto_polygons
from omnisim.validation.image_differences import psnr_of_levels_db
from tests.cameras.optics.examples import EXAMPLES, SYSTEMS, at, port
from tests.cameras.optics.samples import all_samples
from tests.scenes import room, scene_of

SEEN = [path for path in EXAMPLES if has_mesh(read_optics_file(path))]
QUICK = {"tilted-mirror"}
every_mirror = pytest.mark.parametrize(
    "path",
    [
        pytest.param(path, marks=[] if path.stem in QUICK else pytest.mark.slow, id=path.stem)
        for path in SEEN
    ],
)
NOW = pose((0.4, -0.3, 0.1), roll_deg=2.0, pitch_deg=-4.0, yaw_deg=30.0)


def _aligned():
    """The paper's camera, as an optical system."""
    paper, shape = OmniCamera().model, Hyperbolic()
    camera = PerspectiveCamera(360, 360, paper.focal_length_px, paper.principal_point_px)
    mirror = Surface(shape, at(shape.vertex_m), paper.mirror.rim_radius_m)
    return OpticalSystem(camera, (mirror,), origin_m=(0.0, 0.0, shape.focal_distance_m))


def _off_px(system, mesh):
    """Distances (n,) between pixels and where the exact system shows what they see."""
    pixels = pixel_grid(system.width_px, system.height_px).reshape(-1, 2)
    rays = mesh.ray_from_pixel(pixels)
    shown = system.pixel_from_ray(rays.directions[rays.valid])
    return np.linalg.norm(shown.positions_px - pixels[rays.valid], axis=1)[shown.valid]


def test_examples_with_a_mirror_have_a_mesh():
    without = {path.stem for path in EXAMPLES} - {path.stem for path in SEEN}
    assert without == {"flat-port", "dome-port"}


@pytest.mark.parametrize("polygons", [16, 1024])
def test_of_a_central_mirror_it_is_the_papers(polygons):
    camera, pixels = OmniCamera().model, pixel_grid(360, 360)
    expected = mesh_rays(camera, tessellate(camera.mirror, polygons), pixels)
    found = MeshRays(_aligned(), polygons).ray_from_pixel(pixels)
    np.testing.assert_array_equal(found.valid, expected.valid)
    off = (found.directions - expected.directions)[found.valid]
    assert np.abs(off).max() < 1e-7  # the vertex's normal is that of 1e-8 of the rim's radius aside


@pytest.mark.parametrize("polygons", [8, 1024])
def test_rays_of_the_papers_mesh_pass_what_embree_hits(polygons):
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    from omnisim.rendering.rays.caster import NO_TRIANGLE, EmbreeMesh

    camera, pixels = OmniCamera().resized(81).model, pixel_grid(81, 81).reshape(-1, 2)
    mesh = tessellate(camera.mirror, polygons)
    rays = mesh_rays(camera, mesh, pixels)
    corners = (mesh.vertices_m / camera.mirror.c_m)[mesh.triangles]
    offsets = (pixels - camera.principal_point_px) / camera.focal_length_px
    seen = np.column_stack((offsets * (1.0, -1.0), np.full(len(pixels), -1.0)))
    pinhole = np.tile((0.0, 0.0, 1.0), (len(pixels), 1))
    hit = EmbreeMesh.of_corners(corners).triangles_hit(pinhole.astype("f4"), seen.astype("f4"))
    np.testing.assert_array_equal(rays.valid, hit != NO_TRIANGLE)
    corners = corners[hit[rays.valid]]
    planes = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen, pinhole = seen[rays.valid], pinhole[rays.valid]
    shares = np.einsum("nj,nj->n", planes, corners[:, 0] - pinhole)
    points = pinhole + (shares / np.einsum("nj,nj->n", planes, seen))[:, None] * seen
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    np.testing.assert_allclose(rays.directions[rays.valid] * (1.0, -1.0, -1.0), points, atol=1e-14)


@pytest.mark.parametrize("name", ["misaligned hyperbola", "cone", "tilted camera"])
def test_rays_start_where_embree_hits_the_polygons(name):
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    from omnisim.rendering.rays.caster import NO_TRIANGLE, EmbreeMesh

    system, polygons = SYSTEMS[name], 256
    surface, eye_m = system.surfaces[0], system.system_from_camera[:3, 3]
    mesh = tessellate_surface(surface, polygons, eye_m)
    vertices = surface.directions_to_system(mesh.vertices_m) + surface.system_from_surface[:3, 3]
    corners = vertices[mesh.triangles]
    pixels = pixel_grid(360, 360)[::2, ::2].reshape(-1, 2)
    rays = MeshRays(system, polygons).ray_from_pixel(pixels)
    toward = system.camera.ray_from_pixel(pixels).directions @ system.system_from_camera[:3, :3].T
    origins = np.tile(eye_m, (len(pixels), 1)).astype(np.float32)
    hit = EmbreeMesh.of_corners(corners).triangles_hit(origins, toward.astype(np.float32))
    exact = system.rays(pixels).valid
    assert ((hit != NO_TRIANGLE) & exact != rays.valid).mean() < 1e-4  # along edges, by rounding
    both = (hit != NO_TRIANGLE) & rays.valid
    first, second, third = np.moveaxis(corners[hit[both]], 1, 0)
    planes = np.cross(second - first, third - first)
    planes /= np.linalg.norm(planes, axis=1, keepdims=True)
    heights = np.einsum("nj,nj->n", planes, rays.origins_m[both] - first)
    assert np.quantile(np.abs(heights), 0.999) < 1e-12
    away = rays.origins_m[both] - eye_m
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    assert np.abs(away - toward[both]).max() < 1e-12


@every_mirror
def test_error_falls_as_one_over_the_polygons(path):
    errors = SystemMeshErrors(read_optics_file(path))
    found = [errors.of(polygons) for polygons in (64, 256, 1024, 4096)]
    means, largest = np.array([(one.mean_px, one.max_px) for one in found]).T
    ratios = means[:-1] / means[1:]
    assert np.all((ratios > 3.5) & (ratios < 5.6)), ratios
    assert np.all(largest[:-1] / largest[1:] > 2.0)


@every_mirror
def test_error_is_that_of_the_exact_inverse(path):
    system = read_optics_file(path).scaled(0.3)
    expected, found = _off_px(system, MeshRays(system, 1024)), SystemMeshErrors(system).of(1024)
    assert found.mean_px == pytest.approx(expected.mean(), rel=0.05)
    assert found.percentile_95_px == pytest.approx(np.percentile(expected, 95), rel=0.05)
    assert found.max_px > 0.9 * np.percentile(expected, 99.9)


@every_mirror
def test_auto_keeps_a_tenth_of_a_pixel(path):
    system = read_optics_file(path).scaled(0.25)
    polygons = auto_polygons(system)
    sensor = OmniCamera(system, polygons="auto")
    assert sensor.mesh_polygons == polygons
    assert sensor.mesh_error_px <= MAX_ERROR_PX
    assert _off_px(system, MeshRays(system, polygons)).max() < MAX_ERROR_PX
    exact, mesh = valid_mask(system, None), valid_mask(system, polygons)
    assert not np.any(mesh & ~exact)
    rim_px = math.pi * max(exact.shape)
    assert (exact != mesh).sum() < 1.5 * MAX_ERROR_PX * rim_px
    coarser = 4 * (math.isqrt(polygons // 4) - 1) ** 2
    assert SystemMeshErrors(system).of(coarser).max_px > MAX_ERROR_PX


def test_ball_without_a_rim_has_a_mesh():
    """Parts beyond the limb, as the camera sees the ball, face away from it."""
    sphere = SYSTEMS["sphere"]
    ball = dataclasses.replace(sphere.surfaces[0], rim_radius_m=math.inf)
    system = dataclasses.replace(sphere, surfaces=(ball,))
    pixels = pixel_grid(360, 360)
    found, exact = MeshRays(system, 4096).ray_from_pixel(pixels), system.ray_from_pixel(pixels)
    assert not np.any(found.valid & ~exact.valid)
    assert (found.valid != exact.valid).sum() < 0.01 * exact.valid.sum()
    errors = SystemMeshErrors(system)
    assert errors.of(1024).mean_px / errors.of(4096).mean_px == pytest.approx(4.0, rel=0.3)


def test_mirror_behind_a_port_has_a_mesh():
    mirror = Surface(Conic(0.03), at(0.2), 0.028)
    system = OpticalSystem(SYSTEMS["sphere"].camera, (*port(0.02), mirror), medium="air")
    errors = SystemMeshErrors(system)
    assert errors.of(256).mean_px / errors.of(1024).mean_px == pytest.approx(4.0, rel=0.1)
    rays, exact = (
        source.ray_from_pixel(pixel_grid(360, 360)) for source in (MeshRays(system, 4096), system)
    )
    assert (rays.valid != exact.valid).mean() < 2e-3
    assert np.abs(rays.directions - exact.directions)[rays.valid].max() < 0.02


def test_shadows_are_those_of_exact_rays():
    system = SYSTEMS["needle"]
    found = MeshRays(system, 64).ray_from_pixel(pixel_grid(360, 360)).valid
    exact = system.all_rays().valid
    np.testing.assert_array_equal(found[170:190, 170:190], exact[170:190, 170:190])
    assert not exact[178:182, 178:182].any()


def test_samples_of_a_mesh_are_its_rays():
    system = SYSTEMS["sphere"].scaled(0.25)
    found = all_samples(sample_rays(system, 2, 64), system)
    expected = MeshRays(system.scaled(2.0), 64).ray_from_pixel(pixel_grid(180, 180))
    np.testing.assert_array_equal(found.valid, expected.valid)
    valid = expected.valid
    misses = np.linalg.norm(found.directions - expected.directions, axis=-1)[valid]
    # between its edges, and kept on them
    turns = np.linalg.norm(np.diff(expected.directions, axis=1), axis=-1)
    # a twentieth of a pixel, of two samples to a side
    assert misses.max() < 0.1 * np.median(turns[valid[:, 1:] & valid[:, :-1]])


@pytest.mark.parametrize("backend", ["cube", "rays"])
def test_images_settle_with_more_polygons(backend):
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    sensor = OmniCamera(SYSTEMS["sphere"].scaled(0.3), supersampling=2)
    scene = scene_of([room()])
    frames = {}
    for polygons in (16, 64, 256, None):
        with open_sensor(scene, sensor.with_polygons(polygons), backend=backend) as renderer:
            frames[polygons] = renderer.render(NOW)
    exact = frames.pop(None)
    assert exact.metadata["polygons"] == "exact"
    assert frames[64].metadata["polygons"] == 64
    psnrs = [
        psnr_of_levels_db(*(one.rgb[exact.valid & frame.valid] for one in (exact, frame)))
        for frame in frames.values()
    ]
    assert psnrs[0] + 8.0 < psnrs[1] < psnrs[2] - 8.0, psnrs


def test_flow_through_a_mesh_is_that_of_the_exact_system():
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    sensor = OmniCamera(SYSTEMS["sphere"].scaled(0.3))
    after = NOW @ pose((0.05, 0.02, 0.0), yaw_deg=2.0)
    flows = []
    for polygons in (None, 256):
        with open_sensor(scene_of([room()]), sensor.with_polygons(polygons)) as renderer:
            frame = renderer.render(NOW, also=("flow",), next_state=after)
        flows.append(frame.channels["flow"])
    off_px = np.linalg.norm(flows[1] - flows[0], axis=-1)
    known = np.isfinite(off_px)
    assert known.mean() > 0.4
    # what a pixel sees is up to a pixel aside, not its motion
    assert np.median(off_px[known]) < 0.02


def test_default_is_exact_and_ports_have_no_mesh():
    assert OmniCamera(SYSTEMS["sphere"]).mesh_polygons is None
    assert OmniCamera().polygons == "auto"
    assert OmniCamera(SYSTEMS["port"], polygons="auto").mesh_summary == "exact"
    with pytest.raises(OpticsError, match="polygons = 64: a camera of model 'optics' has no mirr"):
        OmniCamera(SYSTEMS["port"], polygons=64)
    with pytest.raises(OpticsError, match="expected 8 to 1048576 polygons, got 4"):
        OmniCamera(SYSTEMS["sphere"], polygons=4)


def test_sensor_file_has_polygons(tmp_path):
    def read(text):
        (tmp_path / "sensor.toml").write_text(text)
        return OmniCamera.from_file(tmp_path / "sensor.toml")

    def sensor(file, value):
        example = next(one for one in EXAMPLES if one.stem == file)
        return read(f'[optics]\nfile = "{example}"\npolygons = {value}\n')

    for polygons in (None, "auto", 256):
        written = OmniCamera(SYSTEMS["sphere"], polygons=polygons).to_toml()
        assert read(written).polygons == polygons

    assert sensor("sphere", 256).mesh_polygons == 256
    assert sensor("sphere", '"exact"').mesh_polygons is None
    assert sensor("folded", '"auto"').mesh_polygons == 3844
    with pytest.raises(OmnisimError, match=r"optics\.polygons = 13: expected polygons that make"):
        sensor("sphere", 13)
    with pytest.raises(OmnisimError, match=r"optics\.polygons = 64: expected 'auto' or 'exact'"):
        sensor("flat-port", 64)
