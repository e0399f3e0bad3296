#!/usr/bin/env python3
"""Lists what the Vulkan registry says about commands, for the test of the loader contract.

registry_commands.py VK_XML OUT

Knows nothing of the driver: every extension of the registry is listed, advertised or not.
CORE(command, first parameter's type, version * 10)
EXTENSION(command, first parameter's type, extension, extensions and versions that the command also needs)
"""
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../icd/gen"))
import registry  # noqa: E402

root = registry.load(sys.argv[1])


def for_vulkan(element, attribute="api"):
    return "vulkan" in (element.get(attribute) or "vulkan").split(",")


first, alias = {}, {}
for command in root.iterfind("commands/command"):
    if not for_vulkan(command):
        continue
    if command.get("alias"):
        alias[command.get("name")] = command.get("alias")
    else:
        params = [p for p in command.findall("param") if for_vulkan(p)]
        first[command.findtext("proto/name")] = params[0].findtext("type")


def first_parameter(name):
    while name in alias:
        name = alias[name]
    return first[name]


with open(sys.argv[2], "w") as out:
    for feature in root.iterfind("feature"):
        if for_vulkan(feature):
            for command in feature.iterfind("require/command"):
                name = command.get("name")
                out.write("CORE(%s, %s, %s)\n" % (name, first_parameter(name), feature.get("number").replace(".", "")))
    for extension in root.iterfind("extensions/extension"):
        if not for_vulkan(extension, "supported"):
            continue
        for require in extension.findall("require"):
            # Both spellings of the registry: feature/extension of old, depends of new.
            needs = [require.get(k) for k in ("feature", "extension", "depends") if require.get(k)]
            for command in require.findall("command"):
                name = command.get("name")
                if name in first or name in alias:
                    out.write('EXTENSION(%s, %s, %s, "%s")\n' %
                              (name, first_parameter(name), extension.get("name"), ",".join(needs)))
