"""Schemas of JSON results in docs/schemas, against which every result of the tests is validated.

`HDASSIST_RECORD=FOLDER python -m pytest` stores the results. `python -m tests.helpers.answers FOLDER` makes the schemas
from them: a key that all results have is required, and a value has the types that occurred. Further keys are allowed,
because results may get new keys.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Iterable, Sequence
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator

SCHEMAS = Path(__file__).parents[2] / "docs/schemas"
RECORD = "HDASSIST_RECORD"
NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")  # name of a key; other keys are values such as torques, fields and holes
TYPES = {bool: "boolean", int: "integer", float: "number", str: "string", dict: "object", list: "array"}
KINDS = ((False, False), (True, False), (False, True), (True, True))  # whether an object has error, and results
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def hold(arguments: Sequence[str], stdout: str) -> None:
    """Validate the output of a command against its schema, or store it, if it is a single JSON result.

    arguments: arguments of the command.
    stdout: its standard output.
    Raises AssertionError if the result does not match its schema.
    """
    if "--json" not in arguments or not stdout.startswith("{") or "\n{" in stdout:
        return
    answer = json.loads(stdout)
    if folder := os.environ.get(RECORD):
        digest = sha256(stdout.encode()).hexdigest()[:16]
        (Path(folder) / f"{_file(answer['schema'])}-{digest}.json").write_text(stdout, encoding="utf-8")
        return
    faults = [
        f"{fault.json_path}: {fault.message[:200]}" for fault in validator_of(answer["schema"]).iter_errors(answer)
    ]
    assert not faults, (answer["schema"], faults[:5])


@cache
def validator_of(name: str) -> Draft202012Validator:
    """Return the validator of a schema; name: name of the schema, such as hdassist.accept/2."""
    return Draft202012Validator(json.loads((SCHEMAS / f"{_file(name)}.schema.json").read_text(encoding="utf-8")))


def _file(name: str) -> str:
    return name.removeprefix("hdassist.").replace("/", "-")


def inferred(values: Iterable[Any]) -> dict[str, Any]:
    """Return the narrowest schema of some values that allows further keys; errors and results have separate schemas."""
    values = list(values)
    kinds = {
        kind: [v for v in values if (isinstance(v, dict) and ("error" in v, "results" in v)) == kind] for kind in KINDS
    }
    if sum(map(bool, kinds.values())) > 1 and all(isinstance(value, dict) for value in values):
        return {"anyOf": [inferred(of_kind) for of_kind in kinds.values() if of_kind]}
    types = {TYPES.get(type(value), "null") for value in values}
    types -= {"integer"} if "number" in types else set()
    schema: dict[str, Any] = {"type": sorted(types) if len(types) > 1 else next(iter(types), "null")}
    if items := [item for value in values if isinstance(value, list) for item in value]:
        schema["items"] = inferred(items)
    objects = [value for value in values if isinstance(value, dict)]
    keys = dict.fromkeys(key for value in objects for key in value)
    if keys and all(NAME.fullmatch(key) for key in keys):
        schema["properties"] = {key: inferred(v[key] for v in objects if key in v) for key in keys}
        schema["required"] = [key for key in keys if all(key in value for value in objects)]
    elif keys:
        schema["additionalProperties"] = inferred(item for value in objects for item in value.values())
    return schema


def main() -> None:
    """Write the schemas of the stored results in a folder."""
    answers: dict[str, list[Any]] = {}
    for file in sorted(Path(sys.argv[1]).glob("*.json")):
        answer = json.loads(file.read_text(encoding="utf-8"))
        answers.setdefault(answer["schema"], []).append(answer)
    SCHEMAS.mkdir(exist_ok=True)
    for name, of_command in answers.items():
        parts = [{"properties": {"schema": {"const": name}}}, inferred(of_command)]
        schema = {"$schema": DIALECT, "title": name, "allOf": parts}
        text = json.dumps(schema, indent=1, ensure_ascii=False) + "\n"
        (SCHEMAS / f"{_file(name)}.schema.json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
