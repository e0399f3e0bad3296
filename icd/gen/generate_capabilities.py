#!/usr/bin/env python3
"""Writes the tables of feature and property structures from the Vulkan registry.

generate_capabilities.py VK_XML EXTENSIONS_INC FEATURES_INC OUT_FEATURE_STRUCTS OUT_PROPERTY_STRUCTS

Structures taken are those of core 1.1 to 1.3 and those of the advertised extensions.
feature structs: PUMICE_FEATURE_STRUCT(sType, type, MEMBERS) with MEMBERS a list of PUMICE_FEATURE_MEMBER(type, name).
Every member must be a row of FEATURES_INC, and every row a member.
property structs: PUMICE_PROPERTY_STRUCT(sType, type, MEMBERS) for what repeats members of VkPhysicalDeviceVulkan1[123]Properties,
with MEMBERS a list of PUMICE_PROPERTY_MEMBER(aggregate, name there, name here).
"""
import re
import sys

import registry

vk_xml, extensions_inc, features_inc, out_features, out_properties = sys.argv[1:6]
root = registry.load(vk_xml)
advertised = set(re.findall(r"^PUMICE_EXTENSION\((\w+),", open(extensions_inc).read(), re.M))
rows = re.findall(r"^PUMICE_FEATURE\((\w+),", open(features_inc).read(), re.M)

required = set()
for feature in root.findall("feature"):
    if "vulkan" in feature.get("api").split(","):
        required |= {t.get("name") for t in feature.findall("require/type")}
for extension in root.find("extensions"):
    if extension.get("name") in advertised:
        required |= {t.get("name") for t in extension.findall("require/type")}

structs, alias = {}, {}
for t in root.find("types"):
    if t.get("category") != "struct":
        continue
    if t.get("alias"):
        alias[t.get("name")] = t.get("alias")
        continue
    members = [m for m in t.findall("member") if not m.get("api") or "vulkan" in m.get("api").split(",")]
    structs[t.get("name")] = (
        (t.get("structextends") or "").split(","),
        next((m.get("values") for m in members if m.find("name").text == "sType"), None),
        [(m.find("name").text, m.find("type").text) for m in members if m.find("name").text not in ("sType", "pNext")])
required = {alias.get(n, n) for n in required}

known = [m for m, _ in structs["VkPhysicalDeviceFeatures"][2]]
lines = []
for name in sorted(required):
    extends, stype, members = structs.get(name, ([], None, []))
    if "VkPhysicalDeviceFeatures2" not in extends or name == "VkPhysicalDeviceFeatures2":
        continue
    if any(kind != "VkBool32" for _, kind in members):
        sys.exit("%s has members that are no features" % name)
    known += [m for m, _ in members]
    lines.append("PUMICE_FEATURE_STRUCT(%s, %s,\n  %s)\n" % (
        stype, name, "\n  ".join("PUMICE_FEATURE_MEMBER(%s, %s)" % (name, m) for m, _ in members)))
if set(rows) != set(known) or len(rows) != len(set(rows)):
    sys.exit("%s: missing rows %s, rows of no structure %s, doubled %s" % (
        features_inc, sorted(set(known) - set(rows)), sorted(set(rows) - set(known)), sorted({r for r in rows if rows.count(r) > 1})))
with open(out_features, "w") as f:
    f.write("// Generated from the Vulkan registry by icd/gen/generate_capabilities.py.\n" + "".join(lines))

# The one structure whose members got other names in the aggregate.
renamed = {("VkPhysicalDeviceSubgroupProperties", m): "subgroup" + m[0].upper() + m[1:]
           for m in ("supportedStages", "supportedOperations", "quadOperationsInAllStages")}
aggregates = ["VkPhysicalDeviceVulkan11Properties", "VkPhysicalDeviceVulkan12Properties", "VkPhysicalDeviceVulkan13Properties"]
home = {m: i for i, a in enumerate(aggregates) for m, _ in structs[a][2]}
with open(out_properties, "w") as f:
    f.write("// Generated from the Vulkan registry by icd/gen/generate_capabilities.py.\n")
    for name in sorted(required):
        extends, stype, members = structs.get(name, ([], None, []))
        if "VkPhysicalDeviceProperties2" not in extends:
            continue
        there = [(renamed.get((name, m), m), m) for m, _ in members]
        if not all(t in home for t, _ in there):
            continue   # written by hand in properties.cpp
        f.write("PUMICE_PROPERTY_STRUCT(%s, %s,\n  %s)\n" % (
            stype, name, "\n  ".join("PUMICE_PROPERTY_MEMBER(v1%d, %s, %s)" % (home[t] + 1, t, m) for t, m in there)))
