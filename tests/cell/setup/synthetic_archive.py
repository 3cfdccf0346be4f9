"""An archive of a controller that has a cell: data lists as a KRC4 writes them, Latin-1 with CRLF."""

import zipfile

from gcode2krl.cell.sections import Frame

_FRAME = "{{X {0:g},Y {1:g},Z {2:g},A {3:g},B {4:g},C {5:g}}}"
_NO_LOAD = "{M -1.00000,CM {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0},J {X 0.0,Y 0.0,Z 0.0}}"


def frame(values):
    if isinstance(values, Frame):
        values = list(values.model_dump().values())
    return _FRAME.format(*values)


def machine_dat(cell, trafo_name=None, external_axes=0):
    """Return ``$machine.dat`` of the robot."""
    g, limits = cell.robot.geometry, cell.robot.limits.q_deg
    name = trafo_name or f"#{cell.robot.trafo_name} C4 FLR ZH02"
    lines = ["&ACCESS RV$", "DEFDAT  $MACHINE PUBLIC", "CHAR $TRAFONAME[32]"]
    lines += [f'$TRAFONAME[]="{name}" ;NAME DER TRANSFORMATION, MAXIMAL 32 ZEICHEN für den Arm']
    root = cell.frames.robroot or [0.0] * 6
    lines += [f"FRAME $ROBROOT={frame(root)} ;ROBOTER IM WELTKOORDINATENSYSTEM [MM,GRAD]"]
    for axis, (low, high) in enumerate(limits, start=1):
        lines += [f"$SOFTN_END[{axis}]={low:.3f}", f"$SOFTP_END[{axis}]={high:.3f}"]
    for axis, speed in enumerate(cell.robot.speeds.qd_deg_s, start=1):
        lines += [f"$RAT_MOT_AX[{axis}]={{N -1798,D 7}}", f"$VEL_AXIS_MA[{axis}]={speed / 6 * 1798 / 7:.5f}"]
    lines += [
        f"FRAME $TIRORO={frame([0, 0, g.c1_mm, 0, 0, 0])} ;FRAME",
        f"FRAME $TFLWP={frame([0, 0, g.c4_mm, 0, 0, 0])}",
        f"FRAME $TX3P3={frame([g.c3_mm, 0, -g.a2_mm, 0, 90, 0])} ;ANBRINGUNG DER ROBOTERHAND",
        f"REAL $LENGTH_A={g.a1_mm:.3f} ;GRUNDACHSLAENGE A",
        f"REAL $LENGTH_B={g.c2_mm:.2f} ;GRUNDACHSLAENGE B",
        "DECL DHART $DH_4={DHART_A 0.0,DHART_D 0.0,DHART_ALPHA 90.0000}",
        "DECL DHART $DH_5={DHART_A 0.0,DHART_D 0.0,DHART_ALPHA -90.0000}",
        f"INT $EX_AX_NUM={external_axes} ;ANZAHL EXTERNER ACHSEN (0-6)",
        "ENDDAT",
    ]
    return "\r\n".join(lines)


def config_dat(cell, tools=(), bases=(), loads=(), machine_name=""):
    """Return ``$config.dat``; ``tools`` and ``bases`` are (number, name, frame), ``loads`` (number, load)."""
    home = ",".join(f"A{k} {angle:g}" for k, angle in enumerate(cell.home.q_deg, start=1))
    lines = ["&ACCESS RV$1", "DEFDAT  $CONFIG", "INT DEF_OV_PRO=100", "", "; HOME POSITION"]
    lines += [f"E6AXIS XHOME={{{home},E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 0.0,E6 0.0}}"]
    lines += _entries("TOOL", 16, tools)
    lines += ["DECL LOAD LOAD_DATA[16]"]
    stated = dict(loads)
    lines += [f"LOAD_DATA[{n}]={_load(stated[n]) if n in stated else _NO_LOAD}" for n in range(1, 17)]
    lines += _entries("BASE", 32, bases)
    machine = f'NAME[] "{machine_name or " "}",COOP_KRC_INDEX 1,PARENT[] "WORLD",ROOT {frame([0] * 6)}'
    lines += [f'MACHINE_DEF[1]={{{machine},MECH_TYPE #ROBOT,GEOMETRY[] " "}}', "ENDDAT"]
    return "\r\n".join(lines)


def _entries(kind, count, measured):
    frames, names = {n: f for n, _, f in measured}, {n: name for n, name, _ in measured}
    lines = [f"DECL FRAME {kind}_DATA[{count}]"]
    lines += [f"{kind}_DATA[{n}]={frame(frames.get(n, [0.0] * 6))}" for n in range(1, count + 1)]
    lines += [f"DECL CHAR {kind}_NAME[{count},24]"]
    return lines + [f'{kind}_NAME[{n},]="{names.get(n, " ")}"' for n in range(1, count + 1)]


def _load(load):
    centre = f"{{X {load.x_mm:g},Y {load.y_mm:g},Z {load.z_mm:g},A 0.0,B 0.0,C 0.0}}"
    inertia = f"{{X {load.jx_kgm2:g},Y {load.jy_kgm2:g},Z {load.jz_kgm2:g}}}"
    return f"{{M {load.mass_kg:g},CM {centre},J {inertia}}}"


def write_folder(folder, config, machine):
    """Write an archive as a folder, as it lies on a stick."""
    for place, text in (("System/$config.dat", config), ("Mada/$machine.dat", machine)):
        file = folder / "KRC" / "R1" / place
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(text.encode("latin-1"))
    steu = folder / "KRC" / "Steu" / "Mada" / "$machine.dat"
    steu.parent.mkdir(parents=True)
    steu.write_bytes(b"DEFDAT  $MACHINE PUBLIC\r\nINT $NUM_AX=6\r\nENDDAT")
    return folder


def write_zip(path, config, machine):
    """Write an archive as a zip."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            "am.ini", "[Archive]\r\nName=robot\r\n[Version]\r\nVersion=V8.3.29\r\n[TechPacks]\r\n"
        )
        archive.writestr("KRC/R1/System/$config.dat", config.encode("latin-1"))
        archive.writestr("KRC/R1/Mada/$machine.dat", machine.encode("latin-1"))
        archive.writestr("KRC/STEU/Mada/$machine.dat", b"DEFDAT  $MACHINE PUBLIC\r\nENDDAT")
    return path
