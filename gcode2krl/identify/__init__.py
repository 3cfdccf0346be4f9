"""Measurements to a cell's numbers: controller, stiffness, force sensor, cutting force."""
