"""Tables as other libraries take them: names and units of columns, polars, pandas, Arrow, Parquet, HTML."""

from gcode2krl.exchange.column_units import unit_of
from gcode2krl.exchange.disk_names import column_names
from gcode2krl.exchange.findings import Findings
from gcode2krl.exchange.frame import ColumnFrame, Frame
from gcode2krl.exchange.table import Table, column, derived_column

__all__ = ["ColumnFrame", "Findings", "Frame", "Table", "column", "column_names", "derived_column", "unit_of"]
