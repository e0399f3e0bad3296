#!/usr/bin/env python3
"""Holds the pictures of the bench scenes to their golden hashes: the same bits whatever runs the shaders, with every
instruction set, with any number of threads.

usage: golden.py PROGRAM MANIFEST [--update] [--scenes REGEX]

bench/golden.txt has one line a scene: its name, its arguments, `=`, the hash. --update writes what the driver makes now, if
all settings agree. Where a picture is meant to change, look at it (`pumice_scenes --png`), then update.
"""
import os
import re
import subprocess
import sys
from pathlib import Path

GOLDEN = Path(__file__).resolve().parent / "golden.txt"
SETTINGS = [
    {},
    {"PUMICE_ENGINE": "jit", "PUMICE_THREADS": "1"},
    {"PUMICE_ENGINE": "jit", "PUMICE_THREADS": "8"},
    {"PUMICE_ENGINE": "interp", "PUMICE_THREADS": "2"},
    {"PUMICE_ENGINE": "interp", "PUMICE_ISA": "sse4", "PUMICE_THREADS": "1"},
]


def picture_hash(program, manifest, scene, arguments, setting):
    command = [program, "--scene", scene, "--driver", manifest, "--frames", "1", "--hash", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **setting}, timeout=300)
    found = re.search(r'"hash": "([0-9a-f]+)"', done.stdout)
    return found.group(1) if found else f"none (exit status {done.returncode}: {done.stderr.strip()[-200:]})"


def main():
    words = sys.argv[1:]
    if len(words) < 2 or words[0].startswith("-"):
        sys.exit(__doc__)
    program, manifest = words[:2]
    update = "--update" in words
    only = words[words.index("--scenes") + 1] if "--scenes" in words else "."
    failures = 0
    checked = 0
    lines = []
    for line in GOLDEN.read_text().splitlines():
        if line.startswith("#") or not line.strip():
            lines.append(line)
            continue
        name, _, golden = line.partition("=")
        scene, *arguments = name.split()
        golden = golden.strip()
        if re.search(only, scene):
            hashes = [picture_hash(program, manifest, scene, arguments, setting) for setting in SETTINGS]
            checked += 1
            expected = hashes[0] if update else golden
            for setting, found in zip(SETTINGS, hashes):
                if found != expected:
                    failures += 1
                    shown = " ".join(f"{key}={value}" for key, value in setting.items()) or "as usual"
                    print(f"{scene} ({shown}): {found}, not {expected}", flush=True)
            if update and len(set(hashes)) == 1:
                golden = hashes[0]
        lines.append(f"{name.strip()} = {golden}")
    if update:
        GOLDEN.write_text("\n".join(lines) + "\n")
    listed = {line.split()[0] for line in lines if line and not line.startswith("#")}
    for row in subprocess.run([program, "--list"], capture_output=True, text=True, check=True).stdout.splitlines():
        if row.split()[0] not in listed | {"empty_submit", "present"}:
            failures += 1
            print(f"{row.split()[0]}: no line in {GOLDEN}")
    print(f"{checked} scenes, {len(SETTINGS)} settings each: {failures} differences")
    return 1 if failures or not checked else 0


if __name__ == "__main__":
    sys.exit(main())
