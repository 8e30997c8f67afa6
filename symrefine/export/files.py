"""The text of JSON files, beside the writing of whole files (`symrefine.files`)."""

import json
from collections.abc import Mapping
from typing import Any

from symrefine.files import check_target, replacing

__all__ = ["check_target", "json_text", "replacing"]


def json_text(data: Mapping[str, Any]) -> str:
    """Strict JSON in ASCII: a line for each entry, and for each object in a list of objects.

    Raises:
        ValueError: NaN or infinity, which JSON does not know.
    """
    entries = [f"  {json.dumps(key)}: {_entry(value)}" for key, value in data.items()]
    return "{\n" + ",\n".join(entries) + "\n}\n"


def _entry(value: Any) -> str:
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return "[\n" + ",\n".join(f"    {_compact(v)}" for v in value) + "\n  ]"
    return _compact(value)


def _compact(value: Any) -> str:
    return json.dumps(value, allow_nan=False)
