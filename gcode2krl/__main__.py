"""``python -m gcode2krl``."""

from gcode2krl.cli.main import main

main()
