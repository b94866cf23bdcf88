"""Localization by mapped colored landmarks: the Kalman filter of `omnisim localize`.

Source: Schmits & Visser, "An omnidirectional camera simulation for the USARSim world", 2008.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from omnisim.core.errors import EstimatorError
from omnisim.core.poses import pose
from omnisim.core.trajectories import Trajectory
from omnisim.datasets.export.recording import Recording
from omnisim.evaluation.estimator import Estimator
from omnisim.perception.landmarks.color_model import Costs
from omnisim.perception.landmarks.landmark_detector import LandmarkDetector
from omnisim.perception.localization.filter import LandmarkMap, read_parameters
from omnisim.perception.localization.track import localize, observation_from_detection
from omnisim.runs.run_data import read_run, train_on_run


class LandmarkLocalization(Estimator):
    """Wheels and landmarks, from the true start; colors are trained on the run's own labels."""

    title = "landmarks and wheels"
    alignment = "none"
    is_level = True

    def estimate(self, run: Recording, work: Path) -> Trajectory:
        """Poses of the base at the steps, at the height of the start."""
        if not run.cameras:
            raise EstimatorError("the run has no camera")
        data = read_run(run.run.path, camera=run.cameras[0].name)
        parameters = read_parameters()
        colors = train_on_run(data, Costs()).model
        detector = LandmarkDetector(colors, data.landmarks, data.mount)
        observations = [
            [observation_from_detection(found, parameters.measurement) for found in detector(image)]
            for image in data.images()
        ]
        known, camera_m = LandmarkMap.of_scene(data.landmarks), data.mount.position_m
        track = localize(data.odometry, observations, known, parameters, camera_m)
        z_m = float(run.truth.positions_m[0, 2])
        poses = [
            pose((x_m, y_m, z_m), yaw_deg=float(np.degrees(yaw_rad)))
            for x_m, y_m, yaw_rad in track.poses
        ]
        return Trajectory(track.times_s, np.stack(poses))
