"""Scenarios."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any, Union

from ._plumage import Scenario

#: What describes a mission: a scenario, its file, or its tables.
ScenarioLike = Union[Scenario, str, "os.PathLike[str]", Mapping[str, Any]]


def scenario_of(like: ScenarioLike) -> Scenario:
    """Return a scenario, read from a file or tables if needed."""
    if isinstance(like, Scenario):
        return like
    if isinstance(like, Mapping):
        return Scenario.from_dict(like)
    return Scenario(os.fspath(like))


def as_json(tables: Mapping[str, Any]) -> str:
    """Return tables as JSON without entries that are None."""
    return json.dumps(_without_none(tables))


def _without_none(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _without_none(one) for key, one in value.items() if one is not None}
    if isinstance(value, (list, tuple)):
        return [_without_none(one) for one in value]
    return value
