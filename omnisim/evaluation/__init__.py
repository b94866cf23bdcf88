"""Evaluation of estimators: trajectories and calibrations beside the truth of recorded runs.

An estimator is an adapter to a method that estimates a robot's trajectory, or calibrates its
camera, from a run's sensors: third-party odometry, SLAM and calibration, or our own. Each runs in
its own process.
"""
