"""Prediction and run brought together: pairs, traces, links, clocks, splits."""
