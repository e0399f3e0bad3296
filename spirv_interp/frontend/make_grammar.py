"""Makes the tables of SPIR-V from the machine-readable grammars.

usage: make_grammar.py spirv.core.grammar.json extinst.glsl.std.450.grammar.json out.inc

The lines of the output, by rising number:
  PUMICE_SPIRV_OP(number, Name, hasResultType, hasResult)
  PUMICE_SPIRV_OP_CAPABILITY(number of the instruction, number of a capability that allows it)
  PUMICE_SPIRV_CAPABILITY(number, Name)
  PUMICE_SPIRV_MODE(number, Name), execution modes
  PUMICE_GLSL_450(number, Name)
"""

import json
import os
import sys


def main():
    source, glsl, target = sys.argv[1:]
    with open(source, encoding="utf-8") as file:
        grammar = json.load(file)
    with open(glsl, encoding="utf-8") as file:
        extended = json.load(file)
    capabilities = {}
    capability_numbers = {}
    modes = {}
    for kind in grammar["operand_kinds"]:
        for enumerant in kind.get("enumerants", []):
            if kind["kind"] == "Capability":
                capabilities.setdefault(enumerant["value"], enumerant["enumerant"])
                capability_numbers[enumerant["enumerant"]] = enumerant["value"]
            elif kind["kind"] == "ExecutionMode":
                modes.setdefault(enumerant["value"], enumerant["enumerant"])
    seen = {}
    allowed = set()
    for instruction in grammar["instructions"]:
        kinds = [operand["kind"] for operand in instruction.get("operands", [])]
        # Aliases (KHR and core names of one number): the first name listed stays.
        seen.setdefault(instruction["opcode"],
                        (instruction["opname"], int("IdResultType" in kinds), int("IdResult" in kinds)))
        for capability in instruction.get("capabilities", []):
            allowed.add((instruction["opcode"], capability_numbers[capability]))
    os.makedirs(os.path.dirname(target), exist_ok=True)
    with open(target, "w", encoding="utf-8") as out:
        out.write("#ifdef PUMICE_SPIRV_OP\n")
        for number, (name, has_type, has_result) in sorted(seen.items()):
            out.write(f"PUMICE_SPIRV_OP({number}, {name}, {has_type}, {has_result})\n")
        out.write("#endif\n#ifdef PUMICE_SPIRV_OP_CAPABILITY\n")
        for number, capability in sorted(allowed):
            out.write(f"PUMICE_SPIRV_OP_CAPABILITY({number}, {capability})\n")
        for macro, table in (("PUMICE_SPIRV_CAPABILITY", capabilities), ("PUMICE_SPIRV_MODE", modes),
                             ("PUMICE_GLSL_450", {i["opcode"]: i["opname"] for i in extended["instructions"]})):
            out.write(f"#endif\n#ifdef {macro}\n")
            for number, name in sorted(table.items()):
                out.write(f"{macro}({number}, {name})\n")
        out.write("#endif\n")


main()
