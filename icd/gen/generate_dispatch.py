#!/usr/bin/env python3
"""Writes the dispatch tables from the Vulkan registry.

generate_dispatch.py VK_XML EXTENSIONS_INC OUT_ENTRYPOINTS_H OUT_COMMANDS_INC

entrypoints: a weak declaration of every function that may be looked up, in pumice::icd (an entry point that is
not implemented is null). commands: one line per (command, what provides it), sorted by name:
PUMICE_COMMAND(name, function, level, version * 10 or 0, extension or nullptr)
"""
import re
import sys

import registry

vk_xml, extensions_inc, out_entry, out_commands = sys.argv[1:5]
root = registry.load(vk_xml)
advertised = dict(re.findall(r"^PUMICE_EXTENSION\((\w+), *\d+, *(\w+)\)", open(extensions_inc).read(), re.M))

commands, alias = {}, {}
for c in root.find("commands"):
    if c.get("api") and "vulkan" not in c.get("api").split(","):
        continue
    if c.get("alias"):
        alias[c.get("name")] = c.get("alias")
        continue
    proto = c.find("proto")
    params = [p for p in c.findall("param") if not p.get("api") or "vulkan" in p.get("api").split(",")]
    commands[proto.find("name").text] = (proto.find("type").text, params)


def canonical(name):
    while name in alias:
        name = alias[name]
    return name


handle_parent = {t.find("name").text: t.get("parent") for t in root.iter("type")
                 if t.get("category") == "handle" and t.find("name") is not None}


def level(name):
    params = commands[canonical(name)][1]
    first = params[0].find("type").text
    if name == "vkGetInstanceProcAddr":
        return "Global"
    if first == "VkPhysicalDevice":
        return "PhysicalDevice"
    if first == "VkInstance":
        return "Instance"
    if first in ("VkDevice", "VkQueue", "VkCommandBuffer"):
        return "Device"
    return "Global"


rows = []
for feature in root.findall("feature"):
    if "vulkan" not in feature.get("api").split(","):
        continue
    version = int(feature.get("number").replace(".", ""))
    for command in feature.findall("require/command"):
        rows.append((command.get("name"), version, None))
found = set()
for extension in root.find("extensions"):
    name = extension.get("name")
    if name not in advertised:
        continue
    found.add(name)
    for require in extension.findall("require"):
        needs = re.findall(r"VK_(?:KHR|EXT)_\w+", (require.get("depends") or require.get("extension") or ""))
        if needs and not all(n in advertised for n in needs):
            continue
        for command in require.findall("command"):
            rows.append((command.get("name"), 0, name))
missing = set(advertised) - found
if missing:
    sys.exit("extensions not in the registry: %s" % sorted(missing))
rows = sorted(set(rows), key=lambda r: (r[0], r[1], r[2] or ""))
rows = [r for r in rows if canonical(r[0]) in commands]

platform = {"VkXcbSurfaceCreateInfoKHR", "VkXlibSurfaceCreateInfoKHR", "VkWaylandSurfaceCreateInfoKHR"}
functions = sorted({canonical(r[0]) for r in rows})
with open(out_entry, "w") as f:
    f.write("// Generated from the Vulkan registry by icd/gen/generate_dispatch.py.\n#pragma once\n\n"
            '#include "icd/vulkan.h"\n\nnamespace pumice::icd {\n\n')
    for name in functions:
        result, params = commands[name]
        text = ", ".join(re.sub(r"\s+", " ", "".join(p.itertext())).strip() if p.find("comment") is None else
                         re.sub(r"\s+", " ", "".join(t for t in p.itertext())).strip() for p in params)
        f.write("[[gnu::weak]] VKAPI_ATTR %s VKAPI_CALL %s(%s);\n" % (result, name, text))
    f.write("\n}  // namespace pumice::icd\n")
with open(out_commands, "w") as f:
    f.write("// Generated from the Vulkan registry by icd/gen/generate_dispatch.py.\n")
    for name, version, extension in rows:
        f.write("PUMICE_COMMAND(%s, %s, %s, %d, %s)\n" %
                (name, canonical(name), level(name), version, '"%s"' % extension if extension else "nullptr"))
