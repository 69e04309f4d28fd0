"""A file for a library to write to that does not bear a full disk: HDF5 then takes the whole process down with it."""

from __future__ import annotations

from io import FileIO
from pathlib import Path


class Disk(FileIO):
    """A new file, for a `with` block: no write to it fails, and the end of the block raises the first OSError there was."""

    def __init__(self, path: Path):
        super().__init__(path, "w+")
        self.error: OSError | None = None

    def __exit__(self, kind, *rest) -> None:
        super().__exit__(kind, *rest)
        if self.error:
            raise self.error

    def write(self, data) -> int:
        left = memoryview(data)
        try:
            while len(left) and not self.error:
                left = left[super().write(left) :]
        except OSError as error:
            self.error = error
        return len(data)

    def truncate(self, size: int | None = None) -> int | None:
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
