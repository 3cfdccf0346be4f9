"""The findings that would refuse a program, or be told with it, judged anew with the cell as it is now."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from gcode2krl.chain import Plan, foresee
from gcode2krl.errors import Issue
from gcode2krl.krl.release import is_refusing, released_again
from gcode2krl.krl.rsi_refusals import online_issues, retract_issues
from gcode2krl.prediction import Prediction


def judged(
    plan: Plan,
    prediction: Prediction | None,
    releases: Mapping[str, int | None],
    *,
    online: bool,
    forces: bool,
) -> list[Issue]:
    """Return errors and warnings of the checks of a translation, each with the G-code as its file.

    Those that a Prediction brings along are not run again.
    ``releases`` are those in the header of the program and how many findings each was for, None for any.
    ``forces`` cuts material too.
    """
    targets, cell = plan.targets, plan.cell
    known = [*targets.issues] if prediction is None else [*prediction.issues]
    if online:
        known = [*online_issues(targets, cell), *retract_issues(targets, cell), *known]
    if prediction is None and not is_refusing(known, releases):  # else nothing can be foreseen
        forecast = foresee(plan, forces=forces)
        known += forecast.issues[len(targets.issues) :]
    return list(_of_gcode(released_again(known, releases), plan.toolpath.source))


def _of_gcode(issues: Iterable[Issue], source: str) -> Iterator[Issue]:
    """Yield the findings but the notes, with the file that they are about."""
    for issue in issues:
        if issue.severity != "note":
            yield issue if issue.file else replace(issue, file=source)
