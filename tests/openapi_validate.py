#!/usr/bin/python3
"""Checks an OpenAPI 3.1 document on stdin; prints every fault and exits 1 if there is one.

Debian has the JSON schema of OpenAPI 3.0 only (package openapi-specification). What 3.1 changed of the structure
that this document uses is the Schema Object, which became plain JSON Schema 2020-12, and the member `identifier`
of a licence. So: the structure by the 3.0 schema with these two exchanged, each Schema Object by the
2020-12 meta-schema (package python3-jsonschema), references, operation ids and path parameters by hand.
With arguments, each is a JSON file `{"schema": NAME, "valid": [...], "invalid": [...]}` of examples that the
document's schema of that name must accept and refuse.
"""

import json
import re
import sys

import jsonschema

STRUCTURE = "/usr/share/openapi-specification/schemas/v3.0/schema.json"
VERBS = {"get", "put", "post", "delete", "options", "head", "patch", "trace"}
faults = []


def structure_schema():
    with open(STRUCTURE, encoding="utf-8") as file:
        schema = json.load(file)
    schema["properties"]["openapi"]["pattern"] = r"^3\.1\.\d+$"
    schema["definitions"]["Schema"] = {"type": "object", "not": {"required": ["$ref"]}}
    schema["definitions"]["License"]["properties"]["identifier"] = {"type": "string"}
    schema["definitions"]["Info"]["properties"]["summary"] = {"type": "string"}
    return schema


def resolve(document, pointer):
    node = document
    for part in pointer[2:].split("/"):
        part = part.replace("~1", "/").replace("~0", "~")
        node = node[int(part)] if isinstance(node, list) else node[part]
    return node


def walk(node, path, visit):
    visit(node, path)
    if isinstance(node, dict):
        for key, value in node.items():
            walk(value, path + [key], visit)
    elif isinstance(node, list):
        for index, value in enumerate(node):
            walk(value, path + [str(index)], visit)


def check_references(document):
    def visit(node, path):
        if isinstance(node, dict) and isinstance(node.get("$ref"), str):
            try:
                resolve(document, node["$ref"])
            except (KeyError, IndexError, ValueError):
                faults.append(f"{'/'.join(path)}: {node['$ref']} leads nowhere")

    walk(document, [], visit)


def schemas_of(document):
    """Every Schema Object, by where it stands."""
    found = dict(document.get("components", {}).get("schemas", {}))

    def visit(node, path):
        inside_a_schema = "schema" in path[:-1] or path[:2] == ["components", "schemas"]
        if path and path[-1] == "schema" and not inside_a_schema:
            found["/".join(path)] = node

    walk(document, [], visit)
    return found


def check_operations(document):
    seen = set()
    for path, item in document["paths"].items():
        for verb, operation in item.items():
            if verb not in VERBS:
                continue
            where = f"{verb} {path}"
            if operation.get("operationId") in seen:
                faults.append(f"{where}: operationId is not unique")
            seen.add(operation.get("operationId"))
            parameters = [resolve(document, p["$ref"]) if "$ref" in p else p for p in operation.get("parameters", [])]
            names = [(p["in"], p["name"]) for p in parameters]
            if len(set(names)) != len(names):
                faults.append(f"{where}: a parameter is there twice")
            in_path = {name for place, name in names if place == "path"}
            if in_path != set(re.findall(r"\{(.*?)\}", path)):
                faults.append(f"{where}: path and parameters differ")
            if verb in ("get", "head") and "requestBody" in operation:
                faults.append(f"{where}: has a body")


def check_defaults(document):
    for name, parameter in document["components"]["parameters"].items():
        schema = parameter["schema"]
        for key in ("default", "x-default"):
            if key in schema:
                for error in jsonschema.Draft202012Validator(schema).iter_errors(schema[key]):
                    faults.append(f"{key} of {name}: {error.message}")


def check_examples(document, file_name):
    with open(file_name, encoding="utf-8") as file:
        examples = json.load(file)
    schema = dict(document, **{"$ref": "#/components/schemas/" + examples["schema"]})
    validator = jsonschema.Draft202012Validator(schema)
    for index, example in enumerate(examples["valid"]):
        for error in validator.iter_errors(example):
            faults.append(f"{file_name}: valid[{index}]: {error.message}")
    for index, example in enumerate(examples["invalid"]):
        if validator.is_valid(example):
            faults.append(f"{file_name}: invalid[{index}] is accepted")


def main():
    document = json.load(sys.stdin)
    for error in jsonschema.Draft4Validator(structure_schema()).iter_errors(document):
        faults.append(f"{'/'.join(str(p) for p in error.absolute_path)}: {error.message[:300]}")
    if not faults:
        check_references(document)
        for where, schema in schemas_of(document).items():
            for error in jsonschema.Draft202012Validator(jsonschema.Draft202012Validator.META_SCHEMA).iter_errors(schema):
                faults.append(f"schema {where}: {error.message}")
        check_operations(document)
    if not faults:
        check_defaults(document)
        for file_name in sys.argv[1:]:
            check_examples(document, file_name)
    for fault in faults:
        print(fault)
    print(f"{len(document.get('paths', {}))} paths, {len(schemas_of(document))} schemas, {len(faults)} faults")
    return 1 if faults else 0


sys.exit(main())
