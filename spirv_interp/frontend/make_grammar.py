"""Makes the table of SPIR-V instructions from the machine-readable grammar.

usage: make_grammar.py spirv.core.grammar.json out.inc

Each line of the output is PUMICE_SPIRV_OP(number, Name, hasResultType, hasResult) by rising number, or
PUMICE_SPIRV_CAPABILITY(number, Name).
"""

import json
import os
import sys


def main():
    source, target = sys.argv[1:]
    with open(source, encoding="utf-8") as file:
        grammar = json.load(file)
    seen = {}
    for instruction in grammar["instructions"]:
        kinds = [operand["kind"] for operand in instruction.get("operands", [])]
        # Aliases (KHR and core names of one number): the first name listed stays.
        seen.setdefault(instruction["opcode"],
                        (instruction["opname"], int("IdResultType" in kinds), int("IdResult" in kinds)))
    capabilities = {}
    for kind in grammar["operand_kinds"]:
        if kind["kind"] == "Capability":
            for enumerant in kind["enumerants"]:
                capabilities.setdefault(enumerant["value"], enumerant["enumerant"])
    os.makedirs(os.path.dirname(target), exist_ok=True)
    with open(target, "w", encoding="utf-8") as out:
        out.write("#ifdef PUMICE_SPIRV_OP\n")
        for number, (name, has_type, has_result) in sorted(seen.items()):
            out.write(f"PUMICE_SPIRV_OP({number}, {name}, {has_type}, {has_result})\n")
        out.write("#endif\n#ifdef PUMICE_SPIRV_CAPABILITY\n")
        for number, name in sorted(capabilities.items()):
            out.write(f"PUMICE_SPIRV_CAPABILITY({number}, {name})\n")
        out.write("#endif\n")


main()
