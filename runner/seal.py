"""Checksums: of a run's files, and of the report that notes them, so that a damaged file does not pass for a result."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from typing import Any

from pydantic_core import to_json

from runner import forms

MARK = b',\n "sha256": "'  # before the checksum, which ends a sealed text


def checksum(path: Path) -> dict[str, Any]:
    """The file's size and its SHA-256, as `sha256sum` prints it."""
    with open(path, "rb", buffering=0) as file:
        return {"bytes": os.fstat(file.fileno()).st_size, "sha256": hashlib.file_digest(file, "sha256").hexdigest()}


def fault(path: Path, noted: dict[str, Any]) -> str | None:
    """What is wrong with the file, held against the checksum noted when it was made; None when nothing is."""
    try:
        if not path.is_file():  # a device or a pipe would be read for ever
            return "missing"
        size = path.stat().st_size
        if size != (told := noted.get("bytes")):
            return f"has {size} bytes instead of {told}"
        return None if checksum(path) == noted else "changed, its checksum is another"
    except FileNotFoundError:
        return "missing"
    except OSError as error:
        return f"cannot be read: {error.strerror or error}"


def seal(data: dict[str, Any]) -> bytes:
    """`data` as JSON that ends with the checksum of the text before."""
    text = to_json(data, indent=1, inf_nan_mode="null").removesuffix(b"\n}")
    return text + _ending(text)


def unseal(text: bytes) -> dict[str, Any]:
    """What was sealed, and its checksum as `sha256`; what older versions made has none.

    Raises ValueError in a few words when the text was cut or changed.
    """
    try:
        data = forms.parse(text)
    except ValueError:
        raise ValueError("cut or changed, it is not JSON any more") from None
    body, mark, _ = text.rpartition(MARK)
    if not isinstance(data, dict) or mark and text != body + _ending(body):
        raise ValueError("changed, its checksum is another")
    return data


def _ending(text: bytes) -> bytes:
    return MARK + hashlib.sha256(text).hexdigest().encode() + b'"\n}\n'
