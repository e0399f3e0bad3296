#!/usr/bin/env python3
"""Writes C++ declarations for the extensions of newer_registry.xml, each only where <vulkan/vulkan.h> does not have it.

generate_declarations.py OUT_HEADER

As vulkan_core.h has them: the extension's macros, its structures and enumerants, the types of its commands. An enumerant of an
enumeration that is not the supplement's own is a constant of its type.
"""
import re
import sys

import registry

root = registry.newer()
types = {registry.name_of(t): t for t in root.find("types")}
commands = {registry.name_of(c): c for c in root.find("commands")}


def text(element):
    return re.sub(r"\s+", " ", "".join(element.itertext())).strip()


def enumerant(enum, number):
    name, base = enum.get("name"), enum.get("extends")
    if enum.get("alias"):
        return "constexpr auto %s = %s;" % (name, enum.get("alias"))
    if not base:
        return "#define %s %s" % (name, enum.get("value"))
    # Registry, "Assigning Extension Token Values".
    value = 1 << int(enum.get("bitpos")) if enum.get("bitpos") else 1000000000 + (number - 1) * 1000 + int(enum.get("offset"))
    return "constexpr %s %s = %s(%d);" % (base, name, base, value)


def declaration(name):
    t = types[name]
    if t.get("alias"):
        return "using %s = %s;" % (name, t.get("alias"))
    if t.get("category") == "struct":
        return "struct %s {\n%s};" % (name, "".join("  %s;\n" % text(m) for m in t.findall("member")))
    return text(t)


def function_type(name):
    c = commands[name]
    if c.get("alias"):
        return "using PFN_%s = PFN_%s;" % (name, c.get("alias"))
    return "typedef %s (VKAPI_PTR *PFN_%s)(%s);" % (c.findtext("proto/type"), name, ", ".join(text(p) for p in c.findall("param")))


with open(sys.argv[1], "w") as out:
    out.write("// Generated from newer_registry.xml by icd/gen/generate_declarations.py.\n#pragma once\n\n#include <vulkan/vulkan.h>\n")
    for extension in root.find("extensions"):
        lines = ["#ifndef " + extension.get("name"), "#define %s 1" % extension.get("name")]
        number = int(extension.get("number"))
        lines += [enumerant(e, number) for e in extension.iterfind("require/enum")]
        lines += [declaration(t.get("name")) for t in extension.iterfind("require/type")]
        lines += [function_type(c.get("name")) for c in extension.iterfind("require/command")]
        out.write("\n" + "\n".join(lines) + "\n#endif\n")
