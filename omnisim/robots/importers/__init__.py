"""Importers of robots from models of other simulators."""
