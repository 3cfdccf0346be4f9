"""Single KRL statements: frames, joint targets, tool and base, M-codes from the cell's templates."""

import re
from functools import lru_cache
from typing import Any

import jinja2
import numpy as np

from gcode2krl import frames as fr
from gcode2krl import krl_words as w
from gcode2krl.arrays import Floats
from gcode2krl.cell import Cell, carriers, controller_axes, plain_view, template_rules
from gcode2krl.cell import templates as cell_templates
from gcode2krl.cell.sections import missing, missing_key
from gcode2krl.cell.switching import template_issue
from gcode2krl.errors import RefusedError
from gcode2krl.krl.number_text import fixed
from gcode2krl.tables import Event
from gcode2krl.units import DEG_PER_RAD

_MESSAGE_CHARACTERS = 70
_LOAD_SHARE, _LOAD_KG, _LOAD_MM = 0.01, 0.5, 5.0
_INERTIA_SHARE, _INERTIA_KGM2 = 0.2, 0.05


def frame_text(matrix: Floats) -> str:
    """Return a transform (4, 4) as a KRL frame, mm and degrees."""
    abc = fr.abc_from_rotation(matrix[:3, :3]) * DEG_PER_RAD
    values = [*(fixed(v, 3) for v in matrix[:3, 3]), *(fixed(v, 4) for v in abc)]
    return "{" + ",".join(f"{key} {value}" for key, value in zip(w.POSE_KEYS, values, strict=True)) + "}"


def axes_text(q_deg: Floats, external: str = "") -> str:
    """Return joint angles (6,) in degrees, and what `external_text` returns, as a KRL axis target."""
    angles = ",".join(f"{key} {fixed(angle, 4)}" for key, angle in zip(w.AXIS_KEYS, q_deg, strict=True))
    return f"{{{angles}{external}}}"


def external_text(external: Floats, cell: Cell) -> str:
    """Return the external axes of a cell at E1 to E6 (6,) as further components of a target."""
    axes = zip(w.EXTERNAL_KEYS, external, strict=True)
    return "".join(f",{key} {fixed(at, 3)}" for key, at in axes if key in cell.external)


def external_bits(cell: Cell) -> int:
    """Return the external axes of a cell as bits, bit 0 = E1."""
    return sum(1 << k for k, key in enumerate(w.EXTERNAL_KEYS) if key in cell.external)


def ascii_text(text: str, most: int = _MESSAGE_CHARACTERS) -> str:
    """Return text that may stand in a KRL string or comment: printable ASCII, no quotes or braces."""
    return re.sub(r"[^ !#$%&\'()*+,\-./0-9:;<=>?@A-Z\[\]^_a-z~]", "?", text)[:most]


def base_statement(cell: Cell, external: Floats) -> str:
    """Return the statements that set ``$BASE``, E1 to E6 at (6,).

    A table that the controller couples is named by EK, which lets ``$BASE`` move with it (KUKA's BAS.SRC).
    """
    number, table = cell.frames.base_data, coupled_table(cell)
    if table is not None:
        offset = "GK_BASE" if number is None else f"{w.BASE_DATA}[{number}]"
        base = f"GK_BASE={frame_text(cell.stated_base())}\n" if number is None else ""
        return f"{base}{w.BASE}=EK({table}.ROOT,{table}.MECH_TYPE,{offset})"
    if number is not None:
        return f"{w.BAS} (#BASE,{number} )"
    return f"{w.BASE}={frame_text(base_of_controller(cell, external))}"


def coupled_table(cell: Cell) -> str | None:
    """Return the machine of the table that carries ``$BASE``, ``MACHINE_DEF[2]``; None without one."""
    tables = carriers.tables_of(cell.external, cell.frames.base_on)
    number = cell.external[tables[-1]].machine_def if tables else None
    return None if number is None else f"{w.MACHINE_DEF}[{number}]"


def base_of_controller(cell: Cell, external: Floats) -> Floats:
    """Return ``$BASE`` (4, 4) as the controller must have it, the external axes at E1 to E6 (6,).

    In ``$WORLD``, or in the table that the controller couples. A rail that it does not couple leaves
    ``$ROBROOT`` where it is: to the controller the part has moved instead.
    """
    if coupled_table(cell) is not None:
        return cell.stated_base()
    rails = carriers.rails_of(cell.external)
    if rails and not cell.external[rails[0]].is_coupled:
        robroot = cell.frames.robroot
        in_root: Floats = cell.base_in_root(external[None])[0]
        return in_root if robroot is None else robroot.matrix() @ in_root
    in_world: Floats = carriers.base_in_world(
        cell.external, external[None], cell.stated_base(), cell.frames.base_on
    )[0]
    return in_world


def unnumbered(cell: Cell, tools: list[int]) -> str:
    """Return which of ``$ACT_BASE`` and ``$ACT_TOOL`` are not those in use, as frames are set by value.

    Only ``BAS(#BASE,n)`` and ``BAS(#TOOL,n)`` set them; a frame assigned to ``$BASE`` or ``$TOOL`` leaves
    them at what ``BAS(#INITMOV,0)`` or the last number set (KUKA's BAS.SRC of KSS 8).
    """
    by_value = {
        w.ACT_BASE: cell.frames.base_data is None or coupled_table(cell) is not None,
        w.ACT_TOOL: any(cell.tool[number].tool_data is None for number in tools),
    }
    return ", ".join(name for name, stale in by_value.items() if stale)


def tool_statements(cell: Cell, number: int) -> str:
    """Return the statements that set ``$TOOL`` and ``$LOAD`` for a tool."""
    tool = cell.tool[number]
    if tool.tool_data is not None:
        return f"{w.BAS} (#TOOL,{tool.tool_data} )"
    load = cell.load_of(number)
    if load.mass_kg is None:
        raise missing("load.mass_kg")
    centre = (
        f"CM {{X {fixed(load.x_mm, 3)},Y {fixed(load.y_mm, 3)},Z {fixed(load.z_mm, 3)},A 0.0,B 0.0,C 0.0}}"
    )
    inertia = f"J {{X {fixed(load.jx_kgm2, 4)},Y {fixed(load.jy_kgm2, 4)},Z {fixed(load.jz_kgm2, 4)}}}"
    load_text = f"{{M {fixed(load.mass_kg, 3)},{centre},{inertia}}}"
    return f"{w.TOOL}={frame_text(written_tool(cell, number))}\n{w.LOAD}={load_text}"


def written_tool(cell: Cell, number: int) -> Floats:
    """Return the tool frame (4, 4) as the controller has it, in its own axes."""
    return cell.tool_matrix(number) @ fr.invert(controller_axes(cell.tool[number].axis or "+z"))


def frame_checks(cell: Cell, tools: list[int], external: Floats) -> list[dict[str, str]]:
    """Return what the guard compares: the mounting where the cell states it, and frames set by number.

    Each with the inverse of what it should be. A rail that the controller couples takes the place of
    ``$ROBROOT``, which it then ignores (KUKA's machine data, ``$ERSYSROOT``): `root_check`.
    """
    checks = []
    if cell.frames.robroot is not None and not has_coupled_rail(cell):
        inverse = frame_text(fr.invert(cell.frames.robroot.matrix()))
        checks.append({"variable": w.ROBROOT, "inverse": inverse})
    if cell.frames.base_data is not None:
        checks.append(
            {
                "variable": f"{w.BASE_DATA}[{cell.frames.base_data}]",
                "inverse": frame_text(fr.invert(base_of_controller(cell, external))),
            }
        )
    for number in tools:
        data = cell.tool[number].tool_data
        if data is not None:
            checks.append(
                {
                    "variable": f"{w.TOOL_DATA}[{data}]",
                    "inverse": frame_text(fr.invert(written_tool(cell, number))),
                }
            )
    return checks


def load_checks(cell: Cell, tools: list[int]) -> list[dict[str, str]]:
    """Return what the guard compares of the loads that a tool's number sets: where one ``differs``.

    Assumed tolerances: what moves the arm less than a careful load determination is sure of. The inertia is
    compared by its sum about three axes, which is the same in the flange and in the axes A, B, C of ``CM``.
    """
    checks = {}
    for number in tools:
        data, load = cell.tool[number].tool_data, cell.load_of(number)
        if data is None or load.mass_kg is None:
            continue
        variable = f"{w.LOAD_DATA}[{data}]"
        inertia_kgm2 = load.jx_kgm2 + load.jy_kgm2 + load.jz_kgm2
        rows = [
            (".M", load.mass_kg, max(_LOAD_SHARE * load.mass_kg, _LOAD_KG)),
            *((f".CM.{axis}", getattr(load, f"{axis.lower()}_mm"), _LOAD_MM) for axis in "XYZ"),
        ]
        if inertia_kgm2 > 0:
            about_all = f".J.X+{variable}.J.Y+{variable}.J.Z"
            rows.append((about_all, inertia_kgm2, max(_INERTIA_SHARE * inertia_kgm2, _INERTIA_KGM2)))
        terms = [
            f"(ABS({variable}{name}-{_operand(value)})>{fixed(slack, 3)})" for name, value, slack in rows
        ]
        checks[variable] = {"variable": variable, "differs": " OR ".join(terms)}
    return list(checks.values())


def not_compared_loads(cell: Cell, tools: list[int]) -> list[str]:
    """Return what the header says of loads that a tool's number sets and the guard does not compare."""
    lines = {}
    for number in tools:
        data, load = cell.tool[number].tool_data, cell.load_of(number)
        if data is not None and load.mass_kg is None:
            lines[data] = f"{w.LOAD_DATA}[{data}] IS NOT COMPARED: the cell states no load"
        elif data is not None and not load.jx_kgm2 + load.jy_kgm2 + load.jz_kgm2:
            lines[data] = f"the inertia in {w.LOAD_DATA}[{data}] is not compared: the cell states none"
    return list(lines.values())


def robot_names(cell: Cell) -> dict[str, str]:
    """Return what ``$TRAFONAME[]`` must be: the ``whole`` of it, or what it ``begins`` with."""
    name = cell.robot.trafo_name.removeprefix("#").strip()
    return {"whole": name, "begins": f"{name} "} if name else {}


def _operand(value: float) -> str:
    """Return a number that may stand behind a minus."""
    text = fixed(value, 3)
    return f"({text})" if value < 0 else text


def has_coupled_rail(cell: Cell) -> bool:
    """Tell whether the controller knows of a rail under the robot."""
    rails = carriers.rails_of(cell.external)
    return bool(rails) and cell.external[rails[0]].is_coupled


def root_check(cell: Cell, external: Floats) -> dict[str, str] | None:
    """Return what the guard compares once E1 to E6 are at (6,): where a rail has put the robot."""
    if not has_coupled_rail(cell):
        return None
    robroot = np.eye(4) if cell.frames.robroot is None else cell.frames.robroot.matrix()
    root = carriers.root_in_world(cell.external, external[None], robroot)[0]
    return {"variable": w.ROBROOT_NOW, "inverse": frame_text(fr.invert(root))}


def event_statements(event: Event, cell: Cell) -> str:
    """Return the KRL of an event, from the cell's templates; a note where it was released without one.

    That of a tool change does not set the tool: what is in force behind it, `controller_state` says.
    """
    line = event.values["line"]
    place = f"line {line}" if line else "end of the program"
    if event.kind == "tool":
        number = event.values["tool"]
        text = render(cell, "tool_change", tool=number, line=line)
        return f"; line {line}: M6 T{number}\n{text}"
    code = event.values["m"]
    if code < 0:
        message = ascii_text(event.values["text"])
        return (
            f'; line {line}: message\nGK_MSG={{MODUL[] "GCODE2KRL",NR 9,MSG_TXT[] "{message}"}}\n'
            "GK_HANDLE=SET_KRLMSG(#NOTIFY,GK_MSG,GK_PAR[],GK_OPT)"
        )
    if f"M{code}" not in cell.m_code:
        return f"; line {line}: M{code} HAS NO KRL IN THE CELL AND WAS RELEASED BY HAND"
    rpm = abs(event.values.get("rpm", 0.0))
    text = render(
        cell,
        f"m_code.M{code}",
        rpm=rpm,
        m=code,
        p=event.values.get("p"),
        q=event.values.get("q"),
        e=event.values.get("e"),
        text=ascii_text(event.values.get("text", "")),
        line=line,
    )
    return f"; {place}: M{code}" + (f" S{rpm:g}" if rpm else "") + f"\n{text}"


def render(cell: Cell, key: str, **values: Any) -> str:
    """Return the KRL of a template of the cell (``m_code.M8``, ``program.prologue``), empty without one.

    Raises `RefusedError` that names the key where it cannot be rendered, or says what it must not.
    """
    template = cell.templates().get(key, "")
    view = {"spindle": cell.spindle.model_dump()}
    if cell_templates.uses_cell(template):
        view["cell"] = plain_view(cell)
    try:
        text = cell_templates.render(template, {**view, **values})
    except cell_templates.MissingValueError as error:
        if "." in error.key:
            raise RefusedError(missing_key(error.key.removeprefix("cell."), f"{key} switches it")) from None
        raise RefusedError(template_issue(key, str(error))) from None
    except cell_templates.TemplateError as error:
        raise RefusedError(template_issue(key, str(error))) from None
    problem = template_rules.problem(text, cell.program.externals)
    if problem:
        raise RefusedError(template_issue(key, problem))
    return text


@lru_cache(maxsize=1)
def environment() -> jinja2.Environment:
    """Return the Jinja2 environment of the package's own templates; an unknown name is an error."""
    loader = jinja2.PackageLoader("gcode2krl.krl", "templates")
    made = jinja2.Environment(  # templates of this package alone; those of cells: cell_templates
        loader=loader,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=False,
    )
    made.filters["decimals"] = lambda value, count: fixed(float(value), int(count))
    made.filters["krl_text"] = ascii_text
    return made
