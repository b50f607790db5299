"""Where a value is not what a JSON Schema says: the words of JSON Schema that the schemas of results use."""

from __future__ import annotations

TYPES = {"object": dict, "array": list, "string": str, "boolean": bool, "integer": int, "number": (int, float)}


def faults(value, schema, defs, path=""):  # noqa: PLR0911 - a word of JSON Schema each
    if "$ref" in schema:
        return faults(value, defs[schema["$ref"].rpartition("/")[2]], defs, path)
    if "anyOf" in schema:
        found = [faults(value, one, defs, path) for one in schema["anyOf"]]
        return [] if [] in found else min(found, key=len)
    kind = schema.get("type")
    if kind == "null":
        return [] if value is None else [f"{path}: not null"]
    if kind and (not isinstance(value, TYPES[kind]) or (isinstance(value, bool) and kind != "boolean")):
        return [f"{path}: {value!r:.40} is no {kind}"]
    if isinstance(value, list):
        kinds = schema.get("prefixItems") or [schema.get("items", {})] * len(value)
        return [f for k, one in enumerate(value) for f in faults(one, kinds[k], defs, f"{path}[{k}]")]
    if isinstance(value, dict) and "properties" in schema:
        known = schema["properties"]
        found = [f"{path}: {key} is missing" for key in schema.get("required", ()) if key not in value]
        found += [f"{path}: {key} is not in the schema" for key in value if key not in known]
        return found + [
            f for key in value if key in known for f in faults(value[key], known[key], defs, f"{path}.{key}")
        ]
    if isinstance(value, dict) and isinstance(schema.get("additionalProperties"), dict):
        return [f for k, one in value.items() for f in faults(one, schema["additionalProperties"], defs, f"{path}.{k}")]
    return []
