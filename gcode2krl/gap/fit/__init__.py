"""The statistical model of a link and its fit."""
