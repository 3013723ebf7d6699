"""Text that other programs send, made safe to print."""

from typing import Final

# Control characters could move the cursor or change the terminal. A new line and a tab are harmless.
_ESCAPED: Final = {code: f"\\x{code:02x}" for code in (*range(0x20), *range(0x7F, 0xA0)) if chr(code) not in "\n\t"}


def printable(text: str) -> str:
    """Return `text` with control characters and lone surrogates as escapes such as \\x1b."""
    return text.translate(_ESCAPED).encode(errors="backslashreplace").decode()
