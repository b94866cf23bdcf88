"""`omnisim optics`: output, files and errors."""

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh

import omnisim as package
from omnisim.cameras.calibration.ray_table import read_ray_table
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.optics import read_optics_file, write_corners
from omnisim.cameras.optics.profiles import read_profile
from tests.cameras.optics.boards.test_calibrate import boards_of

EXAMPLES = Path(package.__file__).parents[1] / "examples" / "optics"
SPHERE = EXAMPLES / "sphere.toml"
DESIGN = ("optics", "design", "--distance", 0.1, "--half-angle", 20)


def test_check(quiet):
    out = quiet("optics", "check", SPHERE, "--at-distance", 0.5, 2)
    assert "perspective 360 × 360 px, 1 mirror" in out
    assert "67.1 % of the pixels see something; 30.7 % miss a surface" in out
    assert "lateral" not in out
    assert "best viewpoint: (0.00000, -0.00008, 0.15569) m" in out
    assert [line.split()[0] for line in out.splitlines()[-2:]] == ["0.5", "2"]


@pytest.mark.slow
@pytest.mark.long
def test_check_tells_lateral_color(quiet, tmp_path):
    port = (EXAMPLES / "flat-port.toml").read_text()
    (tmp_path / "port.toml").write_text(port)
    (tmp_path / "chromatic.toml").write_text("chromatic = true\n" + port)
    out = quiet("optics", "check", "port.toml", "--at-distance", 2)
    assert "lateral color: R and B of far points are " in out
    assert "px at most; set chromatic = true to simulate it" in out
    assert "px at most; simulated" in quiet("optics", "check", "chromatic.toml")


@pytest.mark.parametrize("name", ["folded", "tilted-mirror"])
def test_plot(quiet, tmp_path, name):
    quiet("optics", "plot", EXAMPLES / f"{name}.toml", "-o", "a.svg")
    assert (tmp_path / "a.svg").stat().st_size > 10_000


def test_rays_of_a_color(quiet, tmp_path):
    for color in "RB":
        words = EXAMPLES / "flat-port.toml", "-o", f"{color}.exr", "--color", color
        quiet("optics", "rays", *words)
    red, blue = (read_ray_table(tmp_path / f"{color}.exr") for color in "RB")
    assert np.abs(red.directions - blue.directions).max() > 1e-3
    rays = read_optics_file(EXAMPLES / "flat-port.toml").of_color("B").all_rays()
    np.testing.assert_array_equal(blue.valid, rays.valid)
    np.testing.assert_allclose(blue.origins_m[blue.valid], rays.origins_m[rays.valid], atol=1e-8)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [("equi-angular", (105,)), ("equi-ground", (5, "--height", 0.6))],
)
def test_design_makes_the_examples(quiet, tmp_path, name, arguments):
    out = quiet(*DESIGN, f"--{name}", *arguments, "-o", "a.csv")
    assert "501 points, rim radius 4" in out
    made, expected = read_profile(tmp_path / "a.csv"), read_profile(EXAMPLES / f"{name}.csv")
    np.testing.assert_allclose(made.table_heights_m, expected.table_heights_m, atol=1e-12)


def test_a_designed_system_fills_its_image_to_the_rim(quiet, tmp_path):
    out = quiet(*DESIGN, "--equi-angular", 105, "--size", 90, "-o", "m.toml")
    assert "m.toml: perspective 90 × 90 px, 1 mirror" in out
    system = read_optics_file(tmp_path / "m.toml")
    edge = system.rays([[89.4, 44.5], [44.5, -0.4]])
    assert edge.valid.all()
    theta_deg = np.degrees(np.arccos(-edge.directions[:, 2]))
    np.testing.assert_allclose(theta_deg, 105.0 * 44.9 / 45.0, atol=1e-3)
    assert not system.rays([[89.6, 44.5]]).valid.any()


def test_profile(quiet, tmp_path):
    out = quiet("optics", "profile", SPHERE, "-o", "a.csv", "--points", 40)
    assert "a.csv: 40 points of sphere, radius 29 mm" in out
    shape = read_optics_file(SPHERE).surfaces[0].shape
    profile = read_profile(tmp_path / "a.csv")
    np.testing.assert_allclose(profile.table_heights_m, shape.sag_m(profile.radii_m))


@pytest.mark.parametrize("name", ["cone", "sphere"])
def test_profile_as_a_table_has_the_same_rays(quiet, tmp_path, name):
    path = EXAMPLES / f"{name}.toml"
    out = quiet("optics", "profile", path, "-o", "a.csv")
    assert ('tip = "pointed"' in out) == (name == "cone")
    system = read_optics_file(path)
    profile = read_profile(tmp_path / "a.csv", pointed=name == "cone")
    surface = dataclasses.replace(system.surfaces[0], shape=profile)
    table = dataclasses.replace(system, surfaces=(surface,))
    expected, found = system.all_rays(), table.all_rays()
    np.testing.assert_array_equal(found.valid, expected.valid)
    # the bound that the documentation states; a ball, 29/30 of its radius, comes nearest to it
    np.testing.assert_allclose(found.directions, expected.directions, atol=1e-6)
    np.testing.assert_allclose(found.origins_m, expected.origins_m, atol=1e-9)


def test_profile_of_the_papers_mirror(quiet, tmp_path):
    out = quiet("mirror", "-o", "paper.csv")
    assert "501 points of hyperbolic_mirror, radius 11.94 mm; a spline through them" in out
    profile, mirror = read_profile(tmp_path / "paper.csv"), HyperbolicMirror()
    # its own frame is at the vertex, and z away from the camera
    expected = mirror.vertex_height_m - mirror.height_from_radius_m(profile.radii_m)
    np.testing.assert_allclose(profile.table_heights_m, expected, atol=1e-15)


def test_profile_is_not_written_over_what_is_read(refused, tmp_path):
    for suffix in ("toml", "csv"):
        shutil.copy(EXAMPLES / f"equi-angular.{suffix}", tmp_path)
    (tmp_path / "sensor.toml").write_text('[optics]\nfile = "equi-angular.toml"\n')
    before = (tmp_path / "equi-angular.csv").read_bytes()
    for arguments in (
        ("mirror", "--optics", "equi-angular.toml"),
        ("optics", "profile", "equi-angular.toml"),
        ("optics", "profile", "sensor.toml"),
    ):
        line = refused(*arguments, "-o", "equi-angular.csv")
        assert line.startswith("equi-angular.csv: is the profile of surfaces.0: expected")
    assert (tmp_path / "equi-angular.csv").read_bytes() == before


@pytest.mark.parametrize(
    ("name", "area_m2"),
    [
        # caps and frusta: 2 π R h, and π r s
        ("sphere", 2.0 * np.pi * 0.03 * (0.03 - np.sqrt(0.03**2 - 0.029**2))),
        ("cone", np.pi * 0.08**2 / np.sin(np.radians(55.0))),
    ],
)
def test_mesh_of_a_surface(quiet, tmp_path, name, area_m2):
    quiet("mirror", "--optics", EXAMPLES / f"{name}.toml", "-n", 16384, "-o", "m.ply")
    mesh = trimesh.load(tmp_path / "m.ply", process=False)
    assert mesh.area == pytest.approx(area_m2, rel=2e-3)
    assert (mesh.face_normals[:, 2] > 0.0).all()  # toward the camera
    cosines = (mesh.face_normals * mesh.vertex_normals[mesh.faces[:, 2]]).sum(axis=1)
    assert cosines.min() > 0.9


def test_calibrate(quiet, tmp_path):
    """The example's tilt is found again from one without, and files are named from the output."""
    truth = read_optics_file(EXAMPLES / "tilted-mirror.toml")
    write_corners(tmp_path / "corners.csv", boards_of(truth, 4))
    text = (EXAMPLES / "tilted-mirror.toml").read_text()
    aligned = text.replace("tilt_deg = [2.0, 0.0, 0.0]\n", "").replace("[0.002,", "[0.001,")
    (tmp_path / "aligned.toml").write_text(aligned)
    keys = "surfaces.0.decenter_m,surfaces.0.tilt_deg.0,surfaces.0.tilt_deg.1"
    words = "aligned.toml", "corners.csv", "--free", keys, "-o", "a.toml"
    out = quiet("optics", "calibrate", *words)
    assert "a.toml: 4 images, " in out
    assert "surfaces.0.tilt_deg.0" in out
    fitted = read_optics_file(tmp_path / "a.toml")
    np.testing.assert_allclose(
        fitted.surfaces[0].system_from_surface, truth.surfaces[0].system_from_surface, atol=1e-6
    )
    assert len(fitted.obstacles) == 1


def test_calibrate_names_files_from_its_output(quiet, tmp_path):
    for suffix in ("toml", "csv"):
        shutil.copy(EXAMPLES / f"equi-angular.{suffix}", tmp_path)
    system = read_optics_file(tmp_path / "equi-angular.toml")
    write_corners(tmp_path / "corners.csv", boards_of(system, 3))
    (tmp_path / "fitted").mkdir()
    words = "corners.csv", "--free", "camera.focal_length_px", "-o", "fitted/a.toml"
    quiet("optics", "calibrate", "equi-angular.toml", *words)
    found = read_optics_file(tmp_path / "fitted" / "a.toml").camera.focal_length_px
    assert found == pytest.approx(system.camera.focal_length_px, abs=1e-4)
