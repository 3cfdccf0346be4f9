"""Prediction and run brought together: pairs, traces, links, clocks, events, splits, and set-up slips."""
