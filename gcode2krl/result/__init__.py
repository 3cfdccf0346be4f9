"""The record: one JSON object that says what a command was given, did and found."""

from gcode2krl.result.record import SCHEMA, cell_of, hashes_of, input_of, issue_dicts, record_of, sha256_of

__all__ = ["SCHEMA", "cell_of", "hashes_of", "input_of", "issue_dicts", "record_of", "sha256_of"]
