"""What can be wrong with M61 to M73: number in the core, then severity, stable code, sentence, remedy."""

from gcode2krl.errors import Severity

IO_WORD, IO_VALUE, IO_BESIDE, TOOL_NUMBER = range(260, 264)
NOT_SAVED, RESTORE_BESIDE, RESTORE_CUTTER, RESTORE_LENGTH = range(264, 268)
TEXTS: dict[int, tuple[Severity, str, str, str]] = {
    IO_WORD: (
        "error",
        "output-word",
        "M{a:.0f} needs {number}, the number of its output, whole and not negative{value}",
        "write M62 P3 to M65 P3 for switches, M67 E0 Q2.5 and M68 E0 Q2.5 for values",
    ),
    IO_VALUE: ("error", "output-word", "M{a:.0f} without Q, the value of its output", "write M67 E0 Q2.5"),
    IO_BESIDE: (
        "error",
        "two-uses",
        "M{a:.0f} and another code of the block would share its words P, Q or E",
        "write them in separate blocks",
    ),
    TOOL_NUMBER: (
        "error",
        "tool-number",
        "M61 says that tool {a:.0f} is in the spindle, where {there} is; nothing changes it",
        "write T{a:.0f} M6, or mounted_tool = {a:.0f} in the cell where it is in the spindle at the start",
    ),
    NOT_SAVED: (
        "error",
        "modes-restore",
        "M72 restores modes that nothing has saved in this program or subprogram",
        "write M70 before it, in the same subprogram",
    ),
    RESTORE_BESIDE: (
        "error",
        "modes-restore",
        "M72 shares its block with other words, which LinuxCNC then drops",
        "write M72 on a line of its own",
    ),
    RESTORE_CUTTER: (
        "error",
        "modes-restore",
        "modes are restored while cutter compensation is on, or was when they were saved",
        "write G40 and a straight move before both",
    ),
    RESTORE_LENGTH: (
        "error",
        "modes-restore",
        "the saved modes have a tool length of {a:.4f} mm, which LinuxCNC does not bring back: it would be "
        "{b:.4f} mm",
        "write G43 with its H, or G49, behind it",
    ),
}
