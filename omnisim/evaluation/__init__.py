"""Evaluation of estimators on recorded runs, whose truth is known.

An estimator is an adapter to a method that finds a robot's trajectory from a run's sensors:
third-party odometry and SLAM, or dead reckoning. Each runs in a process of its own.
"""
