"""What a batch writes for others to read: a module a file format, each a pure function of records."""

from collections.abc import Iterable

from gcode2krl.batch.written.changes import Change, Difference, difference, with_against
from gcode2krl.batch.written.index import index_html
from gcode2krl.batch.written.junit import junit_xml
from gcode2krl.batch.written.part import Record, records_of, results_jsonl
from gcode2krl.batch.written.sarif import findings_sarif
from gcode2krl.batch.written.summary import summary_md

__all__ = [
    "Change",
    "Difference",
    "Record",
    "contents",
    "difference",
    "findings_sarif",
    "index_html",
    "junit_xml",
    "records_of",
    "results_jsonl",
    "summary_md",
]


def contents(
    records: Iterable[Record], before: Iterable[Record] | None = None, root: str = ""
) -> dict[str, bytes]:
    """Return name → content of all files of a batch.

    Parameters
    ----------
    records : what became of each part, as in ``results.jsonl``; their ``against`` is filled in.
    before : the records of the last run, None where there was none.
    root : the absolute folder in which the run began, for ``findings.sarif``.
    """
    before = list(before) if before is not None else None
    records = with_against(records, before)
    return {
        "results.jsonl": results_jsonl(records),
        "junit.xml": junit_xml(records),
        "findings.sarif": findings_sarif(records, root),
        "summary.md": summary_md(records, before).encode("utf-8"),
        "index.html": index_html(records, before).encode("utf-8"),
    }
