"""Frames without end, single and in batches of changing sizes: memory stays what it was."""

import numpy as np

from omnisim import OmniCamera, Renderer, pose
from omnisim.sensors.stage import Stage
from tests.gpu.sheets import mixed_scene
from tests.soak.renderers import resident_bytes

# Bytes, whatever the number of frames: what batches of changing sizes free comes back in parts,
# which moves the memory up and down by 5 MB. Kept pictures of 6000 frames would take 10 MB.
LARGEST_GROWTH = 8e6
CAMERA = OmniCamera().resized(24).with_quality("fast")
BATCHES = (16, 5, 40, 40, 1, 23)  # more and fewer than before, and the same


def frames(times: int, print_line=print) -> float:
    """Render `times` frames by one renderer.

    Args:
        times: about how many; batches are not cut.
        print_line: called with the progress.

    Returns:
        Bytes by which the most memory of the last third is above that of the second.
    """
    poses = np.stack([pose((0.05 * k - 1.0, 0.0, 0.8), yaw_deg=9.0 * k) for k in range(40)])
    done, printed, most = 0, 0, [0, 0, 0]
    with Stage(mixed_scene()) as stage, Renderer(stage, CAMERA) as renderer:
        while done < times:
            third = 3 * done // times
            for count in BATCHES:
                renderer.render_batch(poses[:count])
                for one in poses[:4]:
                    renderer.render(one)
                done += count + 4
            names = ("rgba", "range", "instance", "flow")
            renderer.render_batch(poses[:2], channels=names, next_states=poses[1:3])
            done += 2
            most[third] = max(most[third], resident_bytes())
            if done - printed >= 5000:
                printed = done
                print_line(f"{done} of {times} frames: at most {most[third] / 1e6:.1f} MB")
    return most[2] - most[1]
