"""Figures and reports: tables and plain dicts drawn for people.

``gcode2krl.report.figures`` loads matplotlib, so it is imported where a figure is asked for, not here.
"""
