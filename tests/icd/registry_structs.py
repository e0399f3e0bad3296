#!/usr/bin/env python3
"""Lists the feature and property structures of the Vulkan registry, for the tests of what the device says about itself.

registry_structs.py VK_XML OUT

FEATURES(structure, sType, providers) and PROPERTIES(...) around MEMBER(structure, member) and END; providers are versions
("VK_VERSION_1_2") and extensions. Structures of platforms whose headers are not included are left out.
"""
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../icd/gen"))
import registry  # noqa: E402

root = registry.load(sys.argv[1])
alias = {t.get("name"): t.get("alias") for t in root.iterfind("types/type") if t.get("alias")}
providers = {}


def provide(name, provider):
    while name in alias:
        name = alias[name]
    providers.setdefault(name, []).append(provider)


for feature in root.iterfind("feature"):
    if "vulkan" in feature.get("api").split(","):
        for t in feature.iterfind("require/type"):
            provide(t.get("name"), feature.get("name"))
for extension in root.iterfind("extensions/extension"):
    if extension.get("platform") or "vulkan" not in extension.get("supported").split(","):
        continue
    for t in extension.iterfind("require/type"):
        provide(t.get("name"), extension.get("name"))

with open(sys.argv[2], "w") as out:
    for t in root.iterfind("types/type"):
        name = t.get("name")
        if t.get("category") != "struct" or t.get("alias") or name not in providers:
            continue
        for word, base in (("FEATURES", "VkPhysicalDeviceFeatures2"), ("PROPERTIES", "VkPhysicalDeviceProperties2")):
            if base not in (t.get("structextends") or "").split(",") or name == base:
                continue
            stype = next(m.get("values") for m in t.findall("member") if m.findtext("name") == "sType")
            out.write('%s(%s, %s, "%s")\n' % (word, name, stype, " ".join(providers[name])))
            for m in t.findall("member"):
                # What points to the application's memory is not the device's word.
                if m.findtext("name") not in ("sType", "pNext") and "*" not in "".join(m.itertext()):
                    out.write("MEMBER(%s, %s)\n" % (name, m.findtext("name")))
            out.write("END\n")
