"""Validates scene files against the JSON Schema, with a validator of its own. Input: {"schema": .., "texts": [..]}."""

import json
import sys
import tomllib

import jsonschema

with open(sys.argv[1], encoding="utf-8") as file:
    task = json.load(file)
validator = jsonschema.Draft7Validator(task["schema"])
jsonschema.Draft7Validator.check_schema(task["schema"])
print(json.dumps([validator.is_valid(tomllib.loads(text)) for text in task["texts"]]))
