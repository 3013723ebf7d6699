"""Text that other programs send, made safe to print."""

from typing import Final

# Control characters could move the cursor or change the terminal, and marks of direction the order in which a line is read. A
# new line and a tab are harmless.
_CONTROLS: Final = (*range(0x20), *range(0x7F, 0xA0))
_DIRECTIONS: Final = (0x061C, 0x200E, 0x200F, 0x2028, 0x2029, *range(0x202A, 0x202F), *range(0x2066, 0x206A))
_ESCAPED: Final = {code: f"\\x{code:02x}" for code in _CONTROLS if chr(code) not in "\n\t"} | {
    code: f"\\u{code:04x}" for code in _DIRECTIONS
}


def printable_line(text: str) -> str:
    """Return `text` as `printable` does, and on one line: no text can add a line that seems to be of someone else."""
    return printable(text).replace("\n", "\\n")


def printable(text: str) -> str:
    """Return `text` with control characters, marks of direction and lone surrogates as escapes such as \\x1b."""
    return text.translate(_ESCAPED).encode(errors="backslashreplace").decode()
