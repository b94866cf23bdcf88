"""Adapters of estimators, one module each, see `omnisim.evaluation.estimator`."""
