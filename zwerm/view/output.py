"""The files of pictures: their suffixes and folders."""

from pathlib import Path

from zwerm.errors import PictureError


def prepare(path: Path, suffixes: tuple[str, ...]) -> None:
    """Make the folder of `path`. Raises PictureError for another suffix, or a folder that cannot be made."""
    if path.suffix.lower() not in suffixes:
        raise PictureError(f"{path}: expected a file that ends in {' or '.join(suffixes)}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise PictureError(f"{path}: its folder cannot be made: {error.strerror}") from None
