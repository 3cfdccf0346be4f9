"""The report: one page without network that shows a prediction in 3D, over time and beside its G-code."""

from gcode2krl.report.page.content import Content, content_of, content_of_refused
from gcode2krl.report.page.one_file import page, write_page

__all__ = ["Content", "content_of", "content_of_refused", "page", "write_page"]
