"""Scenes and cameras that every driver draws, at random poses; each pose twice, singly and in a
batch."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.scenes import WAREHOUSE
from omnisim.core.package_files import built_in
from omnisim.core.poses import pose
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.stage import open_sensor
from omnisim.scene import Scene, load_scene
from tests.cameras.optics.examples import EXAMPLES

USUAL_CHANNELS = ("range", "instance")
OPTICS = ("sphere", "folded", "tilted-mirror")
SPREAD_M = np.array([0.8, 0.8, 0.2])  # of the viewpoints around the scene's start
Channels = dict[str, np.ndarray]  # of one image
Drawings = dict[str, np.ndarray]  # of the images of a case, and their numbers
Cases = dict[str, Callable[[], Drawings]]


def all_cases(size_px: int, poses: int) -> Cases:
    """Every built-in scene, the warehouse where it is, and optical systems, at so many poses."""
    scenes = [*built_in("scene.toml"), *([str(WAREHOUSE)] if WAREHOUSE.is_file() else [])]
    cases = {
        Path(name).stem: partial(
            draw_frames, partial(load_scene, name), OmniCamera(), size_px, poses
        )
        for name in scenes
    }
    courtyard = partial(load_scene, "courtyard")
    return cases | {
        f"{name} in courtyard": partial(draw_frames, courtyard, optics_sensor(name), size_px, poses)
        for name in OPTICS
    }


def poses_in(scene: Scene, count: int) -> np.ndarray:
    """Viewpoints around the scene's start, any way round and a little tilted, (count, 4, 4)."""
    generator = np.random.default_rng(count)
    start = np.zeros(3) if scene.start is None else np.array(scene.start.position_m)
    return np.stack(
        [
            pose(
                start + generator.uniform(-SPREAD_M, SPREAD_M),
                roll_deg=generator.uniform(-8.0, 8.0),
                pitch_deg=generator.uniform(-8.0, 8.0),
                yaw_deg=generator.uniform(0.0, 360.0),
            )
            for _ in range(count)
        ]
    )


def draw_frames(
    load: Callable[[], Scene],
    camera: object,
    size_px: int,
    count: int,
    channels: tuple[str, ...] = USUAL_CHANNELS,
    body: Scene | None = None,
) -> Drawings:
    """Draw images of a camera in a scene, singly, again, and in a batch."""
    scene, sensor = load(), OmniCamera.of(camera)
    with open_sensor(scene, sensor.resized(size_px), body=body) as renderer:
        poses = poses_in(scene, count)
        others = np.roll(poses, 1, axis=0)

        def single(number: int) -> Channels:
            frame = renderer.render(
                poses[number], also=channels, next_state=others[number],
                previous_state=others[number], frame_number=number,
            )  # fmt: skip
            return channels_of(frame, channels)

        return drawings(
            count,
            single,
            lambda: renderer.render_batch(
                poses, channels=("rgb", *channels), next_states=others, previous_states=others
            ),
        )


def channels_of(frame: Frame, names: tuple[str, ...] = USUAL_CHANNELS) -> Channels:
    """Image and ground truth of a frame."""
    return {"rgb": frame.rgb, **{name: frame.channels[name] for name in names}}


def optics_sensor(name: str) -> OmniCamera:
    """Sensor of an optical system of the examples."""
    (file,) = (path for path in EXAMPLES if path.stem == name)
    return OmniCamera.from_file(file)


def drawings(
    count: int, single: Callable[[int], Channels], batch: Callable[[], Channels] | None = None
) -> Drawings:
    """Channels of all poses, and the numbers of poses that were not drawn the same again."""
    first = [single(number) for number in range(count)]
    again = [single(number) for number in range(count)]
    stacked = {name: np.stack([one[name] for one in first]) for name in first[0]}
    differ = [_differs(one, other) for one, other in zip(first, again, strict=True)]
    if batch is not None:
        together = batch()
        of_batch = ({name: together[name][number] for name in stacked} for number in range(count))
        differ += [_differs(one, other) for one, other in zip(first, of_batch, strict=True)]
    return {**stacked, "images": np.array(count), "unlike itself": np.array(sum(differ))}


def _differs(one: Channels, other: Channels) -> bool:
    return any(one[name].tobytes() != other[name].tobytes() for name in one)
