"""TartanAir V2, decoded as its documentation does, by OpenCV."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnisim.core.files.image_files import read_image
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.recording import Recording

pytestmark = pytest.mark.usefixtures("needs_opengl")
NAMES = {"front": "lcam_front", "fisheye": "lcam_fish", "mirror": "lcam_fish"}
SIDES = {"north": (1.0, 0.0, 0.0), "east": (0.0, -1.0, 0.0), "down": (0.0, 0.0, -1.0)}


def _read_depth(path):
    """Decoder of tartanair.org's page "Modalities"."""
    cv2 = pytest.importorskip("cv2")
    depth_rgba = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return np.squeeze(depth_rgba.view("<f4"), axis=-1)


@pytest.mark.parametrize("camera", NAMES)
def test_depths_and_poses_put_points_where_they_are(run, tmp_path, seen, camera):
    list(export_run(run, "tartanair", tmp_path / "out", camera_name=camera))
    root, name = tmp_path / "out" / "P000", NAMES[camera]
    poses = np.loadtxt(root / f"pose_{name}.txt")
    ned_from_world = np.array(list(SIDES.values()))
    recorded = Recording.read(run, camera).cameras[0]
    for step, row in enumerate(poses):
        expected = seen(camera, step)
        u, v = expected.pixels.T
        at = expected.width_px - 1 - u if camera == "mirror" else u
        depth = _read_depth(root / f"depth_{name}" / f"{step:06d}_{name}_depth.png")
        image = read_image(root / f"image_{name}" / f"{step:06d}_{name}.png")[0]
        np.testing.assert_array_equal(image[v, at, :3], expected.colors)
        offsets = expected.world_m @ ned_from_world.T - row[:3]
        forward, right, down = Rotation.from_quat(row[3:]).as_matrix().T
        along = offsets @ forward if camera == "front" else np.linalg.norm(offsets, axis=-1)
        np.testing.assert_allclose(depth[v, at], along, rtol=1e-6)
        # a point right of the middle of the image is at the camera's right, one below below
        center = np.array(recorded.mount.camera.principal_point_px)
        if camera == "mirror":
            center[0] = expected.width_px - 1 - center[0]
        assert np.all((offsets @ right > 0)[at > center[0] + 1])
        assert np.all((offsets @ down > 0)[v > center[1] + 1])
        hits = np.zeros(depth.shape, dtype=bool)
        hits[v, at] = True
        assert np.all(depth[~hits] == 10_000.0)


def test_classes_are_the_runs_own(run, tmp_path):
    list(export_run(run, "tartanair", tmp_path / "out", camera_name="front"))
    root = tmp_path / "out" / "P000"
    recorded = Recording.read(run, "front").cameras[0]
    for step in range(4):
        found = read_image(root / "seg_lcam_front" / f"{step:06d}_lcam_front_seg.png")[0][..., 0]
        np.testing.assert_array_equal(found, recorded.channel(step, "semantic"))
    assert (root / "labels.json").read_bytes() == (run / "labels.json").read_bytes()


def _read_flow(path):
    """Decoder of tartanair.org's page "Modalities"."""
    cv2 = pytest.importorskip("cv2")
    flow16 = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return (flow16[..., :2].astype(np.float32) - 32768) / 64.0, flow16[..., 2].astype(np.uint8)


@pytest.mark.parametrize("camera", NAMES)
def test_flow_leads_to_where_the_points_are_in_the_next_image(run, tmp_path, seen, camera):
    list(export_run(run, "tartanair", tmp_path / "out", camera_name=camera))
    folder = tmp_path / "out" / "P000" / f"flow_{NAMES[camera]}"
    names = [f"{step:06d}_{step + 1:06d}_flow.png" for step in range(3)]
    assert sorted(path.name for path in folder.iterdir()) == names
    recording = Recording.read(run, camera)
    recorded = recording.cameras[0]
    for step, name in enumerate(names):
        flow, mask = _read_flow(folder / name)
        expected = seen(camera, step)
        pose = recording.truth.world_from_base[step + 1] @ recorded.mount.base_from_optical
        points = (expected.world_m - pose[:3, 3]) @ pose[:3, :3]
        pixels, valid = recorded.mount.camera.pixel_from_ray(points)
        u, v = expected.pixels.T
        last = expected.width_px - 1
        at, to = (last - u, last - pixels[:, 0]) if camera == "mirror" else (u, pixels[:, 0])
        visible = valid & (mask[v, at] == 0)
        assert visible.mean() > 0.5
        found = flow[v, at][visible]
        # steps of 1/64 px, and a mirror is a mesh
        within_px = 0.05 if camera == "mirror" else 0.01
        np.testing.assert_allclose(found[:, 0], (to - at)[visible], atol=within_px)
        np.testing.assert_allclose(found[:, 1], (pixels[:, 1] - v)[visible], atol=within_px)
        assert set(np.unique(mask)) <= {0, 1, 100, 200}
        inside = np.all((pixels >= -0.5) & (pixels <= (last + 0.5, mask.shape[0] - 0.5)), axis=-1)
        assert np.all(mask[v, at][~(valid & inside)] == 100)
